"""The way out of a union of ellipsoids."""

import numpy as np

from garment_sim_ros.contact.kinds.ellipsoid import nearest_on_ellipsoid
from garment_sim_ros.contact.papers.earliest.poses import (
    ON_SURFACE,
    from_ball,
    inside_any,
    to_ball,
    turn_back,
)
from garment_sim_ros.jit import kernel

_PROJECTIONS = 12
_MARCHING = 60
_BEYOND = 1e-7
"""How far beyond a surface points are put [m]: less than single precision tells."""


@kernel(inner=True)
def _way_out(table, k, px, py, pz):
    """Nearest point of the surface of ellipsoid k, its normal, and how far that is."""
    rx, ry, rz = table[k, 12], table[k, 13], table[k, 14]
    qx, qy, qz = to_ball(table, k, px, py, pz)
    sx, sy, sz, nx, ny, nz = nearest_on_ellipsoid(qx * rx, qy * ry, qz * rz, rx, ry, rz)
    wx, wy, wz = from_ball(table, k, sx / rx, sy / ry, sz / rz)
    mx, my, mz = turn_back(table, k, nx * rx, ny * ry, nz * rz)
    way = np.sqrt((wx - px) ** 2 + (wy - py) ** 2 + (wz - pz) ** 2)
    return wx, wy, wz, mx, my, mz, way


@kernel(inner=True)
def comes_first(a0, a1, a2, a3, b0, b1, b2, b3):
    """Whether the first four numbers come before the other four, compared in order."""
    if a0 != b0:
        return a0 < b0
    if a1 != b1:
        return a1 < b1
    if a2 != b2:
        return a2 < b2
    return a3 < b3


@kernel(inner=True)
def _deepest(table, candidates, count, px, py, pz):
    """Way out of that of the first `count` candidates which holds a point deepest.

    Returns:
        Nearest point of its surface, normal, how far that is, and its index; -1 if none does.
    """
    deepest = -1.0
    wx = wy = wz = nx = ny = nz = 0.0
    last = -1
    for c in range(count):
        k = candidates[c]
        qx, qy, qz = to_ball(table, k, px, py, pz)
        if qx * qx + qy * qy + qz * qz >= 1.0 - ON_SURFACE:
            continue
        ax, ay, az, mx, my, mz, way = _way_out(table, k, px, py, pz)
        if last < 0 or comes_first(-way, ax, ay, az, -deepest, wx, wy, wz):
            deepest, wx, wy, wz = way, ax, ay, az
            nx, ny, nz = mx, my, mz
            last = k
    return wx, wy, wz, nx, ny, nz, deepest, last


@kernel(inner=True)
def _free_way(table, candidates, count, px, py, pz):
    """The shortest way to the surface of a candidate that does not end in another.

    Returns:
        The point, and the ellipsoid that it left; -1 if there is no such way.
    """
    best = np.inf
    bx = by = bz = 0.0
    chosen = -1
    for c in range(count):
        k = candidates[c]
        qx, qy, qz = to_ball(table, k, px, py, pz)
        if qx * qx + qy * qy + qz * qz >= 1.0 - ON_SURFACE:
            continue
        wx, wy, wz, _, _, _, way = _way_out(table, k, px, py, pz)
        if not comes_first(way, wx, wy, wz, best, bx, by, bz):
            continue
        if not inside_any(table, candidates, count, wx, wy, wz, k):
            best, bx, by, bz = way, wx, wy, wz
            chosen = k
    return bx, by, bz, chosen


@kernel(inner=True)
def leave(table, candidates, count, px, py, pz):
    """Moves a point out of the union of the first `count` candidates.

    By the shortest way to the surface of one of them that does not end in another. Where every
    such way does: to the surface of the deepest one and along it to the crease with the one met
    there, again and again, and at last on in the mean direction of those ways.

    Returns:
        The point, and the last ellipsoid that it left, -1 if it was in none.
    """
    left = -1
    sx = sy = sz = 0.0
    for attempt in range(_PROJECTIONS + _MARCHING):
        if attempt < _PROJECTIONS:
            wx, wy, wz, chosen = _free_way(table, candidates, count, px, py, pz)
            if chosen >= 0:
                return wx, wy, wz, chosen
        wx, wy, wz, nx, ny, nz, deep, last = _deepest(table, candidates, count, px, py, pz)
        if last < 0:
            return px, py, pz, left
        left = last
        sx += nx
        sy += ny
        sz += nz
        if attempt < _PROJECTIONS:
            px, py, pz = wx, wy, wz
            wx, wy, wz, mx, my, mz, deep, other = _deepest(table, candidates, count, px, py, pz)
            # The other's normal, less its part along the first's: the way along the surface.
            along = mx * nx + my * ny + mz * nz
            mx, my, mz = mx - along * nx, my - along * ny, mz - along * nz
            squared = mx * mx + my * my + mz * mz
            if other >= 0 and squared > 0.01:
                step = (deep + _BEYOND) / squared
                px, py, pz = px + step * mx, py + step * my, pz + step * mz
            continue
        length = np.sqrt(sx * sx + sy * sy + sz * sz)
        if length < 1e-6:
            sx, sy, sz, length = nx, ny, nz, 1.0
        along = max((sx * nx + sy * ny + sz * nz) / length, 0.1)
        step = (deep + _BEYOND) / along / length
        px += step * sx
        py += step * sy
        pz += step * sz
    return px, py, pz, left
