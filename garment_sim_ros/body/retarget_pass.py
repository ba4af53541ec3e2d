"""The compiled part of retargeting: from a source's joint poses to a target's, one pass each.

Every target joint has one of four rules for its rotation; positions follow from the rest offsets.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.transforms import quaternion_multiply, rotate, slerp
from garment_sim_ros.jit import kernel

FOLLOW = 0
"""Turn with the parent."""
DRIVEN = 1
"""Turn as a source joint does, by a constant offset."""
BLEND = 2
"""Turn by a share between a driven joint above and one below, as along a spine."""
TWIST = 3
"""Follow the driven joint above and take a share of the twist of the one below."""


@kernel(inner=True)
def _quaternion(T):
    """Unit quaternion of a rotation matrix, by its largest component (Shepperd's method)."""
    xx, yy, zz = T[0, 0], T[1, 1], T[2, 2]
    if xx + yy + zz > 0.0:
        x, y, z = T[2, 1] - T[1, 2], T[0, 2] - T[2, 0], T[1, 0] - T[0, 1]
        w = 1.0 + xx + yy + zz
    elif xx >= yy and xx >= zz:
        x, y, z = 1.0 + xx - yy - zz, T[0, 1] + T[1, 0], T[0, 2] + T[2, 0]
        w = T[2, 1] - T[1, 2]
    elif yy >= zz:
        x, y, z = T[0, 1] + T[1, 0], 1.0 - xx + yy - zz, T[1, 2] + T[2, 1]
        w = T[0, 2] - T[2, 0]
    else:
        x, y, z = T[0, 2] + T[2, 0], T[1, 2] + T[2, 1], 1.0 - xx - yy + zz
        w = T[1, 0] - T[0, 1]
    scale = 1.0 / np.sqrt(x * x + y * y + z * z + w * w)
    return x * scale, y * scale, z * scale, w * scale


@kernel(inner=True)
def _times(a, b):
    return quaternion_multiply(a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])


@kernel(inner=True)
def _store(rotation, j, q):
    for k in range(4):
        rotation[j, k] = q[k]


class Turns(NamedTuple):
    """How the target's joints get their rotations, n of them.

    Attributes:
        parent: Parent of each joint, shape [n].
        rule: Rule of each joint, shape [n].
        source: Source joint of driven joints, shape [n].
        offset: Rotation from the source joint's frame to the target joint's, shape [n, 4].
        above: Driven target joint above, for `BLEND` and `TWIST`, shape [n].
        below: Driven target joint below, likewise, shape [n].
        above_rest: Rest rotation of this joint in `above`, shape [n, 4].
        below_rest: Rest rotation of this joint in `below`, shape [n, 4].
        share: How far from `above` to `below`, 0 to 1, shape [n].
        bone_axis: Direction of this joint's bone in its own frame, for `TWIST`, shape [n, 3].
        rest_rotation: Rest rotation in the parent, in the hips for joints without one, [n, 4].
    """

    parent: IntArray
    rule: NDArray[np.int8]
    source: IntArray
    offset: FloatArray
    above: IntArray
    below: IntArray
    above_rest: FloatArray
    below_rest: FloatArray
    share: FloatArray
    bone_axis: FloatArray
    rest_rotation: FloatArray


@kernel()
def turn_joints(T_world_source, turns, hips, rotation):
    """World rotations of all target joints.

    Args:
        T_world_source: Poses of the source's joints, shape [m, 4, 4].
        turns: `Turns`.
        hips: Index of the target's hips.
        rotation: Output world rotations, shape [n, 4].
    """
    parent, rule = turns.parent, turns.rule
    n = parent.shape[0]
    for j in range(n):
        if rule[j] == DRIVEN:
            x, y, z, w = _quaternion(T_world_source[turns.source[j]])
            c = turns.offset[j]
            _store(rotation, j, quaternion_multiply(x, y, z, w, c[0], c[1], c[2], c[3]))
    for j in range(n):
        if rule[j] == FOLLOW:
            carrier = parent[j] if parent[j] >= 0 else hips
            _store(rotation, j, _times(rotation[carrier], turns.rest_rotation[j]))
            continue
        if rule[j] == DRIVEN:
            continue
        ax, ay, az, aw = _times(rotation[turns.above[j]], turns.above_rest[j])
        bx, by, bz, bw = _times(rotation[turns.below[j]], turns.below_rest[j])
        if rule[j] == BLEND:
            _store(rotation, j, slerp(ax, ay, az, aw, bx, by, bz, bw, turns.share[j]))
            continue
        dx, dy, dz, dw = quaternion_multiply(-ax, -ay, -az, aw, bx, by, bz, bw)
        u = turns.bone_axis[j]
        along = dx * u[0] + dy * u[1] + dz * u[2]
        if dw < 0.0:
            along, dw = -along, -dw
        half = turns.share[j] * np.arctan2(along, dw)
        s = np.sin(half)
        turned = quaternion_multiply(ax, ay, az, aw, s * u[0], s * u[1], s * u[2], np.cos(half))
        _store(rotation, j, turned)


@kernel(inner=True)
def _height(T, offset):
    """World height of a point fixed to a joint."""
    return T[2, 0] * offset[0] + T[2, 1] * offset[1] + T[2, 2] * offset[2] + T[2, 3]


@kernel(inner=True)
def _lift(T_world_source, T_world_target, joints, offset, height, reach, scale):
    """How far the target must be raised to stand as the source does; 0 without contact points.

    The smooth maximum (log of a sum of exponentials) of what the points ask for, each weighed by
    how near it is to the ground: where the proportions disagree, rather float a little than sink.
    """
    lowest = np.inf
    for c in range(joints.shape[0]):
        lowest = min(lowest, _height(T_world_source[joints[c, 0]], offset[c, 0]) - height[c, 0])
    softness = 0.5 * reach * scale
    largest = -np.inf
    raised = 0.0
    total = 0.0
    for c in range(joints.shape[0]):
        z = _height(T_world_source[joints[c, 0]], offset[c, 0]) - height[c, 0]
        lift = scale * z + height[c, 1] - _height(T_world_target[joints[c, 1]], offset[c, 1])
        nearness = (lowest - z) / reach
        total += np.exp(nearness)
        exponent = nearness + lift / softness
        if exponent > largest:
            raised = raised * np.exp(largest - exponent) + 1.0
            largest = exponent
        else:
            raised += np.exp(exponent - largest)
    if total == 0.0:
        return 0.0
    return softness * (largest + np.log(raised / total))


class Contacts(NamedTuple):
    """Points that may touch the ground, c of them, on source and target.

    Attributes:
        joints: Source and target joint of each point, shape [c, 2].
        offset: That point in the joints' frames [m], shape [c, 2, 3].
        height: Its height when it touches the ground [m], shape [c, 2].
    """

    joints: IntArray
    offset: FloatArray
    height: FloatArray


@kernel()
def place_joints(
    T_world_source, travel_joints, scale, middle_in_hips, parent, hips, rest_position, rotation,
    contacts, reach, out,
):  # fmt: skip
    """World poses of all target joints from their rotations.

    The midpoint between the hip joints goes the scaled way on the ground. Its height is the one
    that puts what is lowest, feet or hands, at its scaled height above the ground.

    Args:
        T_world_source: Poses of the source's joints, shape [m, 4, 4].
        travel_joints: The two source joints whose midpoint's way is followed, shape [2].
        scale: Target length per source length.
        middle_in_hips: Rest position of that midpoint in the target's hips [m], shape [3].
        parent: Parent of each joint, shape [n]; joints without one move with the hips.
        hips: Index of the target's hips.
        rest_position: Rest position in the parent, in the hips for joints without one [m], [n, 3].
        rotation: World rotations, shape [n, 4].
        contacts: `Contacts`.
        reach: Height above the lowest point within which others count too [m of the source].
        out: Output poses, shape [n, 4, 4]; their last rows are not touched.
    """
    a = T_world_source[travel_joints[0]]
    b = T_world_source[travel_joints[1]]
    h = rotation[hips]
    mx, my, mz = rotate(
        h[0], h[1], h[2], h[3], middle_in_hips[0], middle_in_hips[1], middle_in_hips[2]
    )
    hx = scale * 0.5 * (a[0, 3] + b[0, 3]) - mx
    hy = scale * 0.5 * (a[1, 3] + b[1, 3]) - my
    hz = scale * 0.5 * (a[2, 3] + b[2, 3]) - mz
    for j in range(parent.shape[0]):
        p = parent[j]
        q = rotation[p] if p >= 0 else rotation[hips]
        r = rest_position[j]
        px, py, pz = rotate(q[0], q[1], q[2], q[3], r[0], r[1], r[2])
        T = out[j]
        T[0, 3] = px + (out[p, 0, 3] if p >= 0 else hx)
        T[1, 3] = py + (out[p, 1, 3] if p >= 0 else hy)
        T[2, 3] = pz + (out[p, 2, 3] if p >= 0 else hz)
        x, y, z, w = rotation[j]
        T[0, 0] = 1.0 - 2.0 * (y * y + z * z)
        T[0, 1] = 2.0 * (x * y - z * w)
        T[0, 2] = 2.0 * (x * z + y * w)
        T[1, 0] = 2.0 * (x * y + z * w)
        T[1, 1] = 1.0 - 2.0 * (x * x + z * z)
        T[1, 2] = 2.0 * (y * z - x * w)
        T[2, 0] = 2.0 * (x * z - y * w)
        T[2, 1] = 2.0 * (y * z + x * w)
        T[2, 2] = 1.0 - 2.0 * (x * x + y * y)
    lift = _lift(
        T_world_source, out, contacts.joints, contacts.offset, contacts.height, reach, scale
    )
    for j in range(parent.shape[0]):
        out[j, 2, 3] += lift
