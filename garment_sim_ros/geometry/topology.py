"""Connectivity of triangle meshes: edges, adjacent triangles, boundaries, vertex normals."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.jit import kernel


@dataclass(frozen=True, kw_only=True)
class Topology:
    """Edges of a triangle mesh and what lies beside them.

    Attributes:
        edges: Vertex pairs, lower index first, sorted, unique, shape [e, 2].
        triangle_count: Triangles at each edge: 1 on a boundary, 2 inside, shape [e].
        opposite: For every pair of triangles that share an edge, the two vertices that they do
            not share, lower index first, sorted, unique, shape [b, 2].
    """

    edges: IntArray
    triangle_count: IntArray
    opposite: IntArray


def _half_edges(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Directed edges [3 t, 2] of all triangles and the vertex opposite to each [3 t]."""
    t = np.asarray(triangles, dtype=np.int32).reshape(-1, 3)
    return np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), t[:, [2, 0, 1]].T.ravel()


def mesh_topology(triangles: IntArray) -> Topology:
    """Edges and adjacent triangles of a mesh; degenerate triangles are left out.

    Where more than two triangles share an edge, each is paired with the next in file order.

    Args:
        triangles: Vertex indices, shape [t, 3].
    """
    t = np.asarray(triangles, dtype=np.int32).reshape(-1, 3)
    proper = (t[:, 0] != t[:, 1]) & (t[:, 1] != t[:, 2]) & (t[:, 2] != t[:, 0])
    half, apex = _half_edges(t[proper])
    if not len(half):
        empty = np.zeros((0, 2), np.int32)
        return Topology(edges=empty, triangle_count=np.zeros(0, np.int32), opposite=empty)
    half = np.sort(half, axis=1)
    order = np.lexsort((half[:, 1], half[:, 0]))
    half, apex = half[order], apex[order]
    same = (half[1:] == half[:-1]).all(axis=1)
    first = np.flatnonzero(np.concatenate([[True], ~same]))
    pairs = np.sort(np.stack([apex[:-1][same], apex[1:][same]], axis=1), axis=1)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    return Topology(
        edges=half[first],
        triangle_count=np.diff(first, append=len(half)).astype(np.int32),
        opposite=np.unique(pairs, axis=0).astype(np.int32),
    )


def edge_table(triangles: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """The undirected edges of a triangle mesh.

    Args:
        triangles: Vertex indices, shape [t, 3].

    Returns:
        Edges with the smaller vertex first, sorted, shape [e, 2]; the edge of each triangle side
        (side k runs from corner k to corner k + 1), shape [t, 3]; triangles at each edge, shape
        [e].
    """
    start = triangles.astype(np.int64).ravel()
    end = np.roll(triangles, -1, axis=1).astype(np.int64).ravel()
    stride = start.max(initial=0) + 1
    key, side_edge, count = np.unique(
        np.minimum(start, end) * stride + np.maximum(start, end),
        return_inverse=True,
        return_counts=True,
    )
    edges = np.stack(np.divmod(key, stride), axis=1).astype(np.int32)
    return edges, side_edge.reshape(-1, 3).astype(np.int32), count.astype(np.int32)


def triangles_across(triangles: IntArray) -> IntArray:
    """The triangle across each edge ab, bc, ca; -1 at a border or where more than two meet."""
    if not len(triangles):
        return np.zeros((0, 3), np.int32)
    _, edge, count = edge_table(triangles)
    order = np.argsort(edge.ravel(), kind="stable")
    twin = np.full(edge.size, -1, np.int32)
    first = np.concatenate([[0], np.cumsum(count)[:-1]])[count == 2]
    a, b = order[first], order[first + 1]
    twin[a], twin[b] = b // 3, a // 3
    return twin.reshape(-1, 3)


def hinge_vertices(triangles: IntArray) -> IntArray:
    """Pairs of triangles that share an edge: the edge's ends, then the opposite corners.

    Where more than two triangles share an edge, each is paired with the next in file order.

    Returns:
        Vertices, shape [h, 4].
    """
    t = np.asarray(triangles, dtype=np.int32).reshape(-1, 3)
    half, apex = _half_edges(t[(t[:, 0] != t[:, 1]) & (t[:, 1] != t[:, 2]) & (t[:, 2] != t[:, 0])])
    half = np.sort(half, axis=1)
    order = np.lexsort((half[:, 1], half[:, 0]))
    half, apex = half[order], apex[order]
    same = np.flatnonzero((half[1:] == half[:-1]).all(axis=1) & (apex[1:] != apex[:-1]))
    return np.column_stack([half[same], apex[same], apex[same + 1]]).astype(np.int32)


def non_manifold_edges(triangles: IntArray) -> IntArray:
    """Edges with more than two triangles, or two of opposite winding, shape [k, 2]."""
    half, _ = _half_edges(triangles)
    directed, count = np.unique(half, axis=0, return_counts=True)
    return np.unique(np.sort(directed[count > 1], axis=1), axis=0).astype(np.int32)


def pinched_vertices(triangles: IntArray) -> NDArray[np.int64]:
    """Vertices at which boundary loops touch: two fans of triangles meet in a point; ascending."""
    vertex, count = np.unique(_boundary_edges(triangles)[:, 0], return_counts=True)
    return vertex[count > 1]


def _boundary_edges(triangles: IntArray) -> NDArray[np.int64]:
    """Edges of one triangle, in its direction, by rising first vertex, shape [e, 2]."""
    half = np.unique(_half_edges(triangles)[0].astype(np.int64), axis=0)
    n = int(half.max(initial=0)) + 1
    return half[~np.isin(half[:, 0] * n + half[:, 1], half[:, 1] * n + half[:, 0])]


def boundary_loops(triangles: IntArray) -> list[IntArray]:
    """Closed boundary loops, each as its vertices in the direction of its triangles' edges.

    The longest loop comes first; equal ones are ordered by their lowest vertex, at which each
    starts.

    Raises:
        GeometryError: A vertex lies on more than one loop (two fans meet in a point).
    """
    outer = _boundary_edges(triangles)
    twice = np.flatnonzero(outer[1:, 0] == outer[:-1, 0])
    if twice.size:
        raise GeometryError(
            f"boundary loops touch at vertex {outer[twice[0], 0]}; each must be separate"
        )
    successor = dict(outer.tolist())  # by rising vertex
    loops = []
    for start in list(successor):
        if start not in successor:
            continue
        loop = [start]
        vertex = successor.pop(start)
        while vertex != start:
            if vertex not in successor:
                raise GeometryError(f"the boundary is not closed at vertex {vertex}")
            loop.append(vertex)
            vertex = successor.pop(vertex)
        loops.append(np.array(loop, dtype=np.int32))
    return sorted(loops, key=lambda loop: (-len(loop), int(loop[0])))


@kernel()
def vertex_normals(x, triangles, normal):
    """Unit vertex normals, weighted by triangle area; zero where a vertex has no area.

    Args:
        x: Positions [m], shape [v, 3].
        triangles: Vertex indices, counter-clockwise seen from outside, shape [t, 3].
        normal: Output, shape [v, 3].
    """
    normal[:, :] = 0.0
    for t in range(triangles.shape[0]):
        a = triangles[t, 0]
        b = triangles[t, 1]
        c = triangles[t, 2]
        ux = x[b, 0] - x[a, 0]
        uy = x[b, 1] - x[a, 1]
        uz = x[b, 2] - x[a, 2]
        vx = x[c, 0] - x[a, 0]
        vy = x[c, 1] - x[a, 1]
        vz = x[c, 2] - x[a, 2]
        nx = uy * vz - uz * vy
        ny = uz * vx - ux * vz
        nz = ux * vy - uy * vx
        normal[a, 0] += nx
        normal[a, 1] += ny
        normal[a, 2] += nz
        normal[b, 0] += nx
        normal[b, 1] += ny
        normal[b, 2] += nz
        normal[c, 0] += nx
        normal[c, 1] += ny
        normal[c, 2] += nz
    for i in range(normal.shape[0]):
        nx = normal[i, 0]
        ny = normal[i, 1]
        nz = normal[i, 2]
        squared = nx * nx + ny * ny + nz * nz
        if squared > 0.0:
            scale = np.float32(1.0) / np.sqrt(squared)
            normal[i, 0] = nx * scale
            normal[i, 1] = ny * scale
            normal[i, 2] = nz * scale
