"""All vertices over those that are simulated, one by one, in double precision."""

import numpy as np


def unit(vector):
    """The same direction, 1 long."""
    return vector / np.linalg.norm(vector)


def normals(x, triangles):
    """Unit normals of vertices [v, 3], each the sum over its triangles by their area."""
    total = np.zeros_like(x)
    for a, b, c in triangles:
        for v in (a, b, c):
            total[v] += np.cross(x[b] - x[a], x[c] - x[a])
    return np.array([unit(n) for n in total])


def places(x, normal, corner, share, off):
    """Vertices beside triangles of x, off along the first edge, across it, along the normal."""
    found = []
    for abc, weights, (along, across, up) in zip(corner, share, off, strict=True):
        n = unit(sum(w * normal[v] for v, w in zip(abc, weights, strict=True)))
        first = x[abc[1]] - x[abc[0]]
        t = unit(first - (first @ n) * n)
        place = sum(w * x[v] for v, w in zip(abc, weights, strict=True))
        found.append(place + along * t + across * np.cross(n, t) + up * n)
    return np.array(found)
