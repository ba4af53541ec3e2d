"""The compiled part of grounding feet: one posed body, both legs, in place.

Every function works on `T_world_joint`, poses of all joints, shape [n, 4, 4].
"""

import numpy as np

from garment_sim_ros.jit import kernel

THIGH = 0
SHANK = 1
FOOT = 2
"""What joints of a leg move with; joints of no leg have -1."""

_STRAIGHT = 0.9995
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
def _move(T, R, before, after):
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
    longest = min(max(_LONG * reach, before + _ROOM * reach), _STRAIGHT * reach)
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
    reached = min(max(d, abs(a - b) + 1e-6), _STRAIGHT * (a + b))
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
            _move(T[j], leg_turn, hip, hip)
        elif part[j] == SHANK:
            _move(T[j], both, knee, new_knee)
        elif part[j] == FOOT:
            for k in range(3):
                T[j, k, 3] += shift[k]


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
            _move(T[j], turn, place, place)


@kernel()
def ground(
    T, legs, part, hinge, ahead, reach, weight, place, sole_joint, sole_offset, sole_start
):  # fmt: skip
    """Put feet on the ground where they stand, and keep others out of it.

    The root goes the mean way of the feet that stand, and down where a leg does not reach; what
    is left each leg does by itself.

    Args:
        T: Poses of all joints, changed in place, shape [n, 4, 4].
        legs: Upper leg, lower leg and foot of each leg, shape [f, 3].
        part: What each joint moves with, for each leg, shape [f, n].
        hinge: Axis of each knee in the upper leg's frame, shape [f, 3].
        ahead: Forward in each foot's frame, when it stands flat, shape [f, 3].
        reach: Length of each leg, thigh and shank [m], shape [f].
        weight: How much each foot stands, is kept out of the ground, leads the root, and points,
            0 to 1, shape [f, 4].
        place: Way on the ground that each ankle is off where it shall be [m], shape [f, 2].
        sole_joint: Joint of each point of the soles, shape [p].
        sole_offset: That point in the joint's frame [m], shape [p, 3].
        sole_start: First point of each foot, and the end, shape [f + 1].
    """
    f = legs.shape[0]
    down = np.zeros(f)
    standing = 0.0
    none = 1.0
    most = 1e-9
    for i in range(f):
        points = slice(sole_start[i], sole_start[i + 1])
        down[i] = lowest(T, sole_joint[points], sole_offset[points])
        standing += weight[i, 2] ** 2
        none *= 1.0 - weight[i, 2]
    if standing > 0.0:
        shift = 0.0
        for i in range(f):
            shift -= (1.0 - none) * weight[i, 2] ** 2 / standing * down[i]
        # Legs that would have to be longer than they are take the root down with them.
        more = 0.0
        for i in range(f):
            hip, ankle = T[legs[i, 0]], T[legs[i, 2]]
            x = ankle[0, 3] + place[i, 0] - hip[0, 3]
            y = ankle[1, 3] + place[i, 1] - hip[1, 3]
            z = hip[2, 3] + shift - (ankle[2, 3] - weight[i, 0] * down[i])
            length = _STRAIGHT * reach[i]
            high = np.sqrt(max(length * length - x * x - y * y, 0.0))
            hard = _HARD * reach[i]
            excess = (z - high) / hard
            wish = excess if excess > 30.0 else np.log1p(np.exp(excess))
            more = max(more, weight[i, 2] ** 2 * hard * wish)
        # Not far: rather a foot that points than a body that bobs.
        for i in range(f):
            most = max(most, _DIP * reach[i])
        shift -= most * np.tanh(more / most)
        for j in range(T.shape[0]):
            T[j, 2, 3] += shift
        for i in range(f):
            down[i] += shift
    goal = np.empty(3)
    for i in range(f):
        up = -weight[i, 0] * down[i]
        if up < 0.0:  # a foot that rolls off is not pulled far: its knee would snap when let go
            most = reach[i] * (_PULL + weight[i, 2] ** 4)
            up = -most * np.tanh(-up / most)
        left = down[i] + up
        if left < 0.0:
            up -= weight[i, 1] * left
        ankle = T[legs[i, 2]]
        goal[0] = ankle[0, 3] + place[i, 0]
        goal[1] = ankle[1, 3] + place[i, 1]
        goal[2] = ankle[2, 3] + up
        hip = T[legs[i, 0]]
        before = np.sqrt(
            (ankle[0, 3] - hip[0, 3]) ** 2
            + (ankle[1, 3] - hip[1, 3]) ** 2
            + (ankle[2, 3] - hip[2, 3]) ** 2
        )
        reachable(T, legs[i], reach[i], before, goal)
        bend_leg(T, legs[i], part[i], hinge[i], goal)
        points = slice(sole_start[i], sole_start[i + 1])
        _point_foot(
            T, legs[i, 2], part[i], ahead[i], reach[i], weight[i, 3],
            sole_joint[points], sole_offset[points],
        )  # fmt: skip
