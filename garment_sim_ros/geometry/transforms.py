"""Rigid transforms and quaternions.

Quaternions are ``(x, y, z, w)`` as in ROS messages; matrices act on column vectors. Scalar-level
compiled functions take and return tuples or small arrays; the batched ones below loop over them.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.jit import kernel

AXES_FROM_Y_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation from y up, facing +z (glTF) to z up, facing +x (REP-103), shape [3, 3]."""


@kernel(forceinline=True)
def quaternion_multiply(ax, ay, az, aw, bx, by, bz, bw):
    """Hamilton product a b; rotates by b first, then by a."""
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


@kernel(forceinline=True)
def rotate(qx, qy, qz, qw, vx, vy, vz):
    """Vector v rotated by the unit quaternion q."""
    tx = 2.0 * (qy * vz - qz * vy)
    ty = 2.0 * (qz * vx - qx * vz)
    tz = 2.0 * (qx * vy - qy * vx)
    return (
        vx + qw * tx + qy * tz - qz * ty,
        vy + qw * ty + qz * tx - qx * tz,
        vz + qw * tz + qx * ty - qy * tx,
    )


@kernel(inner=True)
def slerp(ax, ay, az, aw, bx, by, bz, bw, s):
    """Shortest-arc spherical interpolation from a (s = 0) to b (s = 1), unit length."""
    dot = ax * bx + ay * by + az * bz + aw * bw
    sign = 1.0
    if dot < 0.0:
        dot = -dot
        sign = -1.0
    if dot > 0.9995:
        wa = 1.0 - s
        wb = s * sign
    else:
        angle = np.arccos(min(dot, 1.0))
        inverse_sine = 1.0 / np.sin(angle)
        wa = np.sin((1.0 - s) * angle) * inverse_sine
        wb = np.sin(s * angle) * inverse_sine * sign
    x = wa * ax + wb * bx
    y = wa * ay + wb * by
    z = wa * az + wb * bz
    w = wa * aw + wb * bw
    scale = 1.0 / np.sqrt(x * x + y * y + z * z + w * w)
    return x * scale, y * scale, z * scale, w * scale


@kernel(forceinline=True)
def unit_quaternion(m):
    """Unit quaternion (x, y, z, w), w >= 0, of the rotation in the upper left of the matrix m."""
    xx = m[0, 0]
    yy = m[1, 1]
    zz = m[2, 2]
    if xx + yy + zz > 0.0:
        x, y, z, w = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1.0 + xx + yy + zz
    elif xx >= yy and xx >= zz:
        x, y = 1.0 + xx - yy - zz, m[0, 1] + m[1, 0]
        z, w = m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]
    elif yy >= zz:
        x, y = m[0, 1] + m[1, 0], 1.0 - xx + yy - zz
        z, w = m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]
    else:
        x, y = m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]
        z, w = 1.0 - xx - yy + zz, m[1, 0] - m[0, 1]
    scale = 1.0 / np.sqrt(x * x + y * y + z * z + w * w)
    if w < 0.0:
        scale = -scale
    return x * scale, y * scale, z * scale, w * scale


@kernel(forceinline=True)
def interpolate_poses(
    position_a, orientation_a, position_b, orientation_b, s, position, orientation
):
    """Lerp positions and slerp orientations of n poses into the output arrays.

    Args:
        position_a: Positions at s = 0 [m], shape [n, 3].
        orientation_a: Unit quaternions at s = 0, shape [n, 4].
        position_b: Positions at s = 1 [m], shape [n, 3].
        orientation_b: Unit quaternions at s = 1, shape [n, 4].
        s: Interpolation parameter in [0, 1]. At 0 and 1 what comes out is that of one pose alone,
            to the last digit: where one way ends the next one begins.
        position: Output positions [m], shape [n, 3].
        orientation: Output unit quaternions, shape [n, 4].
    """
    if s >= 1.0:
        position_a, orientation_a, s = position_b, orientation_b, 0.0
    if s <= 0.0:
        position_b, orientation_b = position_a, orientation_a
    for i in range(position_a.shape[0]):
        for k in range(3):
            position[i, k] = position_a[i, k] + s * (position_b[i, k] - position_a[i, k])
        a = orientation_a[i]
        b = orientation_b[i]
        q = slerp(a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3], s)
        for k in range(4):
            orientation[i, k] = q[k]


@kernel(inner=True)
def _rotation(q, i, R):
    """Writes the rotation matrix of quaternion i to the upper left of matrix i."""
    x, y, z, w = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
    R[i, 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[i, 0, 1] = 2.0 * (x * y - z * w)
    R[i, 0, 2] = 2.0 * (x * z + y * w)
    R[i, 1, 0] = 2.0 * (x * y + z * w)
    R[i, 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[i, 1, 2] = 2.0 * (y * z - x * w)
    R[i, 2, 0] = 2.0 * (x * z - y * w)
    R[i, 2, 1] = 2.0 * (y * z + x * w)
    R[i, 2, 2] = 1.0 - 2.0 * (x * x + y * y)


@kernel()
def _rotations(q, R):
    """Rotation matrices [n, 3, 3] of unit quaternions [n, 4]."""
    for i in range(q.shape[0]):
        _rotation(q, i, R)


@kernel()
def _transforms(position, q, T):
    """Transforms [n, 4, 4] of positions [n, 3] and unit quaternions [n, 4]."""
    for i in range(q.shape[0]):
        _rotation(q, i, T)
        for k in range(3):
            T[i, k, 3] = position[i, k]
            T[i, 3, k] = 0.0
        T[i, 3, 3] = 1.0


def matrix_from_quaternion(q: FloatArray) -> FloatArray:
    """Rotation matrices of unit quaternions.

    Args:
        q: Unit quaternions (x, y, z, w), shape [..., 4].

    Returns:
        Rotation matrices, shape [..., 3, 3].
    """
    q = np.array(q, np.float64, order="C")  # a copy: kernels know arrays that can be written to
    R = np.empty((*q.shape[:-1], 3, 3))
    _rotations(q.reshape(-1, 4), R.reshape(-1, 3, 3))
    return R


def quaternion_from_matrix(rotation: FloatArray) -> FloatArray:
    """Unit quaternions (x, y, z, w) with w >= 0 of rotation matrices.

    Args:
        rotation: Proper rotation matrices, shape [..., 3, 3].

    Returns:
        Unit quaternions, shape [..., 4].
    """
    m = np.asarray(rotation, dtype=np.float64)
    # The four candidates 4 q_k q; the row with the largest q_k^2 is the best conditioned one.
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    xy, xz, yz = (
        m[..., 0, 1] + m[..., 1, 0],
        m[..., 0, 2] + m[..., 2, 0],
        m[..., 1, 2] + m[..., 2, 1],
    )
    wx, wy, wz = (
        m[..., 2, 1] - m[..., 1, 2],
        m[..., 0, 2] - m[..., 2, 0],
        m[..., 1, 0] - m[..., 0, 1],
    )
    candidates = np.stack(
        [
            np.stack([1 + xx - yy - zz, xy, xz, wx], axis=-1),
            np.stack([xy, 1 - xx + yy - zz, yz, wy], axis=-1),
            np.stack([xz, yz, 1 - xx - yy + zz, wz], axis=-1),
            np.stack([wx, wy, wz, 1 + xx + yy + zz], axis=-1),
        ],
        axis=-2,
    )
    best = np.argmax(np.diagonal(candidates, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(candidates, best[..., None, None], axis=-2)[..., 0, :]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., 3:] < 0.0, -q, q)


def transform_from(position: FloatArray, orientation: FloatArray) -> FloatArray:
    """Homogeneous transforms from positions [..., 3] [m] and unit quaternions [..., 4]."""
    x = np.array(position, np.float64, order="C")
    q = np.empty((*x.shape[:-1], 4))
    q[...] = orientation
    T = np.empty((*x.shape[:-1], 4, 4))
    _transforms(x.reshape(-1, 3), q.reshape(-1, 4), T.reshape(-1, 4, 4))
    return T


def invert_transform(T: FloatArray) -> FloatArray:
    """Inverse of rigid transforms, shape [..., 4, 4]."""
    T = np.asarray(T, dtype=np.float64)
    inverse = np.zeros_like(T)
    rotation_t = np.swapaxes(T[..., :3, :3], -1, -2)
    inverse[..., :3, :3] = rotation_t
    inverse[..., :3, 3] = -(rotation_t @ T[..., :3, 3, None])[..., 0]
    inverse[..., 3, 3] = 1.0
    return inverse


def transform_points(T: FloatArray, points: FloatArray) -> FloatArray:
    """Points [n, 3] mapped by one transform [4, 4]."""
    return np.asarray(points) @ T[:3, :3].T + T[:3, 3]
