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


def cosines(x, triangles):
    """Least cosine between a vertex's normal and those of its triangles, shape [v]."""
    normal = np.cross(
        x[triangles[:, 1]] - x[triangles[:, 0]], x[triangles[:, 2]] - x[triangles[:, 0]]
    )
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    found = np.ones(len(x))
    for v in range(len(x)):
        around = normal[(triangles == v).any(axis=1)]
        if len(around):
            middle = around.sum(axis=0)
            found[v] = (around @ middle).min() / np.linalg.norm(middle)
    return found


def round_creases(x, triangles, rest, held, bent, sharp):
    """Where vertices are seen, shape [v, 3]: those that turn more sharply than at rest move."""
    sides = [tuple(sorted((t[k], t[k - 2]))) for t in triangles.tolist() for k in range(3)]
    border = {side for side in sides if sides.count(side) == 1}
    at_border = {v for side in border for v in side}
    begin = np.minimum(bent, cosines(rest, triangles))
    weight = 0.5 * np.clip((begin - cosines(x, triangles)) / (bent - sharp), 0.0, 1.0)
    x = x.copy()
    for _ in range(3):
        before = x.copy()
        for v in set(range(len(x))) - set(held):
            those = border if v in at_border else set(sides)
            near = [a + b - v for a, b in those if v in (a, b)]
            if near:
                x[v] += weight[v] * (before[near].mean(axis=0) - before[v])
    return x


def off(place, triangles, way, rest, stretched):
    """What vertices are shown off their places [m], shape [v, 3].

    Twice the ends of edges that would be lengthened go only so far that these are not stretched,
    or not longer than they are.
    """
    way = way.copy()
    for _ in range(2):
        share = np.ones(len(place))
        for t in triangles.tolist():
            for a, b in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0])):
                edge, apart = place[b] - place[a], way[b] - way[a]
                now = np.linalg.norm(edge)
                most = max(now, stretched * np.linalg.norm(rest[b] - rest[a]))
                if np.linalg.norm(edge + apart) > most:
                    roots = np.roots([apart @ apart, 2.0 * edge @ apart, now**2 - most**2])
                    part = np.clip(roots.real.max(), 0.0, 1.0)
                    share[[a, b]] = np.minimum(share[[a, b]], part)
        way *= share[:, None]
    return way
