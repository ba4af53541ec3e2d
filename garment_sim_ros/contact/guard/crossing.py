"""Whether a core and a triangle met on their ways from one search for contacts to the next."""

import numpy as np

from garment_sim_ros.contact.guard.near import core, corner
from garment_sim_ros.contact.guard.nearest import nearest
from garment_sim_ros.geometry.vectors import dot, less
from garment_sim_ros.jit import lean_kernel

_TOUCHING = 1e-6
"""What is nearer meets [m]."""
_NEARLY = 2e-4
"""What is nearer on its way will meet [m]."""
_ADVANCES = 32

APART, CROSSED, FOUND_IN = 0, 1, 2
"""They did not meet; they did; they did before they set out."""


@lean_kernel(inner=True)
def direction(p, d, a, u, v):
    """The unit direction from the segment p + s d to the triangle a, a + u, a + v.

    Returns:
        The direction, weights of the second and third corner where they are nearest, and the
        distance; 0 for all but the weights where the segment runs through the triangle.
    """
    s, g, h, square = nearest(p, d, a, u, v)
    distance = np.sqrt(square)
    if not distance > _TOUCHING:
        return (0.0, 0.0, 0.0), g, h, 0.0
    r = 1.0 / distance
    m = (
        r * (a[0] + g * u[0] + h * v[0] - p[0] - s * d[0]),
        r * (a[1] + g * u[1] + h * v[1] - p[1] - s * d[1]),
        r * (a[2] + g * u[2] + h * v[2] - p[2] - s * d[2]),
    )
    return m, g, h, distance


@lean_kernel(inner=True)
def _between(a, b, s):
    return a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])


@lean_kernel(inner=True)
def _relative(a, b, mean):
    """How far something moves from a to b, apart from what all move."""
    way = less(less(b, a), mean)
    return np.sqrt(dot(way, way))


@lean_kernel(forceinline=True)
def crossing(guard, x_before, x, c, t):
    """Whether triangle t and core c met, both on straight ways.

    They are moved on by as long as they cannot meet (conservative advancement, Mirtich 1996).

    Args:
        guard: `Guard`.
        x_before: Positions at the last search [m], shape [n, 3].
        x: Positions now [m], shape [n, 3].
        c: A core.
        t: A triangle.

    Returns:
        The direction from core to triangle just before they met, else now; and `APART`, `CROSSED`
        or `FOUND_IN`.
    """
    i, j, k = guard.triangles[t, 0], guard.triangles[t, 1], guard.triangles[t, 2]
    p0, d0 = core(guard.posed[0], c)
    p1, d1 = core(guard.posed[1], c)
    q0 = (p0[0] + d0[0], p0[1] + d0[1], p0[2] + d0[2])
    q1 = (p1[0] + d1[0], p1[1] + d1[1], p1[2] + d1[2])
    a0, b0, c0 = corner(x_before, i), corner(x_before, j), corner(x_before, k)
    a1, b1, c1 = corner(x, i), corner(x, j), corner(x, k)
    mean = _between(less(p1, p0), less(q1, q0), 0.5)
    way = _relative(p0, p1, mean) + max(
        _relative(a0, a1, mean), max(_relative(b0, b1, mean), _relative(c0, c1, mean))
    )
    time = 0.0
    last = (0.0, 0.0, 0.0)
    for n in range(_ADVANCES):
        p = _between(p0, p1, time)
        d = less(_between(q0, q1, time), p)
        a = _between(a0, a1, time)
        u = less(_between(b0, b1, time), a)
        v = less(_between(c0, c1, time), a)
        m, _, _, distance = direction(p, d, a, u, v)
        if distance == 0.0:
            return last, FOUND_IN if n == 0 else CROSSED
        last = m
        if n > 0 and distance < _NEARLY:
            return last, CROSSED
        time += max(distance, _NEARLY) / max(way, 1e-9)
        if time >= 1.0:
            break
    return last, APART
