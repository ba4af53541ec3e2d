"""What simplifies hulls against brute force over lists of faces, planes and inner points."""

from itertools import islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize

from garment_sim_ros.colliders.hulls.hull import convex_hull, inflate_vertices
from garment_sim_ros.colliders.hulls.hull_patch import (
    MAX_PATCH,
    face_neighbours,
    gather_link,
    gather_patch,
    replace_patch,
)
from garment_sim_ros.colliders.hulls.hull_placement import (
    MAX_CUTS,
    QUADRIC,
    VOLUME,
    Bounds,
    add_quadrics,
    fan_volume,
    place,
    quadric_error,
)
from garment_sim_ros.colliders.hulls.hull_simplify import _delete, _polish

CHECKED = settings(derandomize=True, deadline=None, max_examples=10)
SEEDS = st.integers(0, 10**6)


def random_hull(seed, count=30):
    rng = np.random.default_rng(seed)
    return convex_hull(rng.normal(size=(count, 3)) * [0.3, 0.2, 0.25])


def turned_alike(faces):
    """Oriented triangles, each from its least corner on."""
    return {tuple(np.roll(f, -int(np.argmin(f))).tolist()) for f in np.asarray(faces)}


def choices(faces):
    """Each vertex, edge and triangle, as `removed` has them, and a face that touches it."""
    seen = set()
    for f, face in enumerate(faces.tolist()):
        for c in range(3):
            a, b = face[c], face[(c + 1) % 3]
            for removed in ([a, a, a], [a, b, a]):
                if frozenset(removed) not in seen:
                    seen.add(frozenset(removed))
                    yield f, np.array(removed, np.int32)
        yield f, np.array(face, np.int32)


class Start:
    """A hull with room around another, as its simplification begins."""

    def __init__(self, seed):
        self.inner = random_hull(seed, 16)
        hull = inflate_vertices(self.inner, 0.02)
        self.count = len(hull.vertices)
        self.x = np.concatenate([hull.vertices, np.zeros_like(hull.vertices)])
        self.faces = hull.faces.astype(np.int32)
        self.neighbours = face_neighbours(self.faces)
        self.quadrics = np.zeros((len(self.x), 10))
        add_quadrics(self.x, self.faces, self.quadrics)
        self.limits = self.inner.planes + np.array([0.0, 0.0, 0.0, 0.05])
        self.touching = np.full((3 * len(self.faces), 4), np.nan)
        self.planes = np.empty((3 * MAX_PATCH + MAX_CUTS, 4))

    def bounds(self, objective):
        """What limits the result."""
        return Bounds(self.inner.vertices, self.limits, self.touching, objective)

    def place(self, patch, removed, objective):
        """Where the kernel puts a vertex for those removed, None if nowhere."""
        v = np.empty(3)
        found = place(
            *(self.x, self.quadric(removed), self.faces, self.bounds(objective)),
            *(patch.link, patch.outer, patch.edges),
            *(self.x[removed].mean(axis=0), self.planes, v),
        )
        return v if found else None

    def quadric(self, removed):
        return self.quadrics[np.unique(removed)].sum(axis=0)


class Patch:
    """The faces around removed vertices, and their outline, from the kernels."""

    def __init__(self, faces, neighbours, seed, removed):
        self.faces, self.link, self.outer = np.full((3, MAX_PATCH), -1, np.int32)
        self.count = gather_patch(faces, neighbours, seed, removed, self.faces)
        self.edges = gather_link(
            faces, neighbours, removed, self.faces, self.count, self.link, self.outer
        )

    def fan(self, vertex):
        """Triangles from the outline to a vertex."""
        loop = self.link[: self.edges]
        return np.stack([loop, np.roll(loop, -1), np.full_like(loop, vertex)], axis=1)


def naive_outline(faces, removed):
    """Faces that touch the removed ones; the loop around them, None if there is not just one."""
    patch = [f for f, face in enumerate(faces.tolist()) if set(face) & set(removed)]
    sides = [(faces[f, c], faces[f, (c + 1) % 3]) for f in patch for c in range(3)]
    rim = [(int(a), int(b)) for a, b in sides if not {int(a), int(b)} & set(removed)]
    following = dict(rim)
    if not rim or len(following) < len(rim):
        return set(patch), None
    loop = [rim[0][0]]
    while following.get(loop[-1], loop[0]) != loop[0]:
        loop.append(following[loop[-1]])
    inside = set(faces[patch].ravel().tolist()) & set(removed)
    disk = len(inside) + len(rim) - (3 * len(patch) + len(rim)) // 2 + len(patch) == 1
    return set(patch), loop if len(loop) == len(rim) >= 3 and disk else None


@CHECKED
@given(SEEDS, st.integers(5, 30))
def test_patches(seed, count):
    faces = random_hull(seed, count).faces.astype(np.int32)
    neighbours = face_neighbours(faces)
    for f, removed in choices(faces):
        patch = Patch(faces, neighbours, f, removed)
        expected, loop = naive_outline(faces, removed.tolist())
        assert patch.count == len(expected)
        assert set(patch.faces[: patch.count].tolist()) == expected
        assert patch.edges == (0 if loop is None else len(loop))
        if loop is None:
            continue
        first = loop.index(patch.link[0])
        assert patch.link[: patch.edges].tolist() == loop[first:] + loop[:first]
        for k in range(patch.edges):
            beyond, corner = divmod(int(patch.outer[k]), 3)
            assert beyond not in expected
            assert faces[beyond, corner] == patch.link[(k + 1) % patch.edges]
            assert faces[beyond, (corner + 1) % 3] == patch.link[k]


@CHECKED
@given(SEEDS)
def test_replaced_patches(seed):
    """One after the other, with vertices of their own; what is left are faces and neighbours."""
    rng = np.random.default_rng(seed)
    faces = random_hull(seed).faces.astype(np.int32)
    neighbours = face_neighbours(faces)
    expected = turned_alike(faces)
    done = 0
    for vertex in range(int(faces.max()) + 1, int(faces.max()) + 9):
        alive = np.flatnonzero(faces[:, 0] >= 0)
        f = int(rng.choice(alive))
        a, b, c = faces[f]
        removed = np.array([a, b, c if rng.random() < 0.5 else a], np.int32)
        patch = Patch(faces, neighbours, f, removed)
        _, loop = naive_outline(np.array(sorted(expected)), removed.tolist())
        assert patch.edges == (0 if loop is None else len(loop))
        if loop is None:
            continue
        done += 1
        replace_patch(
            *(faces, neighbours, patch.faces, patch.count),
            *(patch.link, patch.outer, patch.edges, vertex),
        )
        expected = {face for face in expected if not set(face) & set(removed.tolist())}
        expected |= turned_alike([(u, v, vertex) for u, v in zip(loop, loop[1:] + loop[:1])])
        alive = np.flatnonzero(faces[:, 0] >= 0)
        assert len(alive) == len(expected)
        assert turned_alike(faces[alive]) == expected
        np.testing.assert_array_equal(alive[face_neighbours(faces[alive])], neighbours[alive])
    assert done > 2


@CHECKED
@given(SEEDS)
def test_quadrics_are_squared_distances_to_planes(seed):
    hull = random_hull(seed)
    x = np.ascontiguousarray(hull.vertices)
    faces = np.concatenate([hull.faces, hull.faces[:1, [0, 1, 1]]]).astype(np.int32)
    quadrics = np.zeros((len(x), 10))
    add_quadrics(x, faces, quadrics)
    point = np.random.default_rng(seed).normal(size=3)
    for v in range(len(x)):
        expected = 0.0
        for a, b, c in x[hull.faces[(hull.faces == v).any(axis=1)]]:
            n = np.cross(b - a, c - a)
            twice_area = np.linalg.norm(n)
            expected += twice_area / 6.0 * ((point - a) @ n / twice_area) ** 2
        assert quadric_error(quadrics[v], point) == pytest.approx(expected, rel=1e-9)


def conditions(x, faces, inner, patch):
    """Where a vertex over the outline may be: rows (n, d) of n.v <= d, from the definitions."""
    link = patch.link[: patch.edges]
    rows = []
    for k in range(patch.edges):
        a, b, c = x[link[k]], x[link[(k + 1) % patch.edges]], x[link[(k + 2) % patch.edges]]
        p, q, r = x[faces[patch.outer[k] // 3]]
        rows.append((np.cross(q - p, r - p), p))  # below the face outside
        rows.append((-np.cross(b - a, c - a), a))  # over the ends of the edge that it will have
        for y in inner:  # below the face a, b, v: (b - a) x (v - a) . (y - a) <= 0
            rows.append((np.cross(y - a, b - a), a))
    normal, at = (np.array(part) for part in zip(*rows))
    length = np.linalg.norm(normal, axis=1)
    normal, at = normal[length > 1e-12] / length[length > 1e-12, None], at[length > 1e-12]
    return normal, np.einsum("ni,ni->n", normal, at)


def costs(x, quadric, patch, guess, objective):
    """What is to be least, as a function of the vertex, and its gradient."""
    if objective == VOLUME:
        ends = x[patch.link[: patch.edges]]
        down = np.cross(ends, np.roll(ends, -1, axis=0)).sum(axis=0)
        centre = guess - 5.0 * down / np.linalg.norm(down)
        return lambda v: ((v - centre) ** 2).sum(), lambda v: 2.0 * (v - centre)
    Q = np.zeros((4, 4))
    Q[np.triu_indices(4)] = quadric
    Q += np.triu(Q, 1).T
    pull = 1e-3 * np.trace(Q[:3, :3])

    def cost(v):
        return np.append(v, 1.0) @ Q @ np.append(v, 1.0) + pull * ((v - guess) ** 2).sum()

    return cost, lambda v: 2.0 * (Q @ np.append(v, 1.0))[:3] + 2.0 * pull * (v - guess)


@pytest.mark.parametrize("objective", [QUADRIC, VOLUME])
@settings(CHECKED, max_examples=3)
@given(SEEDS)
def test_places(objective, seed):
    """Allowed, and no place that is allowed is better; there is none only where none is."""
    start = Start(seed)
    placed, refused = 0, 0
    for f, removed in islice(choices(start.faces), 0, None, 2):
        patch = Patch(start.faces, start.neighbours, f, removed)
        if patch.edges == 0:
            continue
        v = start.place(patch, removed, objective)
        normal, offset = conditions(start.x, start.faces, start.inner.vertices, patch)
        normal = np.concatenate([normal, start.limits[:, :3]])
        offset = np.concatenate([offset, start.limits[:, 3]])
        room = linprog(
            [0, 0, 0, 1],
            A_ub=np.column_stack([normal, np.ones(len(normal))]) * [1, 1, 1, -1],
            b_ub=offset,
            bounds=[(-5, 5)] * 3 + [(None, None)],
        )
        if abs(room.fun) < 1e-6:  # the kernel keeps a margin of 1e-7
            continue
        assert (v is not None) == (room.fun < 0.0)
        if v is None:
            refused += 1
            continue
        placed += 1
        assert (normal @ v - offset).max() < 1e-6
        guess = start.x[removed].mean(axis=0)
        cost, slope = costs(start.x, start.quadric(removed), patch, guess, objective)
        best = minimize(
            cost,
            room.x[:3],
            jac=slope,
            constraints={
                "type": "ineq",
                "fun": lambda y, n=normal, d=offset: d - n @ y,
                "jac": lambda y, n=normal: -n,
            },
            method="SLSQP",
            options={"maxiter": 200, "ftol": 1e-14},
        )
        assert cost(v) <= best.fun * (1.0 + 1e-4) + 1e-7
    assert placed > 5
    assert refused > 0


@CHECKED
@given(SEEDS)
def test_fans_bound_what_they_replace(seed):
    """The volume under a fan is that under the patch whose vertex it puts back."""
    hull = random_hull(seed)
    x, faces = np.ascontiguousarray(hull.vertices), hull.faces.astype(np.int32)
    neighbours = face_neighbours(faces)
    for v in range(len(x)):
        f = int(np.flatnonzero((faces == v).any(axis=1))[0])
        patch = Patch(faces, neighbours, f, np.full(3, v, np.int32))
        own = x[faces[(faces == v).any(axis=1)]]
        expected = np.linalg.det(own).sum() / 6.0
        assert fan_volume(x, patch.link, patch.edges, x[v]) == pytest.approx(expected, abs=1e-12)


def naive_cost(start, patch, removed, v, objective):
    """What a vertex costs in the place of those removed: its error, or the volume gained."""
    if objective == QUADRIC:
        return quadric_error(start.quadric(removed), v)
    corners = np.concatenate([start.x, [v]])
    old = start.faces[patch.faces[: patch.count]]
    return (np.linalg.det(corners[patch.fan(-1)]).sum() - np.linalg.det(corners[old]).sum()) / 6.0


@pytest.mark.parametrize("objective", [QUADRIC, VOLUME])
@pytest.mark.parametrize(("fewer", "triangles_only"), [(2, False), (4, False), (4, True)])
@settings(CHECKED, max_examples=6)
@given(SEEDS)
def test_the_cheapest_goes_first(fewer, triangles_only, objective, seed):
    """Of all edges and, at half their cost, triangles; its best vertex comes in their place."""
    start = Start(seed)
    best, expected, expected_v, gone = np.inf, set(), None, 0
    for f, removed in choices(start.faces):
        ends = len(set(removed.tolist()))
        patch = Patch(start.faces, start.neighbours, f, removed)
        if ends == 1 or 2 * (ends - 1) > fewer or patch.edges == 0:
            continue
        if triangles_only and ends == 2:
            continue
        v = start.place(patch, removed, objective)
        if v is None:
            continue
        cost = naive_cost(start, patch, removed, v, objective) * (1.0 if ends == 2 else 0.5)
        if cost < best:
            best, expected_v, gone = cost, v, 2 * (ends - 1)
            old = start.faces[patch.faces[: patch.count]]
            expected = turned_alike(start.faces) - turned_alike(old)
            expected |= turned_alike(patch.fan(start.count))
    scratch = np.empty((3, MAX_PATCH), np.int32)
    first_count = start.count
    _, deleted = _delete(
        *(start.x, start.count, start.quadrics, start.faces, start.neighbours),
        *(start.bounds(objective), len(start.faces) - fewer, triangles_only),
        *(scratch, start.planes),
    )
    assert deleted == (best < np.inf)
    if deleted:
        np.testing.assert_allclose(start.x[first_count], expected_v, atol=1e-9)
    if gone == fewer:
        assert turned_alike(start.faces[start.faces[:, 0] >= 0]) == expected


@pytest.mark.parametrize("objective", [QUADRIC, VOLUME])
@settings(CHECKED, max_examples=6)
@given(SEEDS)
def test_polishing(objective, seed):
    """Each vertex goes to its best place where that is cheaper, one after the other."""
    start, found = Start(seed), Start(seed)
    moved = 0
    for vertex in range(start.count):
        f = int(np.flatnonzero((start.faces == vertex).any(axis=1))[-1])
        removed = np.full(3, vertex, np.int32)
        patch = Patch(start.faces, start.neighbours, f, removed)
        start.touching[:] = np.nan
        v = start.place(patch, removed, objective)
        if v is None:
            continue
        before = quadric_error(start.quadric(removed), start.x[vertex])
        if naive_cost(start, patch, removed, v, objective) < (
            before if objective == QUADRIC else 0
        ):
            start.x[vertex] = v
            moved += 1
    scratch = np.empty((3, MAX_PATCH), np.int32)
    _polish(
        *(found.x, found.count, found.quadrics, found.faces, found.neighbours),
        *(found.bounds(objective), scratch, found.planes),
    )
    assert moved > 0
    np.testing.assert_allclose(found.x, start.x, atol=1e-6)
