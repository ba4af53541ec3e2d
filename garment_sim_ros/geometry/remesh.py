"""Even triangles on a surface with boundaries, to an exact number of vertices.

Where edges shall be of different lengths, triangles are even beside the length that is wanted at
their place: whatever is said of lengths here means an edge over what is wanted at its ends.

Rounds of splitting long edges, collapsing short ones, flipping edges towards Delaunay triangles,
and smoothing along the surface (Botsch and Kobbelt 2004, "A remeshing approach to multiresolution
modeling"). Vertices on lines, which are boundaries and what else is asked for, only move along
their line; where lines meet or bend they stay. Inner vertices never join two lines.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.connectivity import links
from garment_sim_ros.geometry.lines import Lines, Project
from garment_sim_ros.geometry.subdivide import split_edges
from garment_sim_ros.geometry.topology import edge_table, vertex_normals
from garment_sim_ros.geometry.triangles import triangle_areas

_ROUNDS = 6
_MOST_ROUNDS = 30
_SETTLED = 0.01
"""Rounds end where they change the number of vertices by a smaller share."""
_ATTEMPTS = 12
_SHORTEST = 0.5
"""No edge shall be shorter than this share of the median."""

Sizing = Callable[[FloatArray], FloatArray]
"""Length of edges that is wanted at points [n, 3] of a surface, in any unit, shape [n]."""


class _Mesh(NamedTuple):
    """A surface on its way: positions, triangles, lines and corners as in `Lines`.

    Attributes:
        size: Length of edges that is wanted at each vertex, shape [v].
    """

    x: FloatArray
    triangles: IntArray
    lines: IntArray
    corner: NDArray[np.bool_]
    size: FloatArray

    @property
    def on_line(self) -> NDArray[np.bool_]:
        """Vertices on lines, shape [v]."""
        flags = np.zeros(len(self.x), dtype=bool)
        flags[self.lines] = True
        return flags

    def is_line(self, edges: IntArray) -> NDArray[np.bool_]:
        """Which of some edges [e, 2], lower vertex first, are of a line, shape [e]."""
        keys = (np.sort(e, axis=1).astype(np.int64) for e in (edges, self.lines))
        own, lines = (k[:, 0] * len(self.x) + k[:, 1] for k in keys)
        return np.isin(own, lines)

    def lengths(self, edges: IntArray) -> FloatArray:
        """Lengths of edges over what is wanted at their ends, shape [e]."""
        length = np.linalg.norm(self.x[edges[:, 0]] - self.x[edges[:, 1]], axis=1)
        lengths: FloatArray = length / self.size[edges].mean(axis=1)
        return lengths


def remeshed(
    vertices: FloatArray,
    triangles: IntArray,
    count: int,
    project: Project,
    lines: Lines | None = None,
    sizing: Sizing | None = None,
) -> tuple[FloatArray, IntArray]:
    """As `remeshed_along`, without the lines."""
    return remeshed_along(vertices, triangles, count, project, lines, sizing)[:2]


def remeshed_along(
    vertices: FloatArray,
    triangles: IntArray,
    count: int,
    project: Project,
    lines: Lines | None = None,
    sizing: Sizing | None = None,
) -> tuple[FloatArray, IntArray, IntArray]:
    """The surface with `count` vertices and edges as even as they can be.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices of a manifold, shape [t, 3].
        count: Vertices wanted.
        project: Moves points onto the surface.
        lines: What is kept; None: boundaries, whose corners are cut.
        sizing: Where edges shall be longer or shorter; None: they are alike everywhere.

    Returns:
        Vertices [m], triangles, and the edges of lines, shape [f, 2].

    Raises:
        GeometryError: The surface cannot have that many vertices (too few for its holes).
    """
    uniform = sizing is None
    sizing = sizing or (lambda x: np.ones(len(x)))
    size = sizing(vertices)
    area = area_by_size(vertices, triangles, size)
    length = float(np.sqrt(area / count / np.sqrt(0.75)))
    relax = _Relaxing(project, lines.project if lines else None, sizing)
    if lines is None:
        edges, _, sides = edge_table(triangles)
        lines = Lines(edges[sides == 1], np.zeros(len(vertices), bool), project)
    mesh = _Mesh(vertices, triangles, lines.edges, lines.corner, size)
    for _ in range(_ROUNDS if uniform else _MOST_ROUNDS):
        before = len(mesh.x)
        mesh = _round(mesh, length, relax)
        if uniform:
            length *= np.sqrt(len(mesh.x) / count)
        elif abs(len(mesh.x) - before) < _SETTLED * before:
            break
    best, evenest = mesh, -1.0
    for _ in range(_ATTEMPTS):
        mesh = _with(count, mesh, relax)
        for _ in range(_ROUNDS):
            mesh = relax(mesh)
        lengths = mesh.lengths(edge_table(mesh.triangles)[0])
        median = float(np.median(lengths))
        if lengths.min() / median > evenest:
            best, evenest = mesh, float(lengths.min()) / median
        if evenest > _SHORTEST:
            break
        # A vertex too many here is one too few elsewhere, which no smoothing mends.
        mesh = _collapsed(mesh, _SHORTEST * median, len(mesh.x))
    return best.x, best.triangles, best.lines


def area_by_size(vertices: FloatArray, triangles: IntArray, size: FloatArray) -> float:
    """Area of a surface over the squared lengths that its edges shall have at vertices [v].

    Even triangles make as many vertices of it as this over the square root of 3/4.
    """
    each = (size[triangles] ** -2.0).mean(axis=1)
    return float((triangle_areas(vertices, triangles) * each).sum())


class _Relaxing:
    """Edges flipped, then vertices moved along surface and lines; their number stays."""

    def __init__(self, project: Project, to_lines: Project | None, sizing: Sizing) -> None:
        self._project, self._to_lines, self._sizing = project, to_lines, sizing

    def __call__(self, mesh: _Mesh) -> _Mesh:
        mesh = mesh._replace(triangles=_flipped(mesh))
        x = self._project(_smoothed(mesh))
        if self._to_lines is not None:
            there = mesh.on_line & ~mesh.corner
            x[there] = self._to_lines(x[there])
            x[mesh.corner] = mesh.x[mesh.corner]
        return mesh._replace(x=x, size=self._sizing(x))


def _with(count: int, mesh: _Mesh, relax: _Relaxing) -> _Mesh:
    """The surface with exactly so many vertices: longest edges split, or shortest collapsed."""
    for _ in range(_ATTEMPTS):
        missing = count - len(mesh.x)
        if missing == 0:
            return mesh
        if missing > 0:
            edges, side_edge, _ = edge_table(mesh.triangles)
            longest = np.argsort(-mesh.lengths(edges), kind="stable")
            mesh = _split(mesh, _apart(longest, side_edge, len(edges), missing))
        else:
            mesh = _collapsed(mesh, np.inf, -missing)
        mesh = relax(mesh)
    if len(mesh.x) != count:
        raise GeometryError(f"the surface cannot be meshed with {count} vertices")
    return mesh


def _round(mesh: _Mesh, length: float, relax: _Relaxing) -> _Mesh:
    edges = edge_table(mesh.triangles)[0]
    mesh = _split(mesh, mesh.lengths(edges) > 4.0 / 3.0 * length)
    mesh = _collapsed(mesh, 0.8 * length, len(mesh.x))
    return relax(mesh)


def _split(mesh: _Mesh, chosen: NDArray[np.bool_]) -> _Mesh:
    """The chosen edges cut at their middles, those of lines into two of the line."""
    edges, side_edge, _ = edge_table(mesh.triangles)
    x, triangles = split_edges(mesh.x, mesh.triangles, chosen, edges, side_edge)
    of_line = mesh.is_line(edges)
    cut = of_line & chosen
    middle = (len(mesh.x) + np.cumsum(chosen) - 1)[cut]
    halves = [np.stack([edges[cut, k], middle], axis=1) for k in (0, 1)]
    return _Mesh(
        x,
        triangles,
        np.concatenate([edges[of_line & ~chosen], *halves]).astype(np.int32),
        np.concatenate([mesh.corner, np.zeros(len(x) - len(mesh.x), bool)]),
        np.concatenate([mesh.size, mesh.size[edges[chosen]].mean(axis=1)]),
    )


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


def _collapsed(mesh: _Mesh, limit: float, most: int) -> _Mesh:
    """Edges shorter than `limit` collapsed, shortest first, at most `most` of them."""
    edges, _, count = edge_table(mesh.triangles)
    size = mesh.lengths(edges)
    on_boundary = np.zeros(len(mesh.x), dtype=bool)
    on_boundary[edges[count == 1]] = True
    is_line = mesh.is_line(edges)
    # What has the lower rank gives way: inner vertices, those of lines, corners.
    rank = mesh.on_line.astype(int) + mesh.corner
    x = mesh.x.copy()
    faces = mesh.triangles.tolist()
    around: list[set[int]] = [set() for _ in range(len(x))]
    for f, face in enumerate(faces):
        for v in face:
            around[v].add(f)
    into = np.arange(len(x))
    touched = np.zeros(len(x), dtype=bool)
    for e in np.argsort(size, kind="stable").tolist():
        if most == 0 or size[e] >= limit:
            break
        a, b = edges[e].tolist()
        if touched[a] or touched[b]:
            continue
        if min(rank[a], rank[b]) == 2 or (rank[a] and rank[b] and not is_line[e]):
            continue
        if rank[b] > rank[a]:
            a, b = b, a
        shared = around[a] & around[b]
        ring_a = {v for f in around[a] for v in faces[f]} - {a, b}
        ring_b = {v for f in around[b] for v in faces[f]} - {a, b}
        if len(ring_a) == 2 and not rank[a]:
            a, b, ring_a, ring_b = b, a, ring_b, ring_a
        # A vertex within one triangle of its three neighbours: that triangle is what stays.
        within = len(ring_b) == 2 and not rank[b]
        fewest = 2 if on_boundary[a] else 3
        least = len(ring_a) if within else min(len(ring_a), len(ring_b))
        if len(ring_a & ring_b) != len(shared) or least < fewest:
            continue
        to_a = within or rank[a] > rank[b]
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
        into[b] = a
        touched[[a, b]] = True
        most -= 1
    alive = into == np.arange(len(x))
    number = np.cumsum(alive) - 1
    kept = np.array([face for face in faces if face], dtype=np.int32)
    lines = number[into[mesh.lines]].astype(np.int32)
    lines = lines[lines[:, 0] != lines[:, 1]]
    return _Mesh(
        x[alive], number[kept].astype(np.int32), lines, mesh.corner[alive], mesh.size[alive]
    )


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


def _flipped(mesh: _Mesh) -> IntArray:
    """Inner edges whose opposite angles sum to over 180 degrees flipped, worst first."""
    vertices, triangles = mesh.x, mesh.triangles
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
    fits &= ~mesh.is_line(edges)[count == 2]
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


def _smoothed(mesh: _Mesh) -> FloatArray:
    """Vertices moved half way to the middle of their neighbours, along surface and lines.

    A neighbour weighs the more the shorter the edge to it shall be: a vertex whose edges are as
    long as they shall be stays where it is.
    """
    vertices, triangles = mesh.x, mesh.triangles
    edges = edge_table(triangles)[0]
    near = links(edges, 1.0 / mesh.size[edges].mean(axis=1), len(vertices))
    step = np.asarray(near @ vertices / near.sum(axis=1).reshape(-1, 1)) - vertices
    normal = np.empty_like(vertices)
    vertex_normals(vertices, triangles, normal)
    step -= np.einsum("ni,ni->n", step, normal)[:, None] * normal

    ends = np.concatenate([mesh.lines, mesh.lines[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    step[ends[:, 0]] = 0.0
    # Between its two neighbours on the line; where there are more or fewer it stays.
    first, size = np.unique(ends[:, 0], return_index=True, return_counts=True)[1:]
    pair = first[(size == 2) & ~mesh.corner[ends[first, 0]]]
    here, before, after = ends[pair, 0], ends[pair, 1], ends[pair + 1, 1]
    p, q = vertices[before], vertices[after]
    chord = (q - p) / np.maximum(np.linalg.norm(q - p, axis=1, keepdims=True), 1e-300)
    to_p, to_q = (mesh.size[here] + mesh.size[end] for end in (before, after))
    share = (to_p / (to_p + to_q))[:, None]
    along = np.einsum("ni,ni->n", (1.0 - share) * p + share * q - vertices[here], chord)
    step[here] = along[:, None] * chord
    return vertices + 0.5 * step
