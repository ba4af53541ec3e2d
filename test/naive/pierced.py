"""Pierced garments, counted with whole arrays: solve for the crossing of a line and a plane."""

import numpy as np
from scipy.spatial.transform import Rotation


def hits(start, end, corners):
    """Places along a segment, 0 to 1, where it runs through triangles [t, 3, 3]."""
    found = []
    for a, b, c in np.asarray(corners, np.float64):
        system = np.stack([b - a, c - a, start - end], axis=1)
        if abs(np.linalg.det(system)) < 1e-14:
            continue
        u, v, s = np.linalg.solve(system, start - a)
        if min(u, v) >= 0 and u + v <= 1 and 0 <= s <= 1:
            found.append(s)
    return sorted(found)


def run(start, end, points, position, orientation, count=20001):
    """From where to where a segment is in the convex hull of points, by samples; None without."""
    from scipy.spatial import ConvexHull

    planes = ConvexHull(points).equations
    s = np.linspace(0.0, 1.0, count)[:, None]
    x = Rotation.from_quat(orientation).inv().apply(start + s * (end - start) - position)
    inside = (x @ planes[:, :3].T + planes[:, 3] <= 0.0).all(axis=1)
    return (s[inside][0, 0], s[inside][-1, 0]) if inside.any() else None
