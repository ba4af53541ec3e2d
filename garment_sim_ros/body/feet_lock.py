"""The compiled part of keeping standing soles in place: one posed body, in place.

The part of the sole that bears is held where it was a sample before, so a foot may still roll from
heel to ball. What the foot is then off its way fades when it is let go.
"""

import numpy as np

from garment_sim_ros.body.feet_pass import smooth_step
from garment_sim_ros.body.leg_reach import bend_leg, reachable
from garment_sim_ros.jit import kernel

CLOSED = 0.015
OPENED = 0.05
"""Time in which a sole is held and let go, to a third [s]."""
FADING = 0.12
"""Time in which the way off of a foot that is let go fades to a third [s]."""
MOST = 0.12
"""Longest way off, in lengths of the leg; beyond it soles slip."""
CREEP = 0.004
"""Speed with which the way off shrinks while a foot stands, in lengths of the leg per second."""
CLEAR = (0.01, 0.03)
"""Heights of a sole over the ground from which it is held less, and not at all, likewise."""
BEARING = 0.004
"""Height above the lowest point of a sole at which others bear a third of it [m]."""


@kernel()
def touch(T_source, joint, offset, standing, dt, limits, last, touching):
    """Whether each foot of the source touches the ground, with hysteresis.

    One point of a foot that is low and hardly moves suffices.

    Args:
        T_source: Poses of the source's joints, shape [m, 4, 4].
        joint: Joint of ankle and ball of each foot, -1 where there is none, shape [f, 2].
        offset: Each in its joint's frame [m], shape [f, 2, 3].
        standing: Height of each in a foot that stands [m], shape [f, 2].
        dt: Time since the last call [s]; 0 or below: there is no past.
        limits: Height [m] and speed [m/s] below which a point begins to touch the ground, and
            those above which it ends; depth below the ground from which it is somewhere else [m];
            shape [5].
        last: The points' places at the last call, changed in place [m], shape [f, 2, 3].
        touching: Whether each point touches, 0 or 1, changed in place, shape [f, 2].
    """
    for i in range(joint.shape[0]):
        for p in range(2):
            if joint[i, p] < 0:
                continue
            T, o = T_source[joint[i, p]], offset[i, p]
            way = 0.0
            height = 0.0
            for k in range(3):
                now = T[k, 0] * o[0] + T[k, 1] * o[1] + T[k, 2] * o[2] + T[k, 3]
                way += (now - last[i, p, k]) ** 2
                last[i, p, k] = now
                height = now
            height -= standing[i, p]
            if dt <= 0.0:
                if dt < 0.0:
                    touching[i, p] = 0.0
                continue
            k = 1 if touching[i, p] > 0.0 else 0
            speed = np.sqrt(way) / dt
            here = speed < limits[1 + 2 * k] and -limits[4] < height < limits[2 * k]
            touching[i, p] = 1.0 if here else 0.0


@kernel()
def hold(T, legs, soles, touching, dt, last, lock, off):
    """Hold the soles of feet that touch the ground; let the others go back to their ways.

    Args:
        T: Poses of all joints, changed in place, shape [n, 4, 4]; feet are `off` their ways.
        legs: `Legs`.
        soles: `Soles`.
        touching: Whether ankle and ball touch the ground, 0 or 1, shape [f, 2].
        dt: Time since the last call [s]; below 0: there is no past.
        last: Where the points were at the last call [m], changed in place, shape [p, 2].
        lock: How much each foot is held, 0 to 1, changed in place, shape [f].
        off: Way on the ground that each foot is off [m], changed in place, shape [f, 2].

    Returns:
        How many feet that touch the ground were let slip, for the leg does not reach or the way
        is too long.
    """
    joints, reach = legs.joints, legs.reach
    slipped = 0
    goal, way, new, now = np.empty(3), np.zeros(2), np.zeros(2), np.zeros(2)
    for i in range(joints.shape[0]):
        first, end = soles.start[i], soles.start[i + 1]
        if dt < 0.0:
            lock[i] = off[i, 0] = off[i, 1] = 0.0
        elif dt > 0.0:
            held = max(touching[i, 0], touching[i, 1])
            time = CLOSED if held > 0.0 else OPENED
            lock[i] += (1.0 - np.exp(-dt / time)) * (held - lock[i])
            lowest = np.inf
            for k in range(first, end):
                lowest = min(lowest, _height(T, soles.joint[k], soles.offset[k]))
            holds = lock[i] * (1.0 - smooth_step(CLEAR[0] * reach[i], CLEAR[1] * reach[i], lowest))
            total = 0.0
            way[:] = 0.0
            for k in range(first, end):
                height = _height(T, soles.joint[k], soles.offset[k])
                share = np.exp(-(height - lowest) / BEARING)
                _ground_place(T, soles.joint[k], soles.offset[k], now)
                total += share
                for c in range(2):
                    way[c] += share * (now[c] - last[k, c])
            length = np.sqrt(off[i, 0] ** 2 + off[i, 1] ** 2)
            kept = np.exp(-(1.0 - holds) * dt / FADING)
            kept *= max(1.0 - CREEP * reach[i] * dt / max(length, 1e-9), 0.0)
            for c in range(2):
                new[c] = kept * off[i, c] - holds * way[c] / total
            length = np.sqrt(new[0] ** 2 + new[1] ** 2)
            most = MOST * reach[i]
            slips = length > most
            if slips:
                new *= most / length
            ankle, hip = T[joints[i, 2]], T[joints[i, 0]]
            before = np.sqrt(
                (ankle[0, 3] - hip[0, 3]) ** 2
                + (ankle[1, 3] - hip[1, 3]) ** 2
                + (ankle[2, 3] - hip[2, 3]) ** 2
            )
            for c in range(2):
                goal[c] = ankle[c, 3] + new[c] - off[i, c]
            goal[2] = ankle[2, 3]
            reachable(T, joints[i], reach[i], before, goal)
            bend_leg(T, joints[i], legs.part[i], legs.hinge[i], goal)
            short = 0.0
            for c in range(2):  # what the leg does not reach
                short += (T[joints[i, 2], c, 3] - goal[c]) ** 2
                off[i, c] = new[c] + T[joints[i, 2], c, 3] - goal[c]
            if held > 0.0 and (slips or np.sqrt(short) > 0.001 * reach[i]):
                slipped += 1
        for k in range(first, end):
            _ground_place(T, soles.joint[k], soles.offset[k], last[k])
    return slipped


@kernel(inner=True)
def _height(T, joint, offset):
    R = T[joint]
    return R[2, 0] * offset[0] + R[2, 1] * offset[1] + R[2, 2] * offset[2] + R[2, 3]


@kernel(inner=True)
def _ground_place(T, joint, offset, out):
    R = T[joint]
    for c in range(2):
        out[c] = R[c, 0] * offset[0] + R[c, 1] * offset[1] + R[c, 2] * offset[2] + R[c, 3]
