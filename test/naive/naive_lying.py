"""Bodies on the ground and hands out of it again, point by point."""

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray
from naive.naive_feet import bend_leg, point, step


def height(T, joints, offsets) -> float:
    """Of the lowest of some points."""
    return min((point(T[j], x)[2] for j, x in zip(joints, offsets)), default=np.inf)


def _parts(parts):
    for r, (a, b) in enumerate(zip(parts.start[:-1], parts.start[1:])):
        yield r, parts.joint[a:b], parts.offset[a:b]


def _source(T_source, parts, part, scale, limits):
    """Height of the source's joints, to scale, and how much it is not far below the ground."""
    joint = scale * T_source[parts.source[part], 2, 3].mean()
    return joint, 1.0 - step(0.5 * limits[2], limits[2], -joint)


def look(T_source, T, parts, scale, limits):
    """See `lying.look`; returns the heights as well."""
    heights, upper = [], [0.0]
    for r, *points in _parts(parts):
        flesh = T[parts.target[r], 2, 3].mean() - height(T, *points)
        joint, there = _source(T_source, parts, r, scale, limits)
        heights.append(joint - min(flesh, limits[3]))
        if parts.upper[r]:
            upper.append(there * (1.0 - step(limits[0], limits[4], heights[-1])))
    return max(upper), np.array(heights)


def rest(T_source, T, parts, legs, soles, stands, scale, limits, heights, turned):
    """See `lying.rest`; returns the new poses and how far the body went up."""
    low = {r: height(T, *points) for r, *points in _parts(parts)}
    there = {r: _source(T_source, parts, r, scale, limits)[1] for r in low}
    shift = max(-there[r] * low[r] for r in low)
    if shift <= 0.0:
        least, ways = min(low.values()), [0.0]
        for r, h in enumerate(heights):
            goal = max(h, 0.0) * step(limits[0], limits[1], h)
            far = limits[4]
            if not parts.knee[r]:
                far += max(stands[:, 0]) * (limits[1] - limits[4])
            near = there[r] * (1.0 - step(limits[0], far, h))
            ways.append(near * min(goal - least, 0.0))
        shift = min(ways)
    free = stands.copy()
    for i, joints in enumerate(legs.joints):
        for r in np.flatnonzero(parts.knee):
            if parts.target[r, 0] == joints[1] and shift > 0.0:
                free[i, 0] *= 1.0 - max(-low[r], 0.0) / max(shift, -low[r])
    if shift == 0.0 and not turned:
        return T, 0.0
    T = T.copy()
    T[:, 2, 3] += shift
    for i, joints in enumerate(legs.joints):
        points = slice(soles.start[i], soles.start[i + 1])
        under = max(0.0, -height(T, soles.joint[points], soles.offset[points]))
        goal = T[joints[2], :3, 3].copy()
        stays, kept_out = free[i]
        goal[2] += (1.0 - stays) * kept_out * under - stays * shift
        T = bend_leg(T, joints, legs.part[i], legs.hinge[i], goal)
    return T, shift


def lift_arms(T_source, T, arms, scale, deep) -> FloatArray:
    """See `hands.lift_arms`."""
    for i, joints in enumerate(arms.joints):
        there = 1.0 - step(0.5 * deep, deep, -scale * T_source[arms.source[i], 2, 3])
        fore, palm = (slice(*arms.start[2 * i + k : 2 * i + k + 2]) for k in range(2))
        sinks = np.clip(-height(T, arms.joint[palm], arms.offset[palm]) / 0.01, 0.0, 1.0)
        under = max(
            -height(T, arms.joint[fore], arms.offset[fore]),
            sinks * (arms.palm[i] - T[joints[2], 2, 3]),
        )
        under *= there
        if under > 0.0:
            goal = T[joints[2], :3, 3] + [0.0, 0.0, under]
            T = bend_leg(T, joints, arms.part[i], arms.hinge[i], goal)
        if there * height(T, arms.joint[palm], arms.offset[palm]) < -0.002:
            T = T.copy()
            hand = T[joints[2]].copy()

            def low(angle, hand=hand, axis=arms.wrist[i], points=arms.offset[palm]):
                turned = Rotation.from_rotvec(angle * axis).apply(points)
                return min(point(hand, x)[2] for x in turned) + 0.002

            down = hand[2, :3] @ arms.back[i]
            way = 1.0 if down > -0.3 else -1.0
            much = (1.0 - step(0.5, 0.85, abs(hand[2, :3] @ arms.wrist[i]))) * step(
                0.0, 0.1, abs(down + 0.3)
            )
            coarse = way * np.radians(np.arange(0.0, 101.0, 5.0))
            clear = [k for k in range(1, len(coarse)) if low(coarse[k]) >= 0.0]
            if clear:
                a, b = coarse[clear[0] - 1], coarse[clear[0]]
                angle = a + np.clip(low(a) / (low(a) - low(b)), 0.0, 1.0) * (b - a)
            else:
                angle = max(coarse, key=low)
            angle *= much
            R = hand[:3, :3] @ Rotation.from_rotvec(there * angle * arms.wrist[i]).as_matrix()
            turn = R @ hand[:3, :3].T
            for j in np.flatnonzero(arms.part[i] == 2):
                T[j, :3, 3] = hand[:3, 3] + turn @ (T[j, :3, 3] - hand[:3, 3])
                T[j, :3, :3] = turn @ T[j, :3, :3]
            under = -there * height(T, arms.joint[palm], arms.offset[palm]) - 0.002
            if under > 0.0:
                goal = T[joints[2], :3, 3] + [0.0, 0.0, under]
                T = bend_leg(T, joints, arms.part[i], arms.hinge[i], goal)
    return T
