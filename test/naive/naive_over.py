"""Cloth over the shapes that it lies on, one vertex after the other in double precision."""

import numpy as np

from naive.naive import signed_distance


def way_out(shapes, touched, point, clear, deep):
    """How far a point goes to be clear of the shapes that are touched [m], shape [3]."""
    found = [signed_distance(shapes[k], point) for k in {k for k in touched if k >= 0}]
    least, out = min(found, key=lambda one: one[0])
    depth = max(0.0, min(clear - least, 2.0 * deep - (clear - least)))
    return depth * out


def touches(shape, depth):
    """Whether some corner touches a shape, and none is pressed between two."""
    return (shape >= 0).any() and np.isfinite(depth[shape >= 0]).all()


def lift_triangles(x, triangles, shape, normal, depth, shapes, clear, deep):
    """What each particle is lifted by [m], shape [n, 3]; `shape` and others are of free ones."""
    free = len(shape)
    lift = np.zeros_like(x)
    for corners in triangles:
        own = np.array([c for c in corners if c < free], int)
        if not len(own) or not touches(shape[own], depth[own]):
            continue
        middle = x[corners].mean(axis=0)
        heights = [normal[c] @ (middle - x[c]) for c in own if shape[c] >= 0]
        if max(heights) >= -clear:
            continue
        way = way_out(shapes, shape[own], middle, clear, deep)
        for c in own:
            if np.linalg.norm(way) > np.linalg.norm(lift[c]):
                lift[c] = way
    return lift


def lift_vertices(x, corner, shape, depth, shapes, clear, deep):
    """What each vertex is lifted by that lies between three particles [m], shape [v, 3]."""
    free = len(shape)
    lift = np.zeros_like(x)
    for v, corners in enumerate(corner):
        own = np.array([c for c in corners if c < free], int)
        if len(own) and touches(shape[own], depth[own]):
            lift[v] = way_out(shapes, shape[own], x[v], clear, deep)
    return lift
