"""Meshing of the mannequin against plain sets of faces: its first surface, and what evens it."""

from collections import Counter
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.body.mannequin.mesh import _collapse, _compacted, _edges, _flip, _smooth
from garment_sim_ros.geometry.marching_tetrahedra import marching_tetrahedra

CHECKED = settings(derandomize=True, deadline=None, max_examples=4)
SEEDS = st.integers(0, 10**6)


def bumpy_field(seed, shape=(7, 5, 8), flatness=1.0):
    """Half of two melting balls, and noise; the first layer in y is the middle plane."""
    rng = np.random.default_rng(seed)
    x, y, z = np.indices(shape) / (max(shape) - 1)
    balls = [np.hypot(np.hypot(x - 0.4, flatness * y), z - c) - 0.28 for c in (0.35, 0.65)]
    return np.minimum(*balls) + rng.uniform(-0.03, 0.03, shape)


def half_mesh(seed, flatness=1.0):
    """Its surface, shaken but within the middle plane, and edge lengths wanted there."""
    rng = np.random.default_rng(seed)
    field = bumpy_field(seed, flatness=flatness)
    x, triangles = marching_tetrahedra(field, np.zeros(3), 1.0)
    x += rng.uniform(-0.1, 0.1, x.shape) * [1.0, 0.0, 1.0]
    return x, triangles, rng.uniform(0.7, 1.4, len(x))


def turned_alike(faces):
    """Oriented triangles, each from its least corner on."""
    return {tuple(np.roll(f, -int(np.argmin(f))).tolist()) for f in np.asarray(faces)}


def assert_same_kind_of_surface(x, triangles, x_before, triangles_before):
    """Oriented, of the same Euler characteristic, and open in the plane y = 0 only."""
    euler = []
    for points, faces in ((x_before, triangles_before), (x, triangles)):
        sides = Counter((f[c], f[c - 2]) for f in faces.tolist() for c in range(3))
        assert set(sides.values()) == {1}
        rim = {end for side in sides if side[::-1] not in sides for end in side}
        assert (points[sorted(rim), 1] == 0.0).all()
        edges = {frozenset(side) for side in sides}
        euler.append(len(np.unique(faces)) - len(edges) + len(faces))
    assert euler[0] == euler[1]


def naive_iso_surface(field):
    """Corners of triangles, tetrahedron by tetrahedron, outwards by the field's gradient in it."""
    tetrahedra = []  # all turned alike, which decides how quadrilaterals are cut in two
    for a, b, c in permutations(np.eye(3, dtype=int)):
        middle = [a, a + b] if np.linalg.det([a, b, c]) > 0.0 else [a + b, a]
        tetrahedra.append([0 * a, *middle, a + b + c])
    found = []
    for cube in np.ndindex(*(n - 1 for n in field.shape)):
        for tetrahedron in tetrahedra:
            nodes = [cube + corner for corner in tetrahedron]
            value = [field[tuple(node)] for node in nodes]
            inner = [k for k in range(4) if value[k] < 0.0]
            outer = [k for k in range(4) if value[k] >= 0.0]
            cuts = {}
            for i in inner:
                for o in outer:
                    low, high = sorted((i, o), key=lambda k: nodes[k].sum())
                    s = np.clip(value[low] / (value[low] - value[high]), 0.02, 0.98)
                    cuts[i, o] = nodes[low] + s * (nodes[high] - nodes[low])
            ring = list(cuts.values())
            if len(ring) == 4:
                ring[2:] = ring[3], ring[2]
            A = np.array(nodes[1:]) - nodes[0]
            gradient = np.linalg.solve(A, np.array(value[1:]) - value[0])
            for k in range(1, len(ring) - 1):
                triangle = np.array([ring[0], ring[k], ring[k + 1]])
                a, b, c = triangle
                outwards = np.cross(b - a, c - a) @ gradient > 0.0
                found.append(triangle if outwards else triangle[::-1])
    return np.array(found)


def sorted_triangles(corners):
    """Oriented triangles [t, 3, 3] in an order of their own, to compare sets of them."""
    first = np.lexsort(np.round(corners, 6).transpose(2, 0, 1)[::-1], axis=1)[:, 0]
    turned = np.array([np.roll(t, -k, axis=0) for t, k in zip(corners, first)])
    return turned[np.lexsort(np.round(turned.reshape(len(turned), 9), 6).T[::-1])]


@CHECKED
@given(SEEDS)
def test_iso_surface(seed):
    field = bumpy_field(seed, (6, 4, 7))
    x, triangles = marching_tetrahedra(field, np.zeros(3), 1.0)
    expected = naive_iso_surface(field)
    assert len(triangles) == len(expected) > 50
    np.testing.assert_allclose(
        sorted_triangles(x[triangles]), sorted_triangles(expected), atol=1e-12
    )
    assert len(np.unique(np.round(x, 9), axis=0)) == len(x)


def turns_over(corners, moved, place):
    """Whether a triangle turns by over 60 degrees or becomes a sliver, unless it was one."""
    after = [place if k == moved else corner for k, corner in enumerate(corners)]
    before, now = (np.cross(c[1] - c[0], c[2] - c[0]) for c in (corners, after))
    longest = max(np.sum((after[k] - after[k - 1]) ** 2) for k in range(3))
    area_before, area = np.linalg.norm(before), np.linalg.norm(now)
    if area_before <= 0.05 * longest:
        return False
    with np.errstate(invalid="ignore"):
        angle = np.degrees(np.arccos(before @ now / (area_before * area)))
    return angle > 60.0 or area < 0.1 * longest


def naive_collapse(x, triangles, size, wanted):
    """Edges shorter than a limit that grows, with sets of neighbours; a dict of faces is left."""
    x, faces = x.copy(), {t: list(f) for t, f in enumerate(triangles.tolist())}
    alive = set(range(len(x)))

    def faces_at(v):
        return [f for f in faces.values() if v in f]

    def relative(a, b):
        return np.linalg.norm(x[a] - x[b]) / (size[a] + size[b])

    def may_collapse(a, b, place):
        at_a, at_b = faces_at(a), faces_at(b)
        shared = [f for f in at_a if b in f]
        around_a, around_b = {v for f in at_a for v in f}, {v for f in at_b for v in f}
        if len((around_a & around_b) - {a, b}) != len(shared):
            return False
        if len(shared) != (1 if x[a, 1] == x[b, 1] == 0.0 else 2):
            return False
        if x[a, 1] == 0.0 < x[b, 1] and any(x[v, 1] == 0.0 for v in around_b - around_a):
            return False
        for v, other, at in ((a, b, at_a), (b, a, at_b)):
            for f in at:
                if other in f:
                    continue
                if place[1] == 0.0 and all(x[w, 1] == 0.0 for w in f if w != v):
                    return False
                if turns_over(x[f], f.index(v), place):
                    return False
        return True

    sides = [(f[c], f[(c + 1) % 3]) for f in faces.values() for c in range(3)]
    limit = 0.5 * np.mean([relative(a, b) for a, b in sides])
    count = sum(1 if x[v, 1] == 0.0 else 2 for v in alive)
    for _ in range(400):
        for t in range(len(triangles)):
            for c in range(3):
                if t not in faces or count <= wanted:
                    break
                a, b = faces[t][c], faces[t][(c + 1) % 3]
                if relative(a, b) > limit:
                    continue
                if x[b, 1] == 0.0 < x[a, 1]:
                    a, b = b, a
                place = x[a] if x[a, 1] == 0.0 < x[b, 1] else 0.5 * (x[a] + x[b])
                if may_collapse(a, b, place):
                    x[a] = place
                    alive.remove(b)
                    count -= 1 if x[b, 1] == 0.0 else 2
                    faces = {
                        k: [a if v == b else v for v in f]
                        for k, f in faces.items()
                        if not (a in f and b in f)
                    }
        if count <= wanted:
            break
        limit *= 1.03
    return x, alive, faces


@settings(CHECKED, max_examples=3)
@given(SEEDS, st.sampled_from([(0.5, 1.0), (0.3, 4.0)]))
def test_collapses(seed, how):
    """Round halves, and flat ones, of which the rim in the middle plane is a large part."""
    share, flatness = how
    x, triangles, size = half_mesh(seed, flatness)
    wanted = int(share * (2 * len(x) - (x[:, 1] == 0.0).sum()))
    expected_x, expected_alive, expected_faces = naive_collapse(x, triangles, size, wanted)
    found, faces = x.copy(), triangles.copy()
    alive, kept = _collapse(found, faces, size, wanted)
    assert set(np.flatnonzero(alive).tolist()) == expected_alive
    assert {t: faces[t].tolist() for t in np.flatnonzero(kept).tolist()} == expected_faces
    np.testing.assert_allclose(found[alive], expected_x[alive], atol=1e-12)
    left, left_triangles = _compacted(found, faces, alive, kept)
    assert_same_kind_of_surface(left, left_triangles, x, triangles)


def naive_flip(x, triangles):
    """One pass over the edges by number, on a set of faces."""
    faces = turned_alike(triangles)
    near = {v: set() for v in range(len(x))}
    for f in faces:
        for v in f:
            near[v] |= set(f) - {v}
    edges = sorted({tuple(sorted((a, b))) for a in near for b in near[a]})
    frozen, flipped = set(), set()  # vertices of flipped edges; faces made by them

    def angle(apex, a, b):
        u, v = x[a] - x[apex], x[b] - x[apex]
        return np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v))

    def normal(f):
        a, b, c = x[list(f)]
        return np.cross(b - a, c - a)

    for edge in edges:
        both = [f for f in faces if set(edge) <= set(f)]
        if len(both) < 2 or flipped & set(both):
            continue
        f, g = both
        (c,), (d,) = set(f) - set(edge), set(g) - set(edge)
        a, b = (f * 2)[f.index(c) + 1 : f.index(c) + 3]  # f runs a, b, c and g runs b, a, d
        if {c, d} & frozen or d in near[c] or min(len(near[a]), len(near[b])) <= 3:
            continue
        if x[c, 1] == x[d, 1] == 0.0 or angle(c, a, b) + angle(d, a, b) < np.pi + 1e-3:
            continue
        new = [(c, a, d), (d, b, c)]
        if min((normal(f) + normal(g)) @ normal(h) for h in new) <= 0.0:
            continue
        made = turned_alike(new)
        faces = (faces - {f, g}) | made
        flipped |= made
        frozen |= {a, b, c, d}
    return faces


@CHECKED
@given(SEEDS)
def test_flips(seed):
    x, triangles, size = half_mesh(seed)
    x, triangles = _compacted(x, triangles, *_collapse(x, triangles, size, len(x)))
    found = _flip(x, triangles, *_edges(triangles))
    assert turned_alike(found) == naive_flip(x, triangles)
    assert len(turned_alike(found) - turned_alike(triangles)) > 8
    assert_same_kind_of_surface(x, found, x, triangles)


@pytest.mark.parametrize("y", [0.0, 0.01])
def test_an_edge_between_corners_in_the_middle_plane_would_leave_the_surface(y):
    x = np.array([[-1, 0.05, 0], [1, 0.05, 0], [0, y, 0.1], [0, y, -0.1], [-1, 0, 1], [1, 0, 1.0]])
    triangles = np.array([[0, 1, 2], [1, 0, 3], [0, 2, 4], [2, 1, 5]], np.int32)
    found = turned_alike(_flip(x, triangles, *_edges(triangles)))
    assert found == naive_flip(x, triangles)
    assert (found == turned_alike(triangles)) == (y == 0.0)


def test_a_tetrahedron_has_no_edge_to_flip():
    x = np.array([[-1, 0.3, 0], [1, 0.3, 0], [0, 0.4, 0.1], [0, 0.4, -0.1]])
    triangles = np.array([[0, 1, 2], [1, 0, 3], [0, 2, 3], [2, 1, 3]], np.int32)
    assert turned_alike(_flip(x, triangles, *_edges(triangles))) == turned_alike(triangles)


def test_edges_are_those_of_the_faces():
    _, triangles, _ = half_mesh(0)
    faces = [set(f) for f in triangles.tolist()]
    edges, owners = _edges(triangles)
    assert len({tuple(e) for e in edges.tolist()}) == len(edges)
    for edge, owner in zip(edges.tolist(), owners.tolist()):
        assert edge[0] < edge[1]
        expected = {t for t, f in enumerate(faces) if set(edge) <= f}
        assert set(owner) - {-1} == expected
    assert len(edges) == len({frozenset((a, b)) for f in faces for a in f for b in f if a != b})


def naive_smooth(x, triangles, size):
    """Vertex by vertex: 35 % of the way to the weighted mean, as far as it is in the surface."""
    out = x.copy()
    for v in range(len(x)):
        own = [f for f in triangles.tolist() if v in f]
        near = sorted({w for f in own for w in f} - {v})
        normal = sum(np.cross(x[b] - x[a], x[c] - x[a]) for a, b, c in own)
        if x[v, 1] == 0.0:
            near = [w for w in near if x[w, 1] == 0.0]
            normal = normal * [1.0, 0.0, 1.0]
        if near:
            weight = [np.linalg.norm(x[w] - x[v]) / (size[w] + size[v]) for w in near]
            way = np.average(x[near], axis=0, weights=weight) - x[v]
            n = normal / np.linalg.norm(normal)
            out[v] += 0.35 * (way - way @ n * n)
    return out


@CHECKED
@given(SEEDS)
def test_smoothing(seed):
    x, triangles, size = half_mesh(seed)
    edges = _edges(triangles)[0]
    ends = {
        v
        for a, b in edges.tolist()
        for v, w in ((a, b), (b, a))
        if x[v, 1] == 0.0 and x[w, 1] == 0.0
    }
    found = _smooth(x, triangles, size, edges)
    assert ends
    np.testing.assert_allclose(found, naive_smooth(x, triangles, size), atol=1e-12)
    np.testing.assert_array_equal(found[:, 1] == 0.0, x[:, 1] == 0.0)


def test_what_cannot_get_smaller_is_left():
    """A pyramid over the middle plane, of which every edge is needed."""
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0, 1], [0.5, 1, 0.3]])
    triangles = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32)
    alive, kept = _collapse(x.copy(), triangles.copy(), np.ones(4), 1)
    assert alive.all()
    assert kept.all()
