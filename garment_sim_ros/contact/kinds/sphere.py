"""Point against sphere."""

import numpy as np

from garment_sim_ros.jit import lean_kernel


@lean_kernel(inner=True)
def sphere_distance(qx, qy, qz, radius, reach):
    """Signed distance to a sphere, equations 5 and 6 of Sun et al. 2007.

    Args:
        qx: Point relative to the centre [m].
        qy: Likewise.
        qz: Likewise.
        radius: Radius [m].
        reach: Distances above this are not told apart [m].

    Returns:
        Distance [m], negative inside, infinite where above `reach`; and the unit outward direction
        in which it shrinks to 0.
    """
    squared = qx * qx + qy * qy + qz * qz
    farthest = radius + reach
    if squared > farthest * farthest:
        return np.float32(np.inf), qx, qy, qz
    length = np.sqrt(squared)
    if length < np.float32(1e-6) * radius:
        return -radius, np.float32(0.0), np.float32(0.0), np.float32(1.0)
    scale = np.float32(1.0) / length
    return length - radius, qx * scale, qy * scale, qz * scale
