"""Three successive rotations about axes at right angles, as quaternions and back.

The decomposition is the closed form for Tait-Bryan angles, written for any order and sign of the
axes: with A = [a b c], the matrix A^T R A is a rotation about x, y, z by the same angles, negated
where (a, b, c) is left-handed.
"""

import numpy as np

from garment_sim_ros.geometry.transforms import quaternion_multiply
from garment_sim_ros.jit import kernel

_TWO_PI = 2.0 * np.pi


@kernel(inner=True)
def quaternion_from_euler(axes, first, middle, last):
    """Quaternion of R(axes[0], first) R(axes[1], middle) R(axes[2], last).

    Args:
        axes: Unit axes, shape [3, 3], one per row.
        first: Angle about the first axis [rad].
        middle: Angle about the second.
        last: Angle about the third.
    """
    s0, s1, s2 = np.sin(0.5 * first), np.sin(0.5 * middle), np.sin(0.5 * last)
    c0, c1, c2 = np.cos(0.5 * first), np.cos(0.5 * middle), np.cos(0.5 * last)
    a, b, c = axes[0], axes[1], axes[2]
    x, y, z, w = quaternion_multiply(
        s0 * a[0], s0 * a[1], s0 * a[2], c0, s1 * b[0], s1 * b[1], s1 * b[2], c1
    )
    return quaternion_multiply(x, y, z, w, s2 * c[0], s2 * c[1], s2 * c[2], c2)


@kernel()
def quaternions_from_euler(axes, angles):
    """Quaternions of angles about three axes.

    Args:
        axes: Unit axes, shape [3, 3], one per row.
        angles: Angles [rad], shape [f, 3].

    Returns:
        Unit quaternions (x, y, z, w), shape [f, 4].
    """
    rotations = np.empty((angles.shape[0], 4))
    for k in range(angles.shape[0]):
        x, y, z, w = quaternion_from_euler(axes, angles[k, 0], angles[k, 1], angles[k, 2])
        rotations[k, 0], rotations[k, 1], rotations[k, 2], rotations[k, 3] = x, y, z, w
    return rotations


@kernel(inner=True)
def _near(angle, target):
    """The angle plus the multiple of a full turn that comes nearest to `target`."""
    return angle + _TWO_PI * np.round((target - angle) / _TWO_PI)


@kernel(forceinline=True)
def euler_near(rotation, axes, near, out):
    """Angles of a rotation on the branch nearest to given ones.

    Args:
        rotation: Unit quaternion (x, y, z, w), shape [4].
        axes: Unit axes at right angles to each other, shape [3, 3], one per row.
        near: Angles to stay close to [rad], shape [3].
        out: Angles [rad], shape [3].
    """
    x, y, z, w = rotation[0], rotation[1], rotation[2], rotation[3]
    # Columns of R A, then M = A^T R A.
    m = np.empty((3, 3))
    for k in range(3):
        vx = axes[k, 0]
        vy = axes[k, 1]
        vz = axes[k, 2]
        tx = 2.0 * (y * vz - z * vy)
        ty = 2.0 * (z * vx - x * vz)
        tz = 2.0 * (x * vy - y * vx)
        rx = vx + w * tx + y * tz - z * ty
        ry = vy + w * ty + z * tx - x * tz
        rz = vz + w * tz + x * ty - y * tx
        for i in range(3):
            m[i, k] = axes[i, 0] * rx + axes[i, 1] * ry + axes[i, 2] * rz
    handed = (
        axes[0, 0] * (axes[1, 1] * axes[2, 2] - axes[1, 2] * axes[2, 1])
        - axes[0, 1] * (axes[1, 0] * axes[2, 2] - axes[1, 2] * axes[2, 0])
        + axes[0, 2] * (axes[1, 0] * axes[2, 1] - axes[1, 1] * axes[2, 0])
    )
    sign = 1.0 if handed > 0.0 else -1.0
    cosine = np.hypot(m[0, 0], m[0, 1])
    middle = sign * np.arctan2(m[0, 2], cosine)
    if cosine < 1e-7:
        # Gimbal lock: only the sum or difference of the outer angles counts; the last one stays.
        last = sign * near[2]
        total = np.arctan2(m[1, 0], m[1, 1])
        first = total - last if m[0, 2] > 0.0 else last - total
        out[0] = _near(sign * first, near[0])
        out[1] = _near(middle, near[1])
        out[2] = near[2]
        return
    first = sign * np.arctan2(-m[1, 2], m[2, 2])
    last = sign * np.arctan2(-m[0, 1], m[0, 0])
    a0 = _near(first, near[0])
    a1 = _near(middle, near[1])
    a2 = _near(last, near[2])
    b0 = _near(first + np.pi, near[0])
    b1 = _near(np.pi - middle, near[1])
    b2 = _near(last + np.pi, near[2])
    far_a = abs(a0 - near[0]) + abs(a1 - near[1]) + abs(a2 - near[2])
    far_b = abs(b0 - near[0]) + abs(b1 - near[1]) + abs(b2 - near[2])
    if far_a <= far_b:
        out[0], out[1], out[2] = a0, a1, a2
    else:
        out[0], out[1], out[2] = b0, b1, b2
