"""Welding: vertices that a file has split at texture or normal seams become one again."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError

_MAX_NEIGHBOURS = 64
"""Largest mean number of vertices at one place; more would take memory without bound."""


def weld(
    vertices: FloatArray,
    triangles: IntArray,
    W: sp.csr_matrix,
    *,
    tolerance: float = 1e-6,
    weight_tolerance: float = 2e-3,
) -> tuple[FloatArray, IntArray, sp.csr_matrix]:
    """Merge vertices at one place with one set of weights; drop what no triangle uses.

    Vertices at one place that move differently (an eye against its socket) stay apart.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        W: Skin weights, shape [v, n].
        tolerance: Largest distance merged, as a share of the mesh's size.
        weight_tolerance: Largest difference of any one weight merged.

    Returns:
        Vertices, triangles (degenerate ones dropped) and weights of the welded mesh, in order of
        first use in the file.

    Raises:
        GeometryError: Most vertices are at a few places.
    """
    size = float(np.ptp(vertices, axis=0).max(initial=0.0))
    tree = cKDTree(vertices)
    if tree.count_neighbors(tree, tolerance * size) > _MAX_NEIGHBOURS * len(vertices):
        raise GeometryError("too many vertices of the mesh are at the same places")
    pairs = tree.query_pairs(tolerance * size, output_type="ndarray").reshape(-1, 2)
    difference = abs(W[pairs[:, 0]] - W[pairs[:, 1]])
    same = difference.max(axis=1).toarray().ravel() <= weight_tolerance
    a, b = pairs[same].T
    v = len(vertices)
    links = sp.coo_matrix((np.ones(len(a)), (a, b)), shape=(v, v))
    _, label = connected_components(links, directed=False)
    _, first = np.unique(label, return_index=True)
    representative = first[label]

    triangles = representative[triangles]
    i, j, k = triangles.T
    triangles = triangles[(i != j) & (j != k) & (k != i)]
    kept, compact = np.unique(triangles, return_inverse=True)
    return (
        np.ascontiguousarray(vertices[kept]),
        compact.reshape(-1, 3).astype(np.int32),
        sp.csr_matrix(W[kept]),
    )
