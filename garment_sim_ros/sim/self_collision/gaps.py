"""How near particles, edges and triangles of a mesh are to each other, and which cross."""

import numpy as np

from garment_sim_ros.geometry.mesh_distance import closest_on_triangle
from garment_sim_ros.jit import lean_kernel

_HALF = np.float32(0.5)
_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)


@lean_kernel(inner=True)
def edge_weights(x, a, b, c, d):
    """Where two edges are nearest to each other: weights of b on ab and of d on cd, squared gap.

    Ericson 2005, Real-Time Collision Detection, 5.1.9.
    """
    ex, ey, ez = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    fx, fy, fz = x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2]
    rx, ry, rz = x[a, 0] - x[c, 0], x[a, 1] - x[c, 1], x[a, 2] - x[c, 2]
    tiny = np.float32(1e-20)
    ee = ex * ex + ey * ey + ez * ez + tiny
    ff = fx * fx + fy * fy + fz * fz + tiny
    ef = ex * fx + ey * fy + ez * fz
    er = ex * rx + ey * ry + ez * rz
    fr = fx * rx + fy * ry + fz * rz
    area = ee * ff - ef * ef
    s = _HALF
    if area > np.float32(1e-6) * ee * ff:
        s = min(max((ef * fr - er * ff) / area, _ZERO), _ONE)
    t = (ef * s + fr) / ff
    if t < _ZERO:
        t = _ZERO
        s = min(max(-er / ee, _ZERO), _ONE)
    elif t > _ONE:
        t = _ONE
        s = min(max((ef - er) / ee, _ZERO), _ONE)
    dx = rx + s * ex - t * fx
    dy = ry + s * ey - t * fy
    dz = rz + s * ez - t * fz
    return s, t, dx * dx + dy * dy + dz * dz


@lean_kernel(inner=True)
def point_gap(x, p, i, j, k):
    """Squared distance of a particle to a triangle."""
    b, c, _ = closest_on_triangle(x[i], x[j], x[k], x[p, 0], x[p, 1], x[p, 2])
    b = np.float32(b)
    c = np.float32(c)
    a = _ONE - b - c
    dx = x[p, 0] - a * x[i, 0] - b * x[j, 0] - c * x[k, 0]
    dy = x[p, 1] - a * x[i, 1] - b * x[j, 1] - c * x[k, 1]
    dz = x[p, 2] - a * x[i, 2] - b * x[j, 2] - c * x[k, 2]
    return dx * dx + dy * dy + dz * dz


@lean_kernel(inner=True)
def height(x, normal, p, i, u):
    """Height of particle p over the plane of triangle u, whose first corner is i."""
    return (
        (x[p, 0] - x[i, 0]) * normal[u, 0]
        + (x[p, 1] - x[i, 1]) * normal[u, 1]
        + (x[p, 2] - x[i, 2]) * normal[u, 2]
    )


@lean_kernel(inner=True)
def crosses(x, a, b, i, j, k):
    """Whether the edge ab passes through a triangle."""
    ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
    fx, fy, fz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    ax, ay, az = x[a, 0] - x[i, 0], x[a, 1] - x[i, 1], x[a, 2] - x[i, 2]
    bx, by, bz = x[b, 0] - x[i, 0], x[b, 1] - x[i, 1], x[b, 2] - x[i, 2]
    ha = ax * nx + ay * ny + az * nz
    hb = bx * nx + by * ny + bz * nz
    if not ha * hb < _ZERO:
        return False
    s = ha / (ha - hb)
    px, py, pz = ax + s * (bx - ax), ay + s * (by - ay), az + s * (bz - az)
    # Weights times twice the triangle's area squared.
    u = nx * (py * fz - pz * fy) + ny * (pz * fx - px * fz) + nz * (px * fy - py * fx)
    w = nx * (ey * pz - ez * py) + ny * (ez * px - ex * pz) + nz * (ex * py - ey * px)
    return u >= _ZERO and w >= _ZERO and u + w <= nx * nx + ny * ny + nz * nz
