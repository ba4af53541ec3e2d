"""Point against tapered capsule: the convex hull of two spheres."""

import numpy as np

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.jit import lean_kernel


def capsule_size(radius0: float, radius1: float, length: float) -> tuple[float, ...]:
    """Packed form of a capsule that runs from z = 0 to z = `length` [m].

    Returns:
        Radius at z = 0, its decrease per length, the length, and by how much the nearest sphere's
        centre lies lower than the point, per distance from the axis.

    Raises:
        GeometryError: A negative or non-finite number.
    """
    values = np.array([radius0, radius1, length], dtype=np.float64)
    if not np.isfinite(values).all() or (values < 0.0).any():
        raise GeometryError(
            f"capsule radii and length must be finite and not negative; found {values.tolist()}"
        )
    if length == 0.0:
        return max(radius0, radius1), 0.0, 0.0, 0.0
    taper = (radius0 - radius1) / length
    # One sphere inside the other: a slope so steep that the larger one is always nearest.
    lean = taper / np.sqrt(1.0 - taper**2) if abs(taper) < 1.0 else np.copysign(1e6, taper)
    return radius0, taper, length, float(lean)


@lean_kernel(inner=True)
def capsule_distance(qx, qy, qz, ax, ay, az, radius0, taper, length, lean, reach):
    """Signed distance to a tapered capsule, exact within `reach`.

    The nearest point belongs to the sphere about ``t`` on the axis, where the cone's normal
    through the point meets it, clamped to the ends.

    Args:
        qx: Point relative to the centre of the end at z = 0 [m].
        qy: Likewise.
        qz: Likewise.
        ax: Unit axis, from that end to the other.
        ay: Likewise.
        az: Likewise.
        radius0: From `capsule_size`, as the next three.
        taper: Decrease of the radius per length.
        length: Length of the axis [m].
        lean: See `capsule_size`.
        reach: Distances above this are not told apart [m].

    Returns:
        Distance [m], negative inside, infinite where above `reach`; and the unit outward direction
        in which it shrinks to 0.
    """
    zero = np.float32(0.0)
    along = qx * ax + qy * ay + qz * az
    squared = qx * qx + qy * qy + qz * qz
    across = max(squared - along * along, zero)
    beyond = along - min(max(along, zero), length)
    farthest = max(radius0, radius0 - taper * length) + reach
    if across + beyond * beyond > farthest * farthest:
        return np.float32(np.inf), ax, ay, az
    t = min(max(along - lean * np.sqrt(across), zero), length)
    radius = radius0 - taper * t
    cx = qx - t * ax
    cy = qy - t * ay
    cz = qz - t * az
    apart = np.sqrt(cx * cx + cy * cy + cz * cz)
    if apart < np.float32(1e-6) * radius:
        # On the axis every direction across it is as good: the one nearest to z, or x.
        if abs(az) < np.float32(0.9):
            scale = np.float32(1.0) / np.sqrt(np.float32(1.0) - az * az)
            return -radius, -az * ax * scale, -az * ay * scale, (np.float32(1.0) - az * az) * scale
        scale = np.float32(1.0) / np.sqrt(np.float32(1.0) - ax * ax)
        return -radius, (np.float32(1.0) - ax * ax) * scale, -ax * ay * scale, -ax * az * scale
    scale = np.float32(1.0) / apart
    return apart - radius, cx * scale, cy * scale, cz * scale
