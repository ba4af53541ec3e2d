"""Where cloth would be if it were skin."""

import numpy as np

from garment_sim_ros.geometry.transforms import rotate
from garment_sim_ros.jit import kernel


@kernel()
def pose_frames(position, orientation, origin, collider, T):
    """Transforms from the frames of some colliders to local coordinates.

    Args:
        position: World positions of all colliders [m], shape [c, 3].
        orientation: Their unit quaternions, shape [c, 4].
        origin: World position of the local origin [m], shape [3].
        collider: The colliders wanted, shape [b].
        T: Output, shape [b, 3, 4].
    """
    for b in range(collider.size):
        c = collider[b]
        q = orientation[c]
        ex = rotate(q[0], q[1], q[2], q[3], 1.0, 0.0, 0.0)
        ey = rotate(q[0], q[1], q[2], q[3], 0.0, 1.0, 0.0)
        ez = rotate(q[0], q[1], q[2], q[3], 0.0, 0.0, 1.0)
        for i in range(3):
            T[b, i, 0] = ex[i]
            T[b, i, 1] = ey[i]
            T[b, i, 2] = ez[i]
            T[b, i, 3] = position[c, i] - origin[i]


@kernel(inner=True)
def blended(T, index, weighted):
    """A point or direction as its frames take it, blended linearly.

    Args:
        T: Transforms of frames, shape [b, 3, 4].
        index: Those that it follows, shape [k].
        weighted: Its coordinates in each times its weight, and that weight for a point, 0 for a
            direction, shape [k, 4].

    Returns:
        Three coordinates.
    """
    x = y = z = np.float32(0.0)
    for k in range(index.size):
        ax = weighted[k, 0]
        ay = weighted[k, 1]
        az = weighted[k, 2]
        w = weighted[k, 3]
        b = index[k]
        x += T[b, 0, 0] * ax + T[b, 0, 1] * ay + T[b, 0, 2] * az + T[b, 0, 3] * w
        y += T[b, 1, 0] * ax + T[b, 1, 1] * ay + T[b, 1, 2] * az + T[b, 1, 3] * w
        z += T[b, 2, 0] * ax + T[b, 2, 1] * ay + T[b, 2, 2] * az + T[b, 2, 3] * w
    return x, y, z
