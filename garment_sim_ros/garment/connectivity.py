"""Which edges, triangles and parts of a mesh belong together."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from garment_sim_ros.arrays import IntArray


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


def adjacency(triangles: IntArray, vertex_count: int) -> sp.csr_matrix:
    """Symmetric matrix with a 1 for every edge, shape [v, v]."""
    a, b = edge_table(triangles)[0].T
    ones = np.ones(2 * len(a))
    shape = (vertex_count, vertex_count)
    return sp.csr_matrix((ones, (np.r_[a, b], np.r_[b, a])), shape=shape)


def components(triangles: IntArray, vertex_count: int) -> tuple[int, IntArray]:
    """Number of connected parts, and the part of each vertex, shape [v]."""
    count, label = connected_components(adjacency(triangles, vertex_count), directed=False)
    return int(count), label
