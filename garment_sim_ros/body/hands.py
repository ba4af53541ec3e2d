"""Arms out of the ground: hands that a body leans on bend at the wrist, as palms on a floor do.

A source without hands leans on its wrists, and hands that follow the forearms are in the ground
then. What of a wrist is under the ground is lifted, over the same place, and the elbow bends for
it; then the hand is turned about its wrist until it is out: towards its back, but where that looks
down, towards its palm. A hand on its edge, which no turn brings out, is lifted instead. Where the
source's own elbow is far below the ground, nothing is done.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.anatomy import SIDES, UP, leg_length, unit
from garment_sim_ros.body.arms import LEAST_SKIN, NORMALS_BY_AXIS, skin_of_bones
from garment_sim_ros.body.feet_pass import lowest, smooth_step
from garment_sim_ros.body.leg_reach import FOOT, SHANK, THIGH, bend_leg, turn_about
from garment_sim_ros.body.skeleton import Skeleton
from garment_sim_ros.body.skin import Body
from garment_sim_ros.jit import kernel

_DEEP = 0.15
"""Depth of the source's elbow from which the ground is somewhere else, in leg lengths."""
_CLOSE = 0.002
"""Depth in the ground that is left [m]."""
_SINKS = 0.01
"""Depth of a hand from which on its wrist is as high as a palm on the ground needs it [m]."""
_STEP = np.radians(5.0)
_STEPS = 20
"""A hand is turned by so many steps at most."""
_ON_EDGE = (0.5, 0.85)
"""How upright its axis is from which on it is turned less, and not at all."""
_BACK_DOWN = (-0.4, -0.2)
"""How far a hand's back looks down, as a cosine, from which on it turns the other way; between the
two it turns less."""
_ROOM = 1.25
"""Height of the wrist of a palm that lies on the ground, in its thicknesses."""
_BONES = ("UpperArm", "LowerArm", "Hand")


class Arms(NamedTuple):
    """The arms of a body that may be in the ground, a of them.

    Attributes:
        joints: Upper arm, lower arm and hand, shape [a, 3].
        part: What each joint of the body moves with, as in `body.leg_reach.Legs`, shape [a, n].
        hinge: Axis of each elbow in the upper arm's frame, shape [a, 3].
        wrist: Axis about which a hand turns towards its back, in its frame, shape [a, 3].
        back: Where the hand's back looks, in its frame, shape [a, 3].
        palm: How high the wrist of a palm is that lies on the ground [m], shape [a].
        joint: Joint of each point of skin that may be the lowest, forearm by hand, shape [p].
        offset: These points in their joints' frames [m], shape [p, 3].
        start: First point of each forearm and each hand, and the end, shape [2 a + 1].
        source: The source's lower arms, shape [a].
    """

    joints: IntArray
    part: NDArray[np.int8]
    hinge: FloatArray
    wrist: FloatArray
    back: FloatArray
    palm: FloatArray
    joint: IntArray
    offset: FloatArray
    start: IntArray
    source: IntArray


@kernel()
def lift_arms(T_source, T, arms, scale, deep):
    """Lift what of forearms and hands is under the ground.

    Args:
        T_source: Poses of the source's joints, shape [k, 4, 4].
        T: Poses of the body's, changed in place, shape [n, 4, 4].
        arms: `Arms`.
        scale: Target length per source length.
        deep: Depth of the source's elbow from which nothing is done [m].
    """
    goal = np.empty(3)
    for i in range(arms.joints.shape[0]):
        elbow = scale * T_source[arms.source[i], 2, 3]
        there = 1.0 - smooth_step(0.5 * deep, deep, -elbow)
        fore = slice(arms.start[2 * i], arms.start[2 * i + 1])
        palm = slice(arms.start[2 * i + 1], arms.start[2 * i + 2])
        low = lowest(T, arms.joint[palm], arms.offset[palm])
        high = arms.palm[i] - T[arms.joints[i, 2], 2, 3]
        under = max(
            -lowest(T, arms.joint[fore], arms.offset[fore]),
            min(max(-low / _SINKS, 0.0), 1.0) * high,
        )
        under *= there
        if under > 0.0:
            for k in range(3):
                goal[k] = T[arms.joints[i, 2], k, 3]
            goal[2] += under
            bend_leg(T, arms.joints[i], arms.part[i], arms.hinge[i], goal)
        if there * lowest(T, arms.joint[palm], arms.offset[palm]) < -_CLOSE:
            axis, back = arms.wrist[i], arms.back[i]
            angle = there * _way_out(T, arms.joints[i, 2], axis, back, arms.offset[palm])
            _turn_hand(T, arms.joints[i, 2], arms.part[i], axis, angle)
            under = -there * lowest(T, arms.joint[palm], arms.offset[palm]) - _CLOSE
            if under > 0.0:
                for k in range(3):
                    goal[k] = T[arms.joints[i, 2], k, 3]
                goal[2] += under
                bend_leg(T, arms.joints[i], arms.part[i], arms.hinge[i], goal)


@kernel(inner=True)
def _way_out(T, hand, axis, back, offset):
    """Angle by which a hand turns about an axis in its frame until it is out of the ground [rad].

    Where none brings it out, the one that brings it highest.
    """
    R = T[hand]
    upright = abs(R[2, 0] * axis[0] + R[2, 1] * axis[1] + R[2, 2] * axis[2])
    down = R[2, 0] * back[0] + R[2, 1] * back[1] + R[2, 2] * back[2]
    middle = 0.5 * (_BACK_DOWN[0] + _BACK_DOWN[1])
    half = 0.5 * (_BACK_DOWN[1] - _BACK_DOWN[0])
    way = 1.0 if down > middle else -1.0
    much = 1.0 - smooth_step(_ON_EDGE[0], _ON_EDGE[1], upright)
    much *= smooth_step(0.0, half, abs(down - middle))
    best, highest, before = 0.0, -np.inf, 0.0
    for s in range(_STEPS + 1):
        angle = way * s * _STEP
        c, d = np.cos(angle), np.sin(angle)
        low = np.inf
        for p in range(offset.shape[0]):
            x, y, z = offset[p]
            along = (1.0 - c) * (x * axis[0] + y * axis[1] + z * axis[2])
            u = c * x + d * (axis[1] * z - axis[2] * y) + along * axis[0]
            v = c * y + d * (axis[2] * x - axis[0] * z) + along * axis[1]
            w = c * z + d * (axis[0] * y - axis[1] * x) + along * axis[2]
            low = min(low, R[2, 0] * u + R[2, 1] * v + R[2, 2] * w + R[2, 3])
        if low >= -_CLOSE and s > 0:
            share = (before + _CLOSE) / min(before - low, -1e-12)
            return much * way * _STEP * (s - 1 + min(max(share, 0.0), 1.0))
        if low > highest:
            best, highest = angle, low
        before = low
    return much * best


@kernel(inner=True)
def _turn_hand(T, hand, part, axis, angle):
    """Turn a hand about an axis in its frame, with all that hangs on it."""
    turn, at, n = np.empty((3, 3)), np.empty(3), np.empty(3)
    for k in range(3):
        R = T[hand, k]
        n[k] = R[0] * axis[0] + R[1] * axis[1] + R[2] * axis[2]
        at[k] = R[3]
    c, s = np.cos(angle), np.sin(angle)
    for i in range(3):
        for k in range(3):
            turn[i, k] = (1.0 - c) * n[i] * n[k]
        turn[i, i] += c
    turn[0, 1] -= s * n[2]
    turn[1, 0] += s * n[2]
    turn[0, 2] += s * n[1]
    turn[2, 0] -= s * n[1]
    turn[1, 2] -= s * n[0]
    turn[2, 1] += s * n[0]
    for j in range(T.shape[0]):
        if part[j] == FOOT:
            turn_about(T[j], turn, at, at)


class Hands:
    """Keeps forearms and hands of one body out of the ground.

    Args:
        source: Source skeleton in its reference pose.
        rest: The body's skeleton at rest.
        body: The body; arms without a hand, or without skin, are left as they are.
        scale: Target length per source length.
    """

    def __init__(self, source: Skeleton, rest: Skeleton, body: Body, scale: float) -> None:
        self._scale = scale
        self._deep = _DEEP * (leg_length(rest.marks) or 1.0)
        skins = skin_of_bones(body)
        whole = [
            side
            for side in SIDES
            if all(side + bone in rest.bones for bone in _BONES)
            and f"{side}LowerArm" in source.bones
            and f"{side}UpperArm" in rest.frames
            and all(len(skins.get(side + bone, ())) >= LEAST_SKIN for bone in _BONES[1:])
        ]
        n, a = len(body.rig), len(whole)
        part = np.full((a, n), -1, np.int8)
        joints, offsets, starts = np.zeros((a, 3), np.int32), [], [0]
        hinge, wrist, back = np.zeros((3, a, 3))
        palm = np.zeros(a)
        movers: list[int] = []
        for i, side in enumerate(whole):
            upper, lower, hand = joints[i] = [rest.bones[side + bone] for bone in _BONES]
            for j, parent in enumerate(body.rig.parent):
                above = part[i, parent] if parent >= 0 else -1
                part[i, j] = {upper: THIGH, lower: SHANK, hand: FOOT}.get(j, above)
            hinge[i] = rest.rotation(upper).T @ rest.frames[f"{side}UpperArm"][:, 1]
            wrist[i], back[i], palm[i] = _palm(rest, hand, skins[f"{side}Hand"])
            for bone in _BONES[1:]:
                joint = rest.bones[side + bone]
                T = rest.T_world_joint[joint]
                x = (skins[side + bone] - T[:3, 3]) @ T[:3, :3]
                offsets.append(x[np.unique(np.argmax(x @ NORMALS_BY_AXIS, axis=0))])
                movers += [joint] * len(offsets[-1])
                starts.append(len(movers))
        self._arms = Arms(
            joints=joints,
            part=part,
            hinge=hinge,
            wrist=wrist,
            back=back,
            palm=palm,
            joint=np.array(movers, np.int32),
            offset=np.concatenate([np.zeros((0, 3)), *offsets]),
            start=np.array(starts, np.int32),
            source=np.array([source.bones[f"{side}LowerArm"] for side in whole], np.int32),
        )

    def lift(self, T_source: FloatArray, T_world_joint: FloatArray) -> None:
        """Lift what of the arms is under the ground.

        Args:
            T_source: The source's joints, shape [m, 4, 4].
            T_world_joint: The body's joints, changed in place, shape [n, 4, 4].
        """
        lift_arms(T_source, T_world_joint, self._arms, self._scale, self._deep)


def _palm(rest: Skeleton, hand: int, skin: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Axis about which a hand turns towards its back, where that looks, and a wrist's height.

    At rest palms of arms that are held out look down, and those of arms that hang at the body.
    """
    x = skin - rest.T_world_joint[hand, :3, 3]
    fingers = unit(x.mean(axis=0))
    away = unit(rest.T_world_joint[hand, :3, 3] - rest.marks.joint["hips"])
    back = UP if away is None else UP + away
    axis = None if fingers is None else unit(np.cross(fingers, back))
    if axis is None or fingers is None:
        return np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), 0.0
    back, R = np.cross(axis, fingers), rest.rotation(hand)
    below = x @ -back
    return R.T @ axis, R.T @ back, _ROOM * float(max(below.max(), 0.0))
