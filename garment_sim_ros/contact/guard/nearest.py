"""Segments and triangles: where they are nearest, and how far one has to go to leave the other."""

import numpy as np

from garment_sim_ros.geometry.vectors import cross, dot, less
from garment_sim_ros.jit import lean_kernel

_PARALLEL = 1e-12


@lean_kernel(inner=True)
def along_segment(p, d, m):
    """Nearest place to the point m on p + s d, s from 0 to 1, and the squared distance."""
    w = less(m, p)
    s = min(max(dot(w, d) / max(dot(d, d), 1e-20), 0.0), 1.0)
    x = (w[0] - s * d[0], w[1] - s * d[1], w[2] - s * d[2])
    return s, dot(x, x)


@lean_kernel(inner=True)
def between_segments(p, d, q, e):
    """Nearest places of the segments p + s d and q + t e, s and t from 0 to 1."""
    r = less(p, q)
    a, b, c, f, g = dot(d, d), dot(d, e), dot(e, e), dot(d, r), dot(e, r)
    det = a * c - b * b
    s = 0.0
    if det > _PARALLEL * a * c:
        s = min(max((b * g - c * f) / det, 0.0), 1.0)
    t = (b * s + g) / max(c, 1e-20)
    if t < 0.0:
        t = 0.0
        s = min(max(-f / max(a, 1e-20), 0.0), 1.0)
    elif t > 1.0:
        t = 1.0
        s = min(max((b - f) / max(a, 1e-20), 0.0), 1.0)
    return s, t


@lean_kernel(inner=True)
def foot(a, u, v, m):
    """Weights of the corners a + u and a + v at the foot of the point m; whether it is inside."""
    w = less(m, a)
    uu, uv, vv, wu, wv = dot(u, u), dot(u, v), dot(v, v), dot(w, u), dot(w, v)
    det = uu * vv - uv * uv
    if not det > 1e-20:
        return 0.0, 0.0, False
    g = (vv * wu - uv * wv) / det
    h = (uu * wv - uv * wu) / det
    return g, h, g >= 0.0 and h >= 0.0 and g + h <= 1.0


@lean_kernel(forceinline=True)
def nearest(p, d, a, u, v):
    """The nearest places of the segment p + s d and the triangle a, a + u, a + v.

    Returns:
        s from 0 to 1, weights of the second and third corner, squared distance; 0 where the
        segment runs through the triangle.
    """
    best, at, g, h = np.inf, 0.0, 0.0, 0.0
    for edge in range(3):
        if edge == 0:
            o, e = a, u
        elif edge == 1:
            o, e = a, v
        else:
            o, e = (a[0] + u[0], a[1] + u[1], a[2] + u[2]), less(v, u)
        s, t = between_segments(p, d, o, e)
        x = (
            p[0] + s * d[0] - o[0] - t * e[0],
            p[1] + s * d[1] - o[1] - t * e[1],
            p[2] + s * d[2] - o[2] - t * e[2],
        )
        square = dot(x, x)
        if square < best:
            best, at = square, s
            g = t if edge == 0 else (0.0 if edge == 1 else 1.0 - t)
            h = 0.0 if edge == 0 else t
    n = cross(u, v)
    size = dot(n, n)
    if size > 1e-24:
        from_p = dot(less(p, a), n)
        from_q = from_p + dot(d, n)
        if from_p * from_q < 0.0:
            s = from_p / (from_p - from_q)
            g2, h2, inside = foot(a, u, v, (p[0] + s * d[0], p[1] + s * d[1], p[2] + s * d[2]))
            if inside:
                return s, g2, h2, 0.0
        for end in range(2):
            height = from_p if end == 0 else from_q
            square = height * height / size
            if square < best:
                m = p if end == 0 else (p[0] + d[0], p[1] + d[1], p[2] + d[2])
                g2, h2, inside = foot(a, u, v, m)
                if inside:
                    best, at, g, h = square, float(end), g2, h2
    return at, g, h, best


@lean_kernel(forceinline=True)
def way_out(p, d, a, u, v, m):
    """How far a triangle has to go along m until the segment p + s d is clear of it.

    The ways for which the two meet are those for which the origin is inside of a prism: the
    triangle less the segment. Its five faces are cut one after the other.

    Args:
        p: One end of the segment.
        d: From there to the other end.
        a: A corner of the triangle.
        u: From there to the second.
        v: From there to the third.
        m: Unit direction.

    Returns:
        The way, negative where the triangle is clear already, and never in the way along m.
    """
    first, last = -np.inf, np.inf
    n = cross(u, v)
    flat = dot(n, d)
    base = dot(n, less(p, a))
    # Between the two end faces: n (p + s d - a) - way (n m) = 0 for an s from 0 to 1.
    low, high = min(base, base + flat), max(base, base + flat)
    rate = dot(n, m)
    if abs(rate) > 1e-12:
        one, two = low / rate, high / rate
        first, last = max(first, min(one, two)), min(last, max(one, two))
    elif low > 0.0 or high < 0.0:
        return -1.0
    # Across each edge, along the segment: the side of the third corner is inside.
    for edge in range(3):
        if edge == 0:
            o, e, inner = a, u, v
        elif edge == 1:
            o, e, inner = a, v, u
        else:
            o = (a[0] + u[0], a[1] + u[1], a[2] + u[2])
            e = less(v, u)
            inner = (-u[0], -u[1], -u[2])
        k = cross(e, d)
        sign = 1.0 if dot(k, inner) > 0.0 else -1.0
        here = sign * dot(k, less(p, o))
        rate = sign * dot(k, m)
        # Inside while here - way rate >= 0.
        if abs(rate) > 1e-14:
            if rate > 0.0:
                last = min(last, here / rate)
            else:
                first = max(first, here / rate)
        elif here < 0.0:
            return -1.0
    if first > last or last == np.inf:
        return -1.0
    return last
