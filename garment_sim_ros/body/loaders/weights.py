"""Skin weights from files: sparse, checked, normalised, padded to rows."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError

MAX_INFLUENCES = 64
"""Most joints that one vertex may follow: rows of all vertices are as long as the longest."""

SUM_TOLERANCE = 0.01
"""Weights whose sum differs from 1 by more are mentioned to the user; all are normalised."""


def weight_matrix(
    vertex: NDArray[np.integer],
    joint: NDArray[np.integer],
    weight: FloatArray,
    shape: tuple[int, int],
) -> sp.csr_matrix:
    """Sparse weights from (vertex, joint, weight) triples; repeated pairs are added.

    Args:
        vertex: Vertex of each triple, shape [m].
        joint: Joint of each triple, shape [m].
        weight: Weight of each triple, shape [m].
        shape: Numbers of vertices and joints.

    Raises:
        GeometryError: A weight is negative or not finite, or an index is out of range.
    """
    weight = np.asarray(weight, dtype=np.float64)
    if not np.isfinite(weight).all() or (weight < 0.0).any():
        raise GeometryError("skin weights must be finite and not negative")
    used = weight > 0.0
    vertex, joint, weight = vertex[used], joint[used], weight[used]
    for label, index, count in (("vertex", vertex, shape[0]), ("joint", joint, shape[1])):
        if index.size and (index.min() < 0 or index.max() >= count):
            raise GeometryError(
                f"skin weights name {label} {index.max()}; allowed: 0 to {count - 1}"
            )
    return sp.csr_matrix((weight, (vertex, joint)), shape=shape)


def normalised(W: sp.csr_matrix, vertices: FloatArray) -> tuple[sp.csr_matrix, tuple[str, ...]]:
    """Weights whose rows sum to 1; a vertex without any takes those of the nearest one with.

    Args:
        W: Weights, shape [v, n].
        vertices: Positions of the vertices, shape [v, 3].

    Returns:
        The normalised weights and one note per repair.

    Raises:
        GeometryError: No vertex has a weight.
    """
    notes = []
    W = sp.csr_matrix(W)
    sums = np.asarray(W.sum(axis=1)).ravel()
    bare = np.flatnonzero(sums <= 0.0)
    if len(bare) == len(sums):
        raise GeometryError("no vertex has a skin weight")
    if len(bare):
        bound = np.flatnonzero(sums > 0.0)
        source = np.arange(len(sums))
        source[bare] = bound[cKDTree(vertices[bound]).query(vertices[bare])[1]]
        W, sums = W[source], sums[source]
        notes.append(f"{len(bare)} vertices without weights took those of their nearest vertex")
    odd = np.abs(sums - 1.0) > SUM_TOLERANCE
    if odd.any():
        notes.append(
            f"skin weights of {odd.sum()} vertices summed to {sums.min():.3f}..{sums.max():.3f};"
            " normalised"
        )
    return sp.csr_matrix(sp.diags(1.0 / sums) @ W), tuple(notes)


def influences(W: sp.csr_matrix) -> tuple[IntArray, FloatArray]:
    """Rows of (joint, weight), largest weight first, padded with joint 0 and weight 0.

    Args:
        W: Normalised weights, shape [v, n].

    Returns:
        Joints and weights, both of shape [v, k], k the largest number of influences.

    Raises:
        GeometryError: A vertex follows too many joints.
    """
    W = sp.csr_matrix(W)
    counts = np.diff(W.indptr)
    if counts.max(initial=0) > MAX_INFLUENCES:
        raise GeometryError(
            f"a vertex has weights of {counts.max()} joints; allowed: up to {MAX_INFLUENCES}"
        )
    row = np.repeat(np.arange(W.shape[0]), counts)
    order = np.lexsort((W.indices, -W.data, row))
    column = np.arange(W.nnz) - np.repeat(W.indptr[:-1], counts)
    bone = np.zeros((W.shape[0], counts.max(initial=1)), dtype=np.int32)
    weight = np.zeros(bone.shape)
    bone[row, column] = W.indices[order]
    weight[row, column] = W.data[order]
    return bone, weight / weight.sum(axis=1, keepdims=True)
