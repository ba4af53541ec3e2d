"""Areas and normals of the triangles of a mesh."""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray


def area_vectors(x: FloatArray, triangles: IntArray) -> FloatArray:
    """Outward normals as long as twice the area of each triangle.

    Args:
        x: Positions [m], shape [v, 3].
        triangles: Vertex indices, counter-clockwise seen from outside, shape [t, 3].

    Returns:
        Vectors [m^2], shape [t, 3].
    """
    a, b, c = (x[triangles[:, k]] for k in range(3))
    vectors: FloatArray = np.cross(b - a, c - a)
    return vectors


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """Vectors [n, 3] made 1 long; those without a length stay as they are."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: FloatArray = vectors / np.maximum(length, 1e-300)
    return unit


def triangle_areas(x: FloatArray, triangles: IntArray) -> FloatArray:
    """Area of each triangle [m^2], shape [t]; arguments as of `area_vectors`."""
    areas: FloatArray = 0.5 * np.linalg.norm(area_vectors(x, triangles), axis=1)
    return areas


def vertex_areas(x: FloatArray, triangles: IntArray) -> FloatArray:
    """A third of the area of the triangles at each vertex [m^2], shape [v]."""
    third = np.repeat(triangle_areas(x, triangles) / 3.0, 3)
    return np.bincount(triangles.ravel(), third, minlength=len(x)).astype(np.float64)


def barycentric(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Barycentric coordinates of points [n, 3] on triangles [n, 3, 3], clipped and normalised."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    squared = np.maximum(np.einsum("ni,ni->n", normal, normal), 1e-300)
    parts = [
        np.einsum("ni,ni->n", np.cross(q - p, points - p), normal) / squared
        for p, q in ((b, c), (c, a), (a, b))
    ]
    share = np.clip(np.stack(parts, axis=1), 0.0, 1.0)
    total = share.sum(axis=1, keepdims=True)
    return np.where(total > 0.0, share / np.where(total > 0.0, total, 1.0), 1.0 / 3.0)
