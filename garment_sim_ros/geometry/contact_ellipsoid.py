"""Signed distance of a point to an ellipsoid, and the nearest point of its surface.

The nearest point to p has the coordinates ``r_i^2 p_i / (t + r_i^2)``, where t is the largest root
of ``sum (r_i p_i / (t + r_i^2))^2 = 1`` (Eberly, "Distance from a point to an ellipse, an
ellipsoid, or a hyperellipsoid"). The square root of the sum is nearly a hyperbola in t, so
Newton's method on its inverse (as in More & Sorensen 1983 for trust regions) needs few steps, all
from one side.
"""

import numpy as np

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.jit import kernel

_STEPS = 12
_NUDGE = 1e-4
"""Points closer to a plane of symmetry than this share of the radius are taken to be off it."""


def ellipsoid_size(radii: object) -> tuple[float, float, float, float]:
    """Size numbers of an ellipsoid: the radii along x, y and z [m], and zero.

    Raises:
        GeometryError: Not three positive finite numbers.
    """
    array = np.asarray(radii, dtype=np.float64)
    if array.shape != (3,) or not (np.isfinite(array).all() and (array > 0.0).all()):
        raise GeometryError("radii must be three positive numbers")
    return float(array[0]), float(array[1]), float(array[2]), 0.0


def ellipsoid_bound(radii: tuple[float, ...]) -> tuple[float, ...]:
    """A capsule that holds an ellipsoid, in its frame: start, end and radius [m]."""
    axis = int(np.argmax(radii[:3]))
    longest = radii[axis]
    radius = max(r for i, r in enumerate(radii[:3]) if i != axis)
    end = np.zeros(3)
    end[axis] = longest - radius
    return (*(-end).tolist(), *end.tolist(), radius)


@kernel(forceinline=True)
def nearest_on_ellipsoid(px, py, pz, rx, ry, rz):
    """The point of the surface nearest to p, in the ellipsoid's frame.

    Returns:
        The point, and the unit normal there.
    """
    ax = max(abs(px), rx * _NUDGE)
    ay = max(abs(py), ry * _NUDGE)
    az = max(abs(pz), rz * _NUDGE)
    x2 = rx * rx
    y2 = ry * ry
    z2 = rz * rz
    ux = rx * ax
    uy = ry * ay
    uz = rz * az
    # The root is not below any value at which one term alone is 1. The guess is the distance to
    # first order, good near the surface; from above the root, the first step passes it.
    lowest = max(ux - x2, uy - y2, uz - z2)
    ex = ax / x2
    ey = ay / y2
    ez = az / z2
    total = ax * ex + ay * ey + az * ez
    t = max(lowest, (total - np.sqrt(total)) / (ex * ex + ey * ey + ez * ez))
    for _ in range(_STEPS):
        dx = t + x2
        dy = t + y2
        dz = t + z2
        ex = ux / dx
        ey = uy / dy
        ez = uz / dz
        ex *= ex
        ey *= ey
        ez *= ez
        total = ex + ey + ez
        length = np.sqrt(total)
        step = (length - 1.0) * total / (ex / dx + ey / dy + ez / dz)
        t = max(lowest, t + step)
        if abs(length - 1.0) < 3e-4:  # squared by the step just made
            break
    gx = ax / (t + x2)
    gy = ay / (t + y2)
    gz = az / (t + z2)
    # Radially onto the surface, for what the last step has left.
    k = 1.0 / np.sqrt(gx * gx * x2 + gy * gy * y2 + gz * gz * z2)
    gx = gx * k if px >= 0.0 else -gx * k
    gy = gy * k if py >= 0.0 else -gy * k
    gz = gz * k if pz >= 0.0 else -gz * k
    n = 1.0 / np.sqrt(gx * gx + gy * gy + gz * gz)
    return gx * x2, gy * y2, gz * z2, gx * n, gy * n, gz * n


@kernel()
def ellipsoid_distance(qx, qy, qz, R, rx, ry, rz, reach):
    """Signed distance to an ellipsoid, infinite above `reach`, and the unit direction out of it.

    Args:
        qx: Point relative to the centre [m].
        qy: See `qx`.
        qz: See `qx`.
        R: Rotation of the ellipsoid's frame, shape [3, 3].
        rx: Radius along the frame's x [m].
        ry: Along its y.
        rz: Along its z.
        reach: Distances above this need not be known [m].
    """
    px = R[0, 0] * qx + R[1, 0] * qy + R[2, 0] * qz
    py = R[0, 1] * qx + R[1, 1] * qy + R[2, 1] * qz
    pz = R[0, 2] * qx + R[1, 2] * qy + R[2, 2] * qz
    zeta = (px / rx) ** 2 + (py / ry) ** 2 + (pz / rz) ** 2
    away = reach / min(rx, ry, rz) + np.float32(1.0)
    if away > np.float32(0.0) and zeta > away * away:
        return np.float32(np.inf), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    sx, sy, sz, nx, ny, nz = nearest_on_ellipsoid(px, py, pz, rx, ry, rz)
    distance = (px - sx) * nx + (py - sy) * ny + (pz - sz) * nz
    return (
        np.float32(distance),
        np.float32(R[0, 0] * nx + R[0, 1] * ny + R[0, 2] * nz),
        np.float32(R[1, 0] * nx + R[1, 1] * ny + R[1, 2] * nz),
        np.float32(R[2, 0] * nx + R[2, 1] * ny + R[2, 2] * nz),
    )
