"""Legs that reach for a place: one posed body, in place."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.jit import kernel

THIGH = 0
SHANK = 1
FOOT = 2
"""What joints of a leg move with; joints of no leg have -1."""

STRAIGHT = 0.9995
"""Longest leg, in lengths of thigh and shank together: a knee shows its axis."""
_SOFT = 0.97
"""Length of a leg, likewise, from which it gives way when it shall become longer: a knee that goes
straight at full speed snaps."""
_LONG = 0.985
"""How long it becomes at most, likewise, unless it is nearly so anyway."""
_ROOM = 0.006
"""How much longer than it is anyway it may become, likewise."""
_HINGE = 0.3
"""How much a knee's own axis counts against that of its bend, in products of the two lengths."""


class Legs(NamedTuple):
    """The legs of a body, f of them.

    Attributes:
        joints: Upper leg, lower leg and foot, shape [f, 3].
        part: What each joint of the body moves with, shape [f, n].
        hinge: Axis of each knee in the upper leg's frame, shape [f, 3].
        ahead: Forward in each foot's frame, when it stands flat, shape [f, 3].
        reach: Length of thigh and shank [m], shape [f].
    """

    joints: IntArray
    part: NDArray[np.int8]
    hinge: FloatArray
    ahead: FloatArray
    reach: FloatArray


@kernel(inner=True)
def _cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@kernel(inner=True)
def _norm(a):
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@kernel(inner=True)
def _arc(a, b, out):
    """The smallest rotation that takes unit vector a to unit vector b, into out [3, 3]."""
    v = np.empty(3)
    _cross(a, b, v)
    c = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    s = 1.0 / max(1.0 + c, 1e-9)
    out[0, 0] = 1.0 - s * (v[1] * v[1] + v[2] * v[2])
    out[1, 1] = 1.0 - s * (v[0] * v[0] + v[2] * v[2])
    out[2, 2] = 1.0 - s * (v[0] * v[0] + v[1] * v[1])
    out[0, 1], out[1, 0] = s * v[0] * v[1] - v[2], s * v[0] * v[1] + v[2]
    out[0, 2], out[2, 0] = s * v[0] * v[2] + v[1], s * v[0] * v[2] - v[1]
    out[1, 2], out[2, 1] = s * v[1] * v[2] - v[0], s * v[1] * v[2] + v[0]


@kernel(inner=True)
def turn_about(T, R, before, after):
    """Turn a joint by R about a point that goes from one place to another."""
    for c in range(3):
        x, y, z = T[0, c], T[1, c], T[2, c]
        for k in range(3):
            T[k, c] = R[k, 0] * x + R[k, 1] * y + R[k, 2] * z
    x, y, z = T[0, 3] - before[0], T[1, 3] - before[1], T[2, 3] - before[2]
    for k in range(3):
        T[k, 3] = R[k, 0] * x + R[k, 1] * y + R[k, 2] * z + after[k]


@kernel(inner=True)
def reachable(T, joints, reach, before, goal):
    """Raise a goal of an ankle that the leg comes near only straight; along the ground it stays.

    Args:
        T: Poses of all joints, shape [n, 4, 4].
        joints: Upper leg, lower leg and foot, shape [3].
        reach: Length of thigh and shank [m].
        before: Distance of hip and ankle that the leg may have anyway [m].
        goal: Where the ankle shall be [m], changed in place, shape [3].
    """
    hip = T[joints[0]]
    x, y, z = goal[0] - hip[0, 3], goal[1] - hip[1, 3], goal[2] - hip[2, 3]
    wanted = np.sqrt(x * x + y * y + z * z)
    longest = min(max(_LONG * reach, before + _ROOM * reach), STRAIGHT * reach)
    free = min(max(before, _SOFT * reach), longest - 1e-6)
    if wanted <= free or z >= 0.0:
        return
    room = longest - free
    length = free + room * np.tanh((wanted - free) / room)
    level = x * x + y * y
    if level < length * length:
        goal[2] = max(goal[2], hip[2, 3] - np.sqrt(length * length - level))


@kernel(forceinline=True)
def bend_leg(T, joints, part, hinge, goal):
    """Put an ankle as near to a goal as the leg reaches; the foot keeps its orientation.

    The knee stays in the plane that it bends in, or would bend in where it is straight.

    Args:
        T: Poses of all joints, changed in place, shape [n, 4, 4].
        joints: Upper leg, lower leg and foot, shape [3].
        part: What each joint moves with, -1 for none, shape [n].
        hinge: Axis about which the knee bends, in the upper leg's frame, shape [3].
        goal: Where the ankle shall be [m], shape [3].
    """
    hip, knee, ankle = np.empty(3), np.empty(3), np.empty(3)
    thigh, shank, way = np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        hip[k], knee[k] = T[joints[0], k, 3], T[joints[1], k, 3]
        ankle[k] = T[joints[2], k, 3]
        thigh[k], shank[k] = knee[k] - hip[k], ankle[k] - knee[k]
        way[k] = goal[k] - hip[k]
    a, b, d = _norm(thigh), _norm(shank), _norm(way)
    if a < 1e-6 or b < 1e-6 or d < 1e-6:
        return
    axis, sideways = np.empty(3), np.empty(3)
    _cross(thigh, shank, axis)
    for k in range(3):
        H = T[joints[0]]
        own = H[k, 0] * hinge[0] + H[k, 1] * hinge[1] + H[k, 2] * hinge[2]
        axis[k] += _HINGE * a * b * own
        thigh[k] /= a
        shank[k] /= b
    along = axis[0] * thigh[0] + axis[1] * thigh[1] + axis[2] * thigh[2]
    for k in range(3):
        axis[k] -= along * thigh[k]
    length = _norm(axis)
    if length < 1e-9:
        return
    for k in range(3):
        axis[k] /= length
    _cross(axis, thigh, sideways)
    reached = min(max(d, abs(a - b) + 1e-6), STRAIGHT * (a + b))
    cosine = (reached * reached - a * a - b * b) / (2.0 * a * b)
    cosine = min(max(cosine, -1.0), 1.0)
    sine = np.sqrt(1.0 - cosine * cosine)
    bent, old, new = np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        bent[k] = cosine * thigh[k] + sine * sideways[k]
        old[k] = a * thigh[k] + b * bent[k]
        new[k] = way[k] / d
    length = _norm(old)
    for k in range(3):
        old[k] /= length
    knee_turn, leg_turn, both = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    _arc(shank, bent, knee_turn)
    _arc(old, new, leg_turn)
    for i in range(3):
        for k in range(3):
            both[i, k] = (
                leg_turn[i, 0] * knee_turn[0, k]
                + leg_turn[i, 1] * knee_turn[1, k]
                + leg_turn[i, 2] * knee_turn[2, k]
            )
    new_knee, shift = np.empty(3), np.empty(3)
    for k in range(3):
        R = leg_turn[k]
        new_knee[k] = hip[k] + a * (R[0] * thigh[0] + R[1] * thigh[1] + R[2] * thigh[2])
    for k in range(3):
        R = leg_turn[k]
        shift[k] = new_knee[k] + b * (R[0] * bent[0] + R[1] * bent[1] + R[2] * bent[2]) - ankle[k]
    for j in range(T.shape[0]):
        if part[j] == THIGH:
            turn_about(T[j], leg_turn, hip, hip)
        elif part[j] == SHANK:
            turn_about(T[j], both, knee, new_knee)
        elif part[j] == FOOT:
            for k in range(3):
                T[j, k, 3] += shift[k]
