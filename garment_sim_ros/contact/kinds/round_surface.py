"""Triangle meshes of round shapes: the convex hull of points on them."""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.kinds.kind import Surface


def directions(count: int) -> FloatArray:
    """Unit vectors spread evenly (Fibonacci lattice), shape [n, 3]."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * i
    r = np.sqrt(1.0 - z * z)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


def convex_surface(points: FloatArray) -> Surface:
    """The convex hull of points [n, 3] with outward triangles."""
    # Here: it takes a tenth of a program's start, and few draw round shapes.
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    triangles = hull.simplices
    a, b, c = (points[triangles[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    used, index = np.unique(triangles, return_inverse=True)
    return Surface(points[used], index.reshape(-1, 3).astype(np.int32))
