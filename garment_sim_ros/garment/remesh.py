"""Even triangles on a surface with boundaries, to an exact number of vertices.

Rounds of splitting long edges, collapsing short ones, flipping edges towards Delaunay triangles,
and smoothing along the surface (Botsch and Kobbelt 2004, "A remeshing approach to multiresolution
modeling"). Boundary vertices only move along their boundary, inner ones never join two boundaries.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.connectivity import adjacency
from garment_sim_ros.garment.subdivide import split_edges
from garment_sim_ros.geometry.topology import edge_table, vertex_normals
from garment_sim_ros.geometry.triangles import triangle_areas

_ROUNDS = 6
_ATTEMPTS = 12
_SHORTEST = 0.5
"""No edge shall be shorter than this share of the median."""


def remeshed(
    vertices: FloatArray,
    triangles: IntArray,
    count: int,
    project: Callable[[FloatArray], FloatArray],
) -> tuple[FloatArray, IntArray]:
    """The surface with `count` vertices and edges as even as they can be.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices of a manifold, shape [t, 3].
        count: Vertices wanted.
        project: Moves points [n, 3] onto the surface.

    Raises:
        GeometryError: The surface cannot have that many vertices (too few for its holes).
    """
    area = triangle_areas(vertices, triangles).sum()
    length = float(np.sqrt(area / count / np.sqrt(0.75)))
    for _ in range(_ROUNDS):
        vertices, triangles = _round(vertices, triangles, length, project)
        length *= np.sqrt(len(vertices) / count)
    best, evenest = (vertices, triangles), -1.0
    for _ in range(_ATTEMPTS):
        vertices, triangles = _with(count, vertices, triangles, project)
        for _ in range(_ROUNDS):
            vertices, triangles = _relaxed(vertices, triangles, project)
        size = _lengths(vertices, edge_table(triangles)[0])
        median = float(np.median(size))
        if size.min() / median > evenest:
            best, evenest = (vertices, triangles), float(size.min()) / median
        if evenest > _SHORTEST:
            break
        # A vertex too many here is one too few elsewhere, which no smoothing mends.
        vertices, triangles = _collapsed(vertices, triangles, _SHORTEST * median, len(vertices))
    return best


def _with(
    count: int,
    vertices: FloatArray,
    triangles: IntArray,
    project: Callable[[FloatArray], FloatArray],
) -> tuple[FloatArray, IntArray]:
    """The surface with exactly so many vertices: longest edges split, or shortest collapsed."""
    for _ in range(_ATTEMPTS):
        missing = count - len(vertices)
        if missing == 0:
            return vertices, triangles
        if missing > 0:
            edges, side_edge, _ = edge_table(triangles)
            longest = np.argsort(-_lengths(vertices, edges), kind="stable")
            chosen = _apart(longest, side_edge, len(edges), missing)
            vertices, triangles = split_edges(vertices, triangles, chosen, edges, side_edge)
        else:
            vertices, triangles = _collapsed(vertices, triangles, np.inf, -missing)
        vertices, triangles = _relaxed(vertices, triangles, project)
    if len(vertices) != count:
        raise GeometryError(f"the surface cannot be meshed with {count} vertices")
    return vertices, triangles


def _lengths(vertices: FloatArray, edges: IntArray) -> FloatArray:
    return np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)


def _round(
    vertices: FloatArray,
    triangles: IntArray,
    length: float,
    project: Callable[[FloatArray], FloatArray],
) -> tuple[FloatArray, IntArray]:
    edges, side_edge, _ = edge_table(triangles)
    size = _lengths(vertices, edges)
    vertices, triangles = split_edges(
        vertices, triangles, size > 4.0 / 3.0 * length, edges, side_edge
    )
    vertices, triangles = _collapsed(vertices, triangles, 0.8 * length, len(vertices))
    return _relaxed(vertices, triangles, project)


def _relaxed(
    vertices: FloatArray, triangles: IntArray, project: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, IntArray]:
    """Edges flipped, then vertices moved along the surface; their number stays."""
    triangles = _flipped(vertices, triangles)
    return project(_smoothed(vertices, triangles)), triangles


def _apart(
    order: NDArray[np.int64], side_edge: IntArray, edge_count: int, wanted: int
) -> NDArray[np.bool_]:
    """The first `wanted` edges in `order` of which no two share a triangle."""
    beside: list[list[int]] = [[] for _ in range(edge_count)]
    for t, sides in enumerate(side_edge.tolist()):
        for e in sides:
            beside[e].append(t)
    taken: set[int] = set()
    chosen = np.zeros(edge_count, dtype=bool)
    for e in order.tolist():
        if wanted == 0:
            break
        if taken.isdisjoint(beside[e]):
            taken.update(beside[e])
            chosen[e] = True
            wanted -= 1
    return chosen


def _collapsed(
    vertices: FloatArray, triangles: IntArray, limit: float, most: int
) -> tuple[FloatArray, IntArray]:
    """Edges shorter than `limit` collapsed, shortest first, at most `most` of them."""
    edges, _, count = edge_table(triangles)
    size = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    on_boundary = np.zeros(len(vertices), dtype=bool)
    on_boundary[edges[count == 1]] = True
    x = vertices.copy()
    faces = triangles.tolist()
    around: list[set[int]] = [set() for _ in range(len(vertices))]
    for f, face in enumerate(faces):
        for v in face:
            around[v].add(f)
    alive = np.ones(len(vertices), dtype=bool)
    touched = np.zeros(len(vertices), dtype=bool)
    for e in np.argsort(size, kind="stable").tolist():
        if most == 0 or size[e] >= limit:
            break
        a, b = edges[e].tolist()
        if touched[a] or touched[b]:
            continue
        if on_boundary[a] and on_boundary[b] and count[e] == 2:
            continue
        if on_boundary[b] and not on_boundary[a]:
            a, b = b, a
        shared = around[a] & around[b]
        ring_a = {v for f in around[a] for v in faces[f]} - {a, b}
        ring_b = {v for f in around[b] for v in faces[f]} - {a, b}
        if len(ring_a) == 2 and not on_boundary[a]:
            a, b, ring_a, ring_b = b, a, ring_b, ring_a
        # A vertex within one triangle of its three neighbours: that triangle is what stays.
        within = len(ring_b) == 2 and not on_boundary[b]
        fewest = 2 if on_boundary[a] else 3
        least = len(ring_a) if within else min(len(ring_a), len(ring_b))
        if len(ring_a & ring_b) != len(shared) or least < fewest:
            continue
        to_a = within or (on_boundary[a] and not on_boundary[b])
        place = x[a] if to_a else 0.5 * (x[a] + x[b])
        moved = [(f, a) for f in around[a] - shared] + [(f, b) for f in around[b] - shared]
        if any(_turns(x, faces[f], v, place) for f, v in moved):
            continue
        x[a] = place
        for f in around[b] - shared:
            faces[f] = [a if v == b else v for v in faces[f]]
            around[a].add(f)
        for f in shared:
            for v in faces[f]:
                around[v].discard(f)
            faces[f] = []
        alive[b] = False
        touched[[a, b]] = True
        most -= 1
    number = np.cumsum(alive) - 1
    kept = np.array([face for face in faces if face], dtype=np.int32)
    return x[alive], number[kept].astype(np.int32)


def _turns(x: FloatArray, face: list[int], moved: int, place: FloatArray) -> bool:
    """Whether moving one corner turns a triangle by more than 45 degrees or flattens it."""
    k = face.index(moved)
    p, q, r = x[moved].tolist(), x[face[k - 2]].tolist(), x[face[k - 1]].tolist()
    n = _cross(p, q, r)
    m = _cross(place.tolist(), q, r)
    dot = n[0] * m[0] + n[1] * m[1] + n[2] * m[2]
    nn = n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
    mm = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
    return dot <= 0.0 or dot * dot < 0.5 * nn * mm


def _cross(p: list[float], q: list[float], r: list[float]) -> tuple[float, float, float]:
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


def _flipped(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Inner edges whose opposite angles sum to over 180 degrees flipped, worst first."""
    edges, side_edge, count = edge_table(triangles)
    side = np.argsort(side_edge.ravel(), kind="stable")
    first = (np.cumsum(count) - count)[count == 2]
    s, t = side[first], side[first + 1]
    flat = triangles.ravel()
    after, before = [
        np.arange(triangles.size).reshape(-1, 3)[:, order].ravel()
        for order in ([1, 2, 0], [2, 0, 1])
    ]
    # Triangle s runs a, b, c and triangle t runs b, a, d.
    a, b, c, d = flat[s], flat[after[s]], flat[before[s]], flat[before[t]]
    excess = _angle(vertices, c, a, b) + _angle(vertices, d, b, a) - np.pi
    left, right = _area(vertices, c, a, d), _area(vertices, d, b, c)
    old = _area(vertices, a, b, c) + _area(vertices, b, a, d)
    fits = (np.einsum("ni,ni->n", left, old) > 0.0) & (np.einsum("ni,ni->n", right, old) > 0.0)
    stride = len(vertices)
    existing = set((edges[:, 0].astype(np.int64) * stride + edges[:, 1]).tolist())
    used: set[int] = set()
    triangles = triangles.copy()
    worst = np.argsort(-excess, kind="stable")
    for i in worst[excess[worst] > 1e-3].tolist():
        f, g = int(s[i]) // 3, int(t[i]) // 3
        key = int(min(c[i], d[i])) * stride + int(max(c[i], d[i]))
        if not fits[i] or f in used or g in used or key in existing:
            continue
        triangles[f] = c[i], a[i], d[i]
        triangles[g] = d[i], b[i], c[i]
        used.update((f, g))
        existing.add(key)
    return triangles


def _area(x: FloatArray, a: IntArray, b: IntArray, c: IntArray) -> FloatArray:
    return np.cross(x[b] - x[a], x[c] - x[a])


def _angle(x: FloatArray, apex: IntArray, a: IntArray, b: IntArray) -> FloatArray:
    u, v = x[a] - x[apex], x[b] - x[apex]
    return np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ni,ni->n", u, v))


def _smoothed(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Vertices moved half way to the middle of their neighbours, along surface and boundary."""
    neighbours = adjacency(triangles, len(vertices))
    step = neighbours @ vertices / neighbours.sum(axis=1).reshape(-1, 1) - vertices
    step = np.asarray(step)
    normal = np.empty_like(vertices)
    vertex_normals(vertices, triangles, normal)
    step -= np.einsum("ni,ni->n", step, normal)[:, None] * normal

    _, side_edge, count = edge_table(triangles)
    boundary = count[side_edge] == 1
    start, end = triangles[boundary], np.roll(triangles, -1, axis=1)[boundary]
    following, before = np.zeros((2, len(vertices)), dtype=np.int64)
    following[start], before[end] = end, start
    p, q = vertices[before[start]], vertices[following[start]]
    chord = (q - p) / np.maximum(np.linalg.norm(q - p, axis=1, keepdims=True), 1e-300)
    along = np.einsum("ni,ni->n", 0.5 * (p + q) - vertices[start], chord)
    step[start] = along[:, None] * chord
    return vertices + 0.5 * step
