"""Checks of a garment mesh, and the repairs that cannot change its shape.

Repaired and noted: equal vertices, vertices that nothing uses, degenerate and repeated triangles,
inconsistent winding. Refused: edges with three or more triangles, fans that touch in one vertex
only, and surfaces with one side.
"""

from collections import deque

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.connectivity import components
from garment_sim_ros.geometry.topology import edge_table


def triangulate(
    vertices: FloatArray, corners: NDArray[np.int64], sizes: NDArray[np.int64]
) -> IntArray:
    """Triangles of polygons; a quad is split along its shorter diagonal, more corners as a fan.

    Args:
        vertices: Positions, shape [v, 3].
        corners: Vertex indices of all polygons one after the other, shape [sum of sizes].
        sizes: Corners of each polygon, shape [p].

    Returns:
        Vertex indices in the order of the polygons, shape [t, 3].
    """
    first = np.cumsum(sizes) - sizes
    # Triangle k of a polygon is (start, start + k + 1, start + k + 2), cyclic from corner `shift`.
    shift = np.zeros(len(sizes), dtype=np.int64)
    quads = np.flatnonzero(sizes == 4)
    q = corners[first[quads][:, None] + np.arange(4)]
    shift[quads] = _other_diagonal(vertices[q])
    polygon = np.repeat(np.arange(len(sizes)), sizes - 2)
    k = np.arange(len(polygon)) - np.repeat(np.cumsum(sizes - 2) - (sizes - 2), sizes - 2)
    local = np.stack([np.zeros_like(k), k + 1, k + 2], axis=1)
    local = (local + shift[polygon, None]) % sizes[polygon, None]
    return corners[first[polygon][:, None] + local].astype(np.int32)


def _other_diagonal(x: FloatArray) -> NDArray[np.bool_]:
    """Whether quads [n, 4, 3] are split from corner 1 to 3 rather than from 0 to 2."""

    def folds(a: int, b: int, c: int, d: int) -> NDArray[np.bool_]:
        """Whether the two triangles beside the diagonal a-c face away from each other."""
        left = np.cross(x[:, b] - x[:, a], x[:, c] - x[:, a])
        right = np.cross(x[:, c] - x[:, a], x[:, d] - x[:, a])
        return np.einsum("ni,ni->n", left, right) < 0.0

    d02 = np.linalg.norm(x[:, 2] - x[:, 0], axis=1)
    d13 = np.linalg.norm(x[:, 3] - x[:, 1], axis=1)
    folds02, folds13 = folds(0, 1, 2, 3), folds(1, 2, 3, 0)
    return np.where(folds02 == folds13, d13 < d02, folds02)


def repaired(
    vertices: FloatArray, triangles: IntArray
) -> tuple[FloatArray, IntArray, tuple[str, ...]]:
    """A clean mesh, vertices in order of their first appearance, and what was repaired.

    Args:
        vertices: Finite positions, shape [v, 3].
        triangles: Vertex indices, shape [t, 3].

    Returns:
        Vertices, triangles, and one sentence per repair.

    Raises:
        GeometryError: Nothing is left, or the surface is not a manifold with two sides.
    """
    notes = []
    vertices = vertices + 0.0  # -0.0 and 0.0 are one place
    _, first, place = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    representative = first[place.ravel()]
    welded = len(vertices) - len(first)
    if welded:
        notes.append(f"{welded} vertices at the place of another were welded")
    triangles = representative[triangles].astype(np.int32)

    degenerate = _degenerate(vertices, triangles)
    if degenerate.any():
        notes.append(f"{degenerate.sum()} degenerate triangles were dropped")
    triangles = triangles[~degenerate]
    _, unique = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    if len(unique) < len(triangles):
        notes.append(f"{len(triangles) - len(unique)} repeated triangles were dropped")
    triangles = triangles[np.sort(unique)]
    if not len(triangles):
        raise GeometryError("no triangle with an area is left; allowed: a surface")

    used, compact = np.unique(triangles, return_inverse=True)
    unreferenced = len(vertices) - welded - len(used)
    if unreferenced:
        notes.append(f"{unreferenced} vertices that no triangle uses were dropped")
    vertices = np.ascontiguousarray(vertices[used])
    triangles = compact.reshape(-1, 3).astype(np.int32)

    triangles, flipped = _consistently_wound(triangles)
    if flipped:
        notes.append(f"{flipped} triangles were turned to agree with their neighbours")
    _check_fans(triangles, len(vertices))
    parts, _ = components(triangles, len(vertices))
    if parts > 1:
        notes.append(f"the mesh has {parts} separate parts")
    return vertices, triangles, tuple(notes)


def _degenerate(vertices: FloatArray, triangles: IntArray) -> NDArray[np.bool_]:
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    area2 = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.linalg.norm(s, axis=1) for s in (b - a, c - b, a - c)], axis=0)
    return area2 <= 1e-9 * longest**2


def _consistently_wound(triangles: IntArray) -> tuple[IntArray, int]:
    """Triangles wound alike within each part, by turning the smaller share of it."""
    edges, side_edge, count = edge_table(triangles)
    if count.max() > 2:
        bad = np.flatnonzero(count > 2)
        a, b = edges[bad[0]]
        raise GeometryError(
            f"{len(bad)} edges have more than 2 triangles, the first joins vertices {a} and {b}; "
            "allowed: a manifold surface"
        )
    along = (triangles < np.roll(triangles, -1, axis=1)).ravel()
    side = np.argsort(side_edge.ravel(), kind="stable")
    inner = np.flatnonzero(count == 2)
    start = np.cumsum(count) - count
    s, t = side[start[inner]], side[start[inner] + 1]
    neighbours: list[list[tuple[int, bool]]] = [[] for _ in range(len(triangles))]
    for i, j, disagree in zip(
        (s // 3).tolist(), (t // 3).tolist(), (along[s] == along[t]).tolist()
    ):
        neighbours[i].append((j, disagree))
        neighbours[j].append((i, disagree))
    turn = np.full(len(triangles), -1, dtype=np.int8)
    for seed in range(len(triangles)):
        if turn[seed] >= 0:
            continue
        turn[seed] = 0
        part = [seed]
        queue = deque(part)
        while queue:
            i = queue.popleft()
            for j, disagree in neighbours[i]:
                wanted = turn[i] ^ disagree
                if turn[j] < 0:
                    turn[j] = wanted
                    part.append(j)
                    queue.append(j)
                elif turn[j] != wanted:
                    raise GeometryError(
                        f"the surface has one side (met at triangle {j}); "
                        "allowed: a surface that can be wound consistently"
                    )
        if 2 * turn[part].sum() > len(part):
            turn[part] ^= 1
    turned = turn == 1
    triangles = triangles.copy()
    triangles[turned] = triangles[turned][:, ::-1]
    return triangles, int(turned.sum())


def _check_fans(triangles: IntArray, vertex_count: int) -> None:
    """Refuse vertices at which two fans of triangles touch."""
    _, side_edge, count = edge_table(triangles)
    side = np.argsort(side_edge.ravel(), kind="stable")
    first = (np.cumsum(count) - count)[count == 2]
    s, t = side[first], side[first + 1]
    # Corners at one vertex are one fan where inner edges link them. Sides of wound triangles run
    # against each other: the start of one is the end of the other.
    after = np.arange(triangles.size).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    links = (np.r_[s, after[s]], np.r_[after[t], t])
    graph = sp.coo_matrix((np.ones(len(links[0])), links), shape=(triangles.size,) * 2)
    fans, fan = connected_components(graph, directed=False)
    if fans > vertex_count:
        vertex_of_fan = np.zeros(fans, dtype=np.int64)
        vertex_of_fan[fan] = triangles.ravel()
        bad = np.flatnonzero(np.bincount(vertex_of_fan, minlength=vertex_count) > 1)
        raise GeometryError(
            f"{len(bad)} vertices join fans of triangles that share no edge, the first is "
            f"{bad[0]}; allowed: a manifold surface"
        )
