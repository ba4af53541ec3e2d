"""The compiled part of grounding feet: one posed body, both legs, in place.

Every function works on `T_world_joint`, poses of all joints, shape [n, 4, 4].
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.leg_reach import FOOT, STRAIGHT, bend_leg, reachable, turn_about
from garment_sim_ros.jit import kernel

_HARD = 0.001
"""Softness with which the root keeps within reach, in lengths of the leg: more would bend straight
knees."""
_DIP = 0.02
"""How far the root goes down at most for legs that do not reach, in lengths of the leg."""
_LEVER = 0.05
"""Length of a foot below which it does not point, likewise."""
_POINTING = 0.5
"""How far it points at most [rad]."""
_UPRIGHT = 0.35
_OBLIQUE = 0.85
"""Cosine of a foot's slope up to which it does not point, and from which it does fully."""
_PULL = 0.03
"""How far a foot on its ball alone is pulled down, in lengths of the leg."""
_FLAT = 0.2
"""Least length of a foot's forward direction along the ground from which it can be told."""


@kernel(inner=True)
def lowest(T, joint, offset):
    """Height of the lowest of some points fixed to joints [m].

    Args:
        T: Poses of all joints, shape [n, 4, 4].
        joint: Joint of each point, shape [p].
        offset: Points in their joints' frames [m], shape [p, 3].
    """
    least = np.inf
    for k in range(joint.shape[0]):
        R = T[joint[k]]
        o = offset[k]
        least = min(least, R[2, 0] * o[0] + R[2, 1] * o[1] + R[2, 2] * o[2] + R[2, 3])
    return least


@kernel()
def watch(T_source, joint, offset, standing, dt, limits, before, faded, weight, depth):
    """How much each of the source's points stands, smoothly in time at any rate.

    A point stands where it is as low as in a foot that stands, and hardly moves. Its speed is
    that against its own past, which fades; the weight follows with the same delay.

    Args:
        T_source: Poses of the source's joints, shape [m, 4, 4].
        joint: Joint of each point, -1 where the source has none, shape [p].
        offset: Each point in its joint's frame [m], shape [p, 3].
        standing: Height of each in a foot that stands [m], shape [p].
        dt: Time since the last call [s]; below 0: there is no past.
        limits: Height [m] and speed [m/s] up to which a point stands, and those from which it
            does not (height, height, speed, speed); depth below the ground from which it is
            somewhere else [m]; time of fading [s]; shape [6].
        before: The points' faded past, changed in place [m], shape [p, 3].
        faded: Weights before what is known only now, changed in place, shape [p].
        weight: Output, 0 to 1, shape [p].
        depth: How far each point is not below the ground: 1, or 0 from that depth on, shape [p].
    """
    fade = 1.0 if dt < 0.0 else 1.0 - np.exp(-dt / limits[5])
    # In a steady motion the past is behind by so much time.
    behind = limits[5] if dt <= 0.0 else dt * (1.0 - fade) / fade
    for p in range(joint.shape[0]):
        if joint[p] < 0:
            continue
        T, o = T_source[joint[p]], offset[p]
        speed = 0.0
        height = 0.0
        for k in range(3):
            now = T[k, 0] * o[0] + T[k, 1] * o[1] + T[k, 2] * o[2] + T[k, 3]
            before[p, k] += fade * (now - before[p, k])
            speed += (now - before[p, k]) ** 2
            height = now
        height -= standing[p]
        speed = np.sqrt(speed) / behind
        depth[p] = 1.0 - smooth_step(0.5 * limits[4], limits[4], -height)
        stands = depth[p]
        stands *= 1.0 - smooth_step(limits[0], limits[1], height)
        stands *= 1.0 - smooth_step(limits[2], limits[3], speed)
        faded[p] += fade * (stands - faded[p])
        # A foot that is lifted is let go at once, or it would pull the body after it.
        weight[p] = smooth_step(0.0, 1.0, faded[p]) * (
            1.0 - smooth_step(limits[1], 2.0 * limits[1], height)
        )


@kernel()
def missed(T_source, T, joint, offset, foot, target_offset, ahead, stretch, scale, weight, place):
    """How far each foot is, along the ground, from where the source's stands.

    The source's ankle and ball stay where they are while they stand, so the target's do in the
    same places to scale; what its foot is longer lies ahead of the ball.

    Args:
        T_source: Poses of the source's joints, shape [m, 4, 4].
        T: Poses of the target's, shape [n, 4, 4].
        joint: Source joint of ankle and ball of each foot, -1 where there is none, shape [f, 2].
        offset: Each in its joint's frame [m], shape [f, 2, 3].
        foot: Target joint of each foot, shape [f].
        target_offset: Ankle and ball in that joint's frame [m], shape [f, 2, 3].
        ahead: Forward in that joint's frame, when the foot stands flat, shape [f, 3].
        stretch: Way from the source's ball to scale to the target's, forward and left in a foot
            that stands flat [m], shape [f, 2].
        scale: Target length per source length.
        weight: How much ankle and ball stand, shape [f, 2].
        place: Output [m], shape [f, 2].
    """
    for i in range(joint.shape[0]):
        R = T[foot[i]]
        fx = R[0, 0] * ahead[i, 0] + R[0, 1] * ahead[i, 1] + R[0, 2] * ahead[i, 2]
        fy = R[1, 0] * ahead[i, 0] + R[1, 1] * ahead[i, 1] + R[1, 2] * ahead[i, 2]
        length = max(np.sqrt(fx * fx + fy * fy), _FLAT)
        fx, fy = fx / length, fy / length
        place[i, 0] = place[i, 1] = 0.0
        total = weight[i, 0] + weight[i, 1] + 1e-3
        for p in range(2):
            if joint[i, p] < 0:
                continue
            S, o, q = T_source[joint[i, p]], offset[i, p], target_offset[i, p]
            off = np.zeros(2)
            for k in range(2):
                s = S[k, 0] * o[0] + S[k, 1] * o[1] + S[k, 2] * o[2] + S[k, 3]
                t = R[k, 0] * q[0] + R[k, 1] * q[1] + R[k, 2] * q[2] + R[k, 3]
                off[k] = scale * s - t
            if p == 1:
                off[0] += stretch[i, 0] * fx - stretch[i, 1] * fy
                off[1] += stretch[i, 0] * fy + stretch[i, 1] * fx
            for k in range(2):
                share = (weight[i, p] + (1e-3 if p == 0 else 0.0)) / total
                place[i, k] += share * off[k]


@kernel(inner=True)
def smooth_step(low, high, value):
    """0 up to low, 1 from high, smooth between."""
    s = min(max((value - low) / (high - low), 0.0), 1.0)
    return s * s * (3.0 - 2.0 * s)


@kernel(inner=True)
def _point_foot(T, ankle, part, ahead, reach, weight, sole_joint, sole_offset):
    """Turn a foot that stands and does not reach the ground down towards it, about its ankle."""
    least = np.inf
    lever = 0.0
    A = T[ankle]
    fx = A[0, 0] * ahead[0] + A[0, 1] * ahead[1] + A[0, 2] * ahead[2]
    fy = A[1, 0] * ahead[0] + A[1, 1] * ahead[1] + A[1, 2] * ahead[2]
    level = np.sqrt(fx * fx + fy * fy)
    length = max(level, _FLAT)
    fx, fy = fx / length, fy / length
    for k in range(sole_joint.shape[0]):
        R, o = T[sole_joint[k]], sole_offset[k]
        height = R[2, 0] * o[0] + R[2, 1] * o[1] + R[2, 2] * o[2] + R[2, 3]
        if height < least:
            least = height
            x = R[0, 0] * o[0] + R[0, 1] * o[1] + R[0, 2] * o[2] + R[0, 3] - A[0, 3]
            y = R[1, 0] * o[0] + R[1, 1] * o[1] + R[1, 2] * o[2] + R[1, 3] - A[1, 3]
            lever = fx * x + fy * y
    if least <= 0.0 or weight <= 0.0 or fx * fx + fy * fy < 0.25:
        return
    own = _LEVER * reach
    # A foot upright on its toes comes no lower by it.
    weight *= smooth_step(_UPRIGHT, _OBLIQUE, level)
    angle = weight * least * lever / (lever * lever + own * own)
    angle = _POINTING * np.tanh(angle / _POINTING)
    c, s, away = np.cos(angle), np.sin(angle), 1.0 / np.sqrt(fx * fx + fy * fy)
    nx, ny = -fy * away, fx * away
    turn, place = np.empty((3, 3)), np.empty(3)
    turn[0, 0], turn[1, 1], turn[2, 2] = c + (1.0 - c) * nx * nx, c + (1.0 - c) * ny * ny, c
    turn[0, 1] = turn[1, 0] = (1.0 - c) * nx * ny
    turn[0, 2], turn[2, 0] = s * ny, -s * ny
    turn[1, 2], turn[2, 1] = -s * nx, s * nx
    for k in range(3):
        place[k] = A[k, 3]
    for j in range(T.shape[0]):
        if part[j] == FOOT:
            turn_about(T[j], turn, place, place)


class Soles(NamedTuple):
    """Points of the soles that may be the lowest of a foot.

    Attributes:
        joint: Joint of each point, shape [p].
        offset: That point in the joint's frame [m], shape [p, 3].
        start: First point of each foot, and the end, shape [f + 1].
    """

    joint: IntArray
    offset: FloatArray
    start: IntArray


@kernel(inner=True)
def _root_shift(T, joints, reach, weight, place, down):
    """How far the root goes up for the feet that stand [m]; below 0: down.

    Args:
        T: Poses of all joints, shape [n, 4, 4].
        joints: See `Legs`.
        reach: See `Legs`.
        weight: See `ground`.
        place: See `ground`.
        down: Height of each foot's lowest point [m], shape [f].
    """
    f = down.size
    standing = 0.0
    none = 1.0
    for i in range(f):
        standing += weight[i, 2] ** 2
        none *= 1.0 - weight[i, 2]
    shift = 0.0
    if standing == 0.0:
        return shift
    for i in range(f):
        shift -= (1.0 - none) * weight[i, 2] ** 2 / standing * down[i]
    # Legs that would have to be longer than they are take the root down with them.
    more = 0.0
    most = 1e-9
    for i in range(f):
        hip, ankle = T[joints[i, 0]], T[joints[i, 2]]
        x = ankle[0, 3] + place[i, 0] - hip[0, 3]
        y = ankle[1, 3] + place[i, 1] - hip[1, 3]
        z = hip[2, 3] + shift - (ankle[2, 3] - weight[i, 0] * down[i])
        length = STRAIGHT * reach[i]
        high = np.sqrt(max(length * length - x * x - y * y, 0.0))
        hard = _HARD * reach[i]
        excess = (z - high) / hard
        wish = excess if excess > 30.0 else np.log1p(np.exp(excess))
        more = max(more, weight[i, 2] ** 2 * hard * wish)
        # Not far: rather a foot that points than a body that bobs.
        most = max(most, _DIP * reach[i])
    return shift - most * np.tanh(more / most)


@kernel()
def ground(T, legs, soles, weight, place):
    """Put feet on the ground where they stand, and keep others out of it.

    The root goes the mean way of the feet that stand, and down where a leg does not reach; what
    is left each leg does by itself.

    Args:
        T: Poses of all joints, changed in place, shape [n, 4, 4].
        legs: `Legs`.
        soles: `Soles`.
        weight: How much each foot stands, is kept out of the ground, leads the root, and points,
            0 to 1, shape [f, 4].
        place: Way on the ground that each ankle is off where it shall be [m], shape [f, 2].
    """
    joints, reach = legs.joints, legs.reach
    f = joints.shape[0]
    down = np.zeros(f)
    for i in range(f):
        points = slice(soles.start[i], soles.start[i + 1])
        down[i] = lowest(T, soles.joint[points], soles.offset[points])
    shift = _root_shift(T, joints, reach, weight, place, down)
    for j in range(T.shape[0]):
        T[j, 2, 3] += shift
    goal = np.empty(3)
    for i in range(f):
        down[i] += shift
        up = -weight[i, 0] * down[i]
        if up < 0.0:  # a foot that rolls off is not pulled far: its knee would snap when let go
            most = reach[i] * (_PULL + weight[i, 2] ** 4)
            up = -most * np.tanh(-up / most)
        left = down[i] + up
        if left < 0.0:
            up -= weight[i, 1] * left
        ankle = T[joints[i, 2]]
        goal[0] = ankle[0, 3] + place[i, 0]
        goal[1] = ankle[1, 3] + place[i, 1]
        goal[2] = ankle[2, 3] + up
        hip = T[joints[i, 0]]
        before = np.sqrt(
            (ankle[0, 3] - hip[0, 3]) ** 2
            + (ankle[1, 3] - hip[1, 3]) ** 2
            + (ankle[2, 3] - hip[2, 3]) ** 2
        )
        reachable(T, joints[i], reach[i], before, goal)
        bend_leg(T, joints[i], legs.part[i], legs.hinge[i], goal)
        points = slice(soles.start[i], soles.start[i + 1])
        _point_foot(
            T, joints[i, 2], legs.part[i], legs.ahead[i], reach[i], weight[i, 3],
            soles.joint[points], soles.offset[points],
        )  # fmt: skip
