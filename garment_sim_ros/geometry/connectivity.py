"""Which edges, triangles and parts of a mesh belong together."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.topology import edge_table


def adjacency(triangles: IntArray, vertex_count: int) -> sp.csr_matrix:
    """Symmetric matrix with a 1 for every edge, shape [v, v]."""
    edges = edge_table(triangles)[0]
    return links(edges, np.ones(len(edges)), vertex_count)


def links(edges: IntArray, weight: FloatArray, vertex_count: int) -> sp.csr_matrix:
    """Symmetric matrix with the weight of each edge [e, 2], shape [v, v]."""
    a, b = edges.T
    shape = (vertex_count, vertex_count)
    return sp.csr_matrix((np.r_[weight, weight], (np.r_[a, b], np.r_[b, a])), shape=shape)


def components(triangles: IntArray, vertex_count: int) -> tuple[int, IntArray]:
    """Number of connected parts, and the part of each vertex, shape [v]."""
    count, label = connected_components(adjacency(triangles, vertex_count), directed=False)
    return int(count), label
