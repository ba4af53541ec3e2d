"""Knees that bend as far as flesh lets them: the calf of a deep squat meets the thigh.

Rigid calves and thighs go into each other where a knee is bent farther, past the middle, and no
cloth fits between. Such a knee is opened. The foot stays where it stands, and the body goes away
from it; a foot that does not stand goes away from the body, but not into the ground.
"""

import numpy as np

from garment_sim_ros.body.feet_pass import lowest
from garment_sim_ros.body.leg_reach import bend_leg
from garment_sim_ros.jit import kernel

FREE = float(np.radians(135.0))
"""Bend of a knee up to which nothing is done [rad]."""
MOST = float(np.radians(140.0))
"""Bend that a knee comes near to at most [rad]: as far as people bend their own."""


@kernel()
def open_knees(T, legs, soles, stands):
    """Open the knees of one posed body that are bent too far.

    Args:
        T: Poses of all joints, changed in place, shape [n, 4, 4].
        legs: `body.leg_reach.Legs`, f of them.
        soles: `body.feet_pass.Soles`.
        stands: How much each foot stands, 0 to 1, shape [f].
    """
    f = legs.joints.shape[0]
    length, goal, way = np.zeros(f), np.empty((f, 3)), np.empty(3)
    folded = False
    for i in range(f):
        hip, ankle = T[legs.joints[i, 0]], T[legs.joints[i, 2]]
        for k in range(3):
            goal[i, k] = ankle[k, 3]
        length[i], distance = _lengths(T, legs.joints[i])
        more = length[i] - distance
        if more <= 0.0:
            continue
        folded = True
        points = slice(soles.start[i], soles.start[i + 1])
        height = lowest(T, soles.joint[points], soles.offset[points])
        for k in range(3):
            way[k] = (hip[k, 3] - ankle[k, 3]) / max(distance, 1e-9) * (1.0 - stands[i]) * more
        way[2] = min(way[2], max(height, 0.0))
        for k in range(3):
            goal[i, k] -= way[k]
    if not folded:
        return
    moved = False
    for i in range(f):
        moved |= _push_off(T, T[legs.joints[i, 0]], goal[i], length[i])
    for i in range(f):
        if moved or length[i] > 0.0:
            bend_leg(T, legs.joints[i], legs.part[i], legs.hinge[i], goal[i])


@kernel(inner=True)
def _push_off(T, hip, foot, length):
    """Move all joints so that a hip is so far from a foot, never downwards; whether it did."""
    way, distance = np.empty(3), 0.0
    for k in range(3):
        way[k] = hip[k, 3] - foot[k]
        distance += way[k] ** 2
    distance = np.sqrt(distance)
    if distance >= (1.0 - 1e-9) * length:
        return False
    way[2] = max(way[2], 0.0)
    for j in range(T.shape[0]):
        for k in range(3):
            T[j, k, 3] += (length - distance) / max(distance, 1e-9) * way[k]
    return True


@kernel(inner=True)
def _lengths(T, joints):
    """How far hip and ankle are to be apart, 0 where it does not matter, and how far they are."""
    a, b, d = 0.0, 0.0, 0.0
    hip, knee, ankle = T[joints[0]], T[joints[1]], T[joints[2]]
    for k in range(3):
        a += (knee[k, 3] - hip[k, 3]) ** 2
        b += (ankle[k, 3] - knee[k, 3]) ** 2
        d += (ankle[k, 3] - hip[k, 3]) ** 2
    distance, product = np.sqrt(d), 2.0 * np.sqrt(a * b)
    if product < 1e-12:
        return 0.0, distance
    bend = np.pi - np.arccos(min(max((a + b - d) / product, -1.0), 1.0))
    if bend <= FREE:
        return 0.0, distance
    room = MOST - FREE
    bend = FREE + room * np.tanh((bend - FREE) / room)
    return np.sqrt(max(a + b + product * np.cos(bend), 0.0)), distance
