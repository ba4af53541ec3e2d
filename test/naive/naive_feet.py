"""Grounding of feet again, by rotation objects and one joint at a time."""

import itertools

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray


def unit(v: FloatArray) -> FloatArray:
    """At length 1."""
    return v / np.linalg.norm(v)


def arc(a: FloatArray, b: FloatArray) -> Rotation:
    """The smallest rotation from one direction to another."""
    axis = np.cross(a, b)
    length = np.linalg.norm(axis)
    if length < 1e-15:
        return Rotation.identity()
    return Rotation.from_rotvec(axis / length * np.arctan2(length, a @ b))


def step(low: float, high: float, value: float) -> float:
    """0 up to low, 1 from high."""
    s = float(np.clip((value - low) / (high - low), 0.0, 1.0))
    return 3.0 * s**2 - 2.0 * s**3


def point(T: FloatArray, offset: FloatArray) -> FloatArray:
    """A point fixed to a joint, in the world."""
    return T[:3, :3] @ offset + T[:3, 3]


def bend_leg(T, joints, part, hinge, goal):
    """See `feet_pass.bend_leg`; returns the new poses."""
    T = T.copy()
    hip, knee, ankle = (T[j, :3, 3].copy() for j in joints)
    a, b = np.linalg.norm(knee - hip), np.linalg.norm(ankle - knee)
    d = np.linalg.norm(goal - hip)
    u = unit(knee - hip)
    axis = np.cross(knee - hip, ankle - knee) + 0.3 * a * b * T[joints[0], :3, :3] @ hinge
    axis = unit(axis - (axis @ u) * u)
    reached = np.clip(d, abs(a - b) + 1e-6, 0.9995 * (a + b))
    bend = np.arccos(np.clip((reached**2 - a**2 - b**2) / (2 * a * b), -1.0, 1.0))
    bent = Rotation.from_rotvec(bend * axis).apply(u)
    leg = arc(unit(a * u + b * bent), unit(goal - hip))
    shank = leg * arc(unit(ankle - knee), bent)
    new_knee = hip + leg.apply(a * u)
    new_ankle = new_knee + b * leg.apply(bent)
    for j, p in enumerate(part):
        R, x = Rotation.from_matrix(T[j, :3, :3]), T[j, :3, 3].copy()
        if p == 0:
            T[j, :3, :3], T[j, :3, 3] = (leg * R).as_matrix(), hip + leg.apply(x - hip)
        elif p == 1:
            T[j, :3, :3] = (shank * R).as_matrix()
            T[j, :3, 3] = new_knee + shank.apply(x - knee)
        elif p == 2:
            T[j, :3, 3] = x + new_ankle - ankle
    return T


def open_knees(T, legs, soles, stands):
    """See `knees.open_knees`; returns the new poses."""
    T = T.copy()
    places = T[legs.joints][:, :, :3, 3]
    lengths, goals = [], []
    for i, (hip, knee, ankle) in enumerate(places):
        a, b, d = (np.linalg.norm(v) for v in (knee - hip, ankle - knee, ankle - hip))
        bend = np.degrees(np.pi - np.arccos((a**2 + b**2 - d**2) / (2 * a * b)))
        length, goal = 0.0, ankle.copy()
        if bend > 135.0:
            inner = np.pi - np.radians(135.0 + 5.0 * np.tanh((bend - 135.0) / 5.0))
            length = np.sqrt(a**2 + b**2 - 2 * a * b * np.cos(inner))
            points = range(soles.start[i], soles.start[i + 1])
            height = min(point(T[soles.joint[p]], soles.offset[p])[2] for p in points)
            away = (1.0 - stands[i]) * (length - d) * unit(ankle - hip)
            goal += [*away[:2], max(away[2], -max(height, 0.0))]
        lengths.append(length)
        goals.append(goal)
    if not any(lengths):
        return T
    start = T.copy()
    for i, (length, goal) in enumerate(zip(lengths, goals)):
        way = T[legs.joints[i, 0], :3, 3] - goal
        more = length / np.linalg.norm(way) - 1.0
        if more > 1e-9:
            T[:, :3, 3] += more * np.array([*way[:2], max(way[2], 0.0)])
    moved = (start != T).any()
    for i, goal in enumerate(goals):
        if moved or lengths[i]:
            T = bend_leg(T, legs.joints[i], legs.part[i], legs.hinge[i], goal)
    return T


def reachable(T, joints, reach, before, goal):
    """See `feet_pass.reachable`; returns the new goal."""
    away = goal - T[joints[0], :3, 3]
    longest = min(max(0.985 * reach, before + 0.006 * reach), 0.9995 * reach)
    free = min(max(before, 0.97 * reach), longest - 1e-6)
    wanted = np.linalg.norm(away)
    if wanted <= free or away[2] >= 0.0:
        return goal
    length = free + (longest - free) * np.tanh((wanted - free) / (longest - free))
    rest = length**2 - away[0] ** 2 - away[1] ** 2
    if rest <= 0.0:
        return goal
    return T[joints[0], :3, 3] + [away[0], away[1], max(away[2], -np.sqrt(rest))]


def touch(T_source, joint, offset, standing, dt, limits, last, touching):
    """See `feet_lock.touch`; returns the points' places and which touch."""
    last, touching = last.copy(), touching.copy()
    for i, p in np.ndindex(joint.shape):
        if joint[i, p] < 0:
            continue
        now = point(T_source[joint[i, p]], offset[i, p])
        height = now[2] - standing[i, p]
        if dt < 0.0:
            touching[i, p] = 0.0
        elif dt > 0.0:
            low, slow = limits[2:4] if touching[i, p] else limits[:2]
            speed = np.linalg.norm(now - last[i, p]) / dt
            touching[i, p] = float(-limits[4] < height < low and speed < slow)
        last[i, p] = now
    return last, touching


def hold(
    T, legs, part, hinge, reach, touching, dt, sole_joint, sole_offset, sole_start, last, lock, off
):
    """See `feet_lock.hold`; returns the new poses, places, locks, ways off, and count."""
    T, last, lock, off = T.copy(), last.copy(), lock.copy(), off.copy()
    slipped = 0
    for i, leg in enumerate(legs):
        points = range(sole_start[i], sole_start[i + 1])
        if dt < 0.0:
            lock[i], off[i] = 0.0, 0.0
        elif dt > 0.0:
            held = touching[i].max()
            kept = np.exp(-dt / (0.015 if held else 0.05))
            lock[i] = kept * lock[i] + (1.0 - kept) * held
            now = np.array([point(T[sole_joint[k]], sole_offset[k]) for k in points])
            lowest = now[:, 2].min()
            holds = lock[i] * (1.0 - step(0.01 * reach[i], 0.03 * reach[i], lowest))
            share = np.exp(-(now[:, 2] - lowest) / 0.004)
            way = share @ (now[:, :2] - last[points]) / share.sum()
            length = max(np.linalg.norm(off[i]), 1e-9)
            shrink = max(1.0 - 0.004 * reach[i] * dt / length, 0.0)
            new = shrink * np.exp(-(1.0 - holds) * dt / 0.12) * off[i] - holds * way
            slips = np.linalg.norm(new) > 0.12 * reach[i]
            if slips:
                new = 0.12 * reach[i] * unit(new)
            ankle, hip = T[leg[2], :3, 3], T[leg[0], :3, 3]
            goal = ankle + np.append(new - off[i], 0.0)
            goal = reachable(T, leg, reach[i], np.linalg.norm(ankle - hip), goal)
            T = bend_leg(T, leg, part[i], hinge[i], goal)
            missing = (T[leg[2], :3, 3] - goal)[:2]
            off[i] = new + missing
            slipped += bool(held and (slips or np.linalg.norm(missing) > 0.001 * reach[i]))
        for k in points:
            last[k] = point(T[sole_joint[k]], sole_offset[k])[:2]
    return T, last, lock, off, slipped


def watch(T_source, joint, offset, standing, dt, limits, before, faded):
    """See `feet_pass.watch`; returns past, faded weights, weights and depths."""
    before, faded = before.copy(), faded.copy()
    weight, depth = np.zeros(len(joint)), np.zeros(len(joint))
    for p, j in enumerate(joint):
        if j < 0:
            continue
        kept = 0.0 if dt < 0.0 else np.exp(-dt / limits[5])
        now = point(T_source[j], offset[p])
        before[p] = kept * before[p] + (1.0 - kept) * now
        behind = limits[5] if dt <= 0.0 else dt * kept / (1.0 - kept)
        speed = np.linalg.norm(now - before[p]) / behind
        height = now[2] - standing[p]
        depth[p] = 1.0 - step(0.5 * limits[4], limits[4], -height)
        low = 1.0 - step(limits[0], limits[1], height)
        stands = depth[p] * low * (1.0 - step(limits[2], limits[3], speed))
        faded[p] = kept * faded[p] + (1.0 - kept) * stands
        lifted = step(limits[1], 2.0 * limits[1], height)
        weight[p] = step(0.0, 1.0, faded[p]) * (1.0 - lifted)
    return before, faded, weight, depth


def missed(T_source, T, joint, offset, foot, target_offset, ahead, stretch, scale, weight):
    """See `feet_pass.missed`; returns the ways."""
    place = np.zeros((len(joint), 2))
    for i in range(len(joint)):
        shares = weight[i] + [1e-3, 0.0]
        shares /= shares.sum()
        forward = (T[foot[i], :3, :3] @ ahead[i])[:2]
        forward = forward / max(np.linalg.norm(forward), 0.2)
        left = np.array([-forward[1], forward[0]])
        for p in range(2):
            if joint[i, p] < 0:
                continue
            wanted = scale * point(T_source[joint[i, p]], offset[i, p])[:2]
            if p == 1:
                wanted += stretch[i, 0] * forward + stretch[i, 1] * left
            place[i] += shares[p] * (wanted - point(T[foot[i]], target_offset[i, p])[:2])
    return place


def ground(T, legs, part, hinge, ahead, reach, weight, place, sole_joint, sole_offset, sole_start):
    """See `feet_pass.ground`; returns the new poses."""
    T = T.copy()
    down = []
    for first, last in itertools.pairwise(sole_start):
        down.append(min(point(T[sole_joint[k]], sole_offset[k])[2] for k in range(first, last)))
    down = np.array(down)
    w, lead = weight[:, 0], weight[:, 2]
    if (lead > 0.0).any():
        shift = -(1.0 - np.prod(1.0 - lead)) * (lead**2 * down).sum() / (lead**2).sum()
        deepest = 0.0
        for i, (upper, _, foot) in enumerate(legs):
            goal = T[foot, :3, 3] + [*place[i], -w[i] * down[i]]
            away = goal - T[upper, :3, 3]
            length = 0.9995 * reach[i]
            high = np.sqrt(max(length**2 - away[0] ** 2 - away[1] ** 2, 0.0))
            soft = 0.001 * reach[i]
            excess = shift - away[2] - high
            deepest = max(deepest, lead[i] ** 2 * soft * np.logaddexp(0.0, excess / soft))
        shift -= 0.02 * max(reach) * np.tanh(deepest / (0.02 * max(reach)))
        T[:, 2, 3] += shift
        down += shift
    for i, leg in enumerate(legs):
        up = -w[i] * down[i]
        if up < 0.0:
            most = reach[i] * (0.03 + lead[i] ** 4)
            up = most * np.tanh(up / most)
        up -= weight[i, 1] * min(down[i] + up, 0.0)
        before = np.linalg.norm(T[leg[2], :3, 3] - T[leg[0], :3, 3])
        goal = reachable(T, leg, reach[i], before, T[leg[2], :3, 3] + [*place[i], up])
        T = bend_leg(T, leg, part[i], hinge[i], goal)
        ankle = T[leg[2]].copy()
        forward = (ankle[:3, :3] @ ahead[i]) * [1.0, 1.0, 0.0]
        level = np.linalg.norm(forward)
        forward /= max(level, 0.2)
        points = range(sole_start[i], sole_start[i + 1])
        lowest = min((point(T[sole_joint[k]], sole_offset[k]) for k in points), key=lambda x: x[2])
        if lowest[2] <= 0.0 or weight[i, 3] <= 0.0 or forward @ forward < 0.25:
            continue
        lever = forward @ (lowest - ankle[:3, 3])
        pointing = weight[i, 3] * step(0.35, 0.85, level)
        angle = pointing * lowest[2] * lever / (lever**2 + (0.05 * reach[i]) ** 2)
        axis = unit(np.cross([0.0, 0.0, 1.0], forward))
        turn = Rotation.from_rotvec(0.5 * np.tanh(angle / 0.5) * axis)
        for j in np.flatnonzero(part[i] == 2):
            T[j, :3, :3] = turn.as_matrix() @ T[j, :3, :3]
            T[j, :3, 3] = ankle[:3, 3] + turn.apply(T[j, :3, 3] - ankle[:3, 3])
    return T
