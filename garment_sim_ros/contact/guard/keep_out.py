"""No limb changes the side of a garment: cores of body parts are kept out of its triangles.

Contact moves particles out of shapes. Between particles, and where shapes press cloth from two
sides, a limb gets through all the same. The guard acts after each search for contacts, on the
triangles that are nearer to the core of a body part than its `radius`. On which side of a core a
triangle is, is remembered from search to search as long as the two are near each other; what
crossed on its way comes back to the side that it came from. A core that is found in a triangle
without having come from anywhere is led out at once if it belongs outside of the cloth. Of cloth
that is worn on it, contact alone brings it out in most cases. A core that stays in cloth is stuck:
what is remembered of the triangles holds them on both sides of it. Their sides are then taken from
their faces: the outer one looks away from what the cloth is worn on, and at what is outside of it.

A limb that the motion presses into another one leaves no place for cloth between the two. The
cloth then stays on the limb: what the other shape does to particles that the guard holds is
undone. So is what the limb's own shape does, where the short way out of it leads through the
core.
"""

import numpy as np

from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.guard.crossing import CROSSED, FOUND_IN, crossing, direction
from garment_sim_ros.contact.guard.guard import TRACK
from garment_sim_ros.contact.guard.near import core, corner, find_near, pose_cores
from garment_sim_ros.contact.guard.nearest import along_segment, way_out
from garment_sim_ros.geometry.vectors import cross, dot, less
from garment_sim_ros.jit import kernel, lean_kernel

_PASSES = 4
_FARTHEST = 0.02
"""Farthest that a triangle is moved in one pass [m]."""
_BUDGET = 0.04
"""Farthest that a particle is moved in a search [m]: it may be a corner of many triangles."""
_CLOSE = 1e-4
"""From the second pass on, a distance that is too short by less is left [m]."""
_PATIENCE = 10
"""Searches with a core in the cloth, less those without, after which it is stuck."""
_NO_PASS = 0.008
"""What particles near a core may move relative to it from search to search, at least [m]."""


@lean_kernel(inner=True)
def _put(x, q, m):
    for axis in range(3):
        x[q, axis] = m[axis]


@lean_kernel(inner=True)
def _slow_down(guard, x_before, x, v, q, c, time):
    """Lets particle q move by the radius of core c at most, relative to it and since last time.

    What is faster is an edge that snaps back, and would be past the core before it is looked at.
    """
    p0, d0 = core(guard.posed[0], c)
    p1, d1 = core(guard.posed[1], c)
    start = corner(x_before, q)
    s, _ = along_segment(p0, d0, start)
    shift = (
        p1[0] + s * d1[0] - p0[0] - s * d0[0],
        p1[1] + s * d1[1] - p0[1] - s * d0[1],
        p1[2] + s * d1[2] - p0[2] - s * d0[2],
    )
    way = less(less(corner(x, q), start), shift)
    length = np.sqrt(dot(way, way))
    longest = max(guard.radius[c], _NO_PASS)
    if length <= longest:
        return
    guard.moved[q] = length - longest
    r, f = longest / length, 1.0 / time
    for axis in range(3):
        x[q, axis] = start[axis] + shift[axis] + r * way[axis]
        v[q, axis] = f * shift[axis] + r * (v[q, axis] - f * shift[axis])


@lean_kernel(inner=True)
def _is_undone(guard, bodies, x_free, q, c, thickness):
    """Whether core c holds particle q against what contact did to it."""
    k = bodies.contacts.shape[q]
    p, d = core(guard.posed[1], c)
    m = corner(x_free, q)
    s, _ = along_segment(p, d, m)
    y = (p[0] + s * d[0], p[1] + s * d[1], p[2] + s * d[2])
    if k == guard.shape[c]:
        return dot(corner(bodies.contacts.normal, q), less(m, y)) < 0.0
    reach = np.float32(guard.radius[c]) + thickness
    distance, _, _, _ = shape_distance(
        bodies.shapes,
        bodies.posed,
        k,
        np.float32(y[0]),
        np.float32(y[1]),
        np.float32(y[2]),
        reach,
    )
    return distance < reach


@lean_kernel(inner=True)
def _let_go(guard, bodies, x_before, x_free, x, v, thickness, time):
    """What the guard held until now: slowed down, freed of what contact did, and let go of."""
    for q in range(guard.kept.size):
        c = guard.kept[q]
        guard.kept[q] = -1
        guard.moved[q] = 0.0
        if c < 0:
            continue
        _slow_down(guard, x_before, x_free, v, q, c, time)
        if bodies.contacts.shape[q] < 0 or _is_undone(guard, bodies, x_free, q, c, thickness):
            bodies.contacts.shape[q] = -1
            for axis in range(3):
                x[q, axis] = x_free[q, axis]


@lean_kernel(inner=True)
def _is_stuck(guard, c, distance):
    """Whether core c has been in the cloth for most of the last searches.

    A search without counts against one with: cloth that flutters is off a core now and then.

    Args:
        guard: `Guard`, of which `stuck` is changed.
        c: A core.
        distance: Its distance to a triangle in this search [m], 0 where it runs through it.
    """
    now = guard.counts[0]
    without = now - 1 - guard.stuck[0, c]
    if distance == 0.0 and without >= 0:
        guard.stuck[1, c] = max(guard.stuck[1, c] - without, 0) + 1
        guard.stuck[0, c] = now
        without = -1
    return guard.stuck[1, c] - max(without, 0) > _PATIENCE


@lean_kernel(inner=True)
def _learn_anew(guard, c, t, m, distance, n):
    """Takes the side of a stuck core's triangle from its faces; what is remembered led nowhere.

    Args:
        guard: `Guard`, changed in place.
        c: A core.
        t: A triangle near it.
        m: The direction to it.
        distance: The distance [m], 0 where the core runs through it.
        n: Normal of the triangle, of any length.
    """
    now = guard.counts[0]
    r = (-1.0 if guard.outside[c, t] else 1.0) / np.sqrt(max(dot(n, n), 1e-30))
    out = (r * n[0], r * n[1], r * n[2])
    if (
        guard.crossed[c, t]
        and guard.seen[c, t] == now - 1
        and dot(corner(guard.side[c], t), out) > 0.0
    ):
        guard.seen[c, t] = now
        return
    guard.crossed[c, t] = distance == 0.0
    if distance == 0.0:
        _put(guard.side[c], t, out)
        guard.counts[3] += 1
    elif dot(m, out) < 0.0:
        return
    else:
        _put(guard.side[c], t, m)
    guard.seen[c, t] = now


@lean_kernel(inner=True)
def _find_side(guard, x_before, x, c, t, m, distance, u, v):
    """Finds, once in a search, on which side of core c triangle t belongs.

    Args:
        guard: `Guard`.
        x_before: Positions at the last search [m], shape [n, 3].
        x: Positions now [m], shape [n, 3].
        c: A core.
        t: A triangle near it.
        m: The direction to it now.
        distance: The distance now [m], 0 where the core runs through it.
        u: From the first corner of the triangle to the second.
        v: To the third.
    """
    now = guard.counts[0]
    n = cross(u, v)
    if _is_stuck(guard, c, distance):
        _learn_anew(guard, c, t, m, distance, n)
        return
    known = guard.seen[c, t] == now - 1
    if known and guard.crossed[c, t]:
        guard.seen[c, t] = now
        return
    guard.crossed[c, t] = False
    # Only where it could have gone through it has to be looked at how it went.
    if known and distance > 0.0 and dot(m, corner(guard.side[c], t)) > 0.0:
        guard.seen[c, t] = now
        return
    came_from, how = crossing(guard, x_before, x, c, t)
    # What is under the cloth has its inner face before it. A triangle that comes with the outer
    # one, or around the core, has no business there: contact gets it away, in most cases.
    outside = guard.outside[c, t]
    strange = how == FOUND_IN or (dot(came_from, n) < 0.0 and not guard.either[c, t])
    if strange and not (known or outside):
        return
    guard.seen[c, t] = now
    if how == CROSSED:
        _put(guard.side[c], t, came_from)
        guard.crossed[c, t] = True
    elif how == FOUND_IN and known and not outside:
        guard.crossed[c, t] = True
    elif how == FOUND_IN and distance == 0.0:
        r = -1.0 / np.sqrt(max(dot(n, n), 1e-30))
        _put(guard.side[c], t, (r * n[0], r * n[1], r * n[2]))
        guard.crossed[c, t] = True
        guard.counts[3] += 1
    else:
        _put(guard.side[c], t, m)


@lean_kernel(inner=True)
def _can_move(guard, q):
    return q < guard.kept.size and guard.moved[q] < _BUDGET


@lean_kernel(inner=True)
def _move(guard, contacts, x, c, t, m, way, g, h, whole):
    """Moves triangle t by `way` along m: all of it, or by weights g and h of its last corners.

    Returns:
        Whether any of it can move.
    """
    f = 1.0 - g - h
    if whole:
        f = g = h = 1.0
    i, j, k = guard.triangles[t, 0], guard.triangles[t, 1], guard.triangles[t, 2]
    f = f if _can_move(guard, i) else 0.0
    g = g if _can_move(guard, j) else 0.0
    h = h if _can_move(guard, k) else 0.0
    total = max(f, max(g, h)) if whole else f * f + g * g + h * h
    if not total > 1e-6:
        return False
    way = min(way, _FARTHEST) / total
    for n in range(3):
        q = guard.triangles[t, n]
        # Where the other corners are pinned, one of little weight would have to go metres.
        own = min(way * (f if n == 0 else (g if n == 1 else h)), _FARTHEST)
        if not own > 0.0:
            continue
        for axis in range(3):
            x[q, axis] += own * m[axis]
            contacts.normal[q, axis] = m[axis]
        contacts.shape[q] = guard.shape[c]
        contacts.depth[q] = own
        contacts.caught[q] = False
        guard.kept[q] = c
        guard.moved[q] += own
    return True


@lean_kernel(inner=True)
def _separate(guard, contacts, x_before, x, attempt):
    """One Gauss-Seidel pass over the pairs; how many triangles were moved."""
    moved = 0
    for n in range(guard.counts[1]):
        c, t = guard.pairs[0, n], guard.pairs[1, n]
        i, j, k = guard.triangles[t, 0], guard.triangles[t, 1], guard.triangles[t, 2]
        p, d = core(guard.posed[1], c)
        a = corner(x, i)
        u, v = less(corner(x, j), a), less(corner(x, k), a)
        m, g, h, distance = direction(p, d, a, u, v)
        owed = guard.crossed[c, t] and guard.seen[c, t] >= guard.counts[0] - 1
        if distance > guard.radius[c] + TRACK and not owed:
            continue
        if attempt == 0 and guard.outside[c, t]:
            for q in (i, j, k):
                if q < guard.kept.size and guard.kept[q] < 0:
                    guard.kept[q] = c
        if guard.seen[c, t] != guard.counts[0]:
            _find_side(guard, x_before, x, c, t, m, distance, u, v)
        if guard.seen[c, t] != guard.counts[0]:
            continue
        side = corner(guard.side[c], t)
        way, whole = guard.radius[c] - distance, False
        if guard.crossed[c, t] and (distance == 0.0 or dot(m, side) <= 0.0):
            out = way_out(p, d, a, u, v, side)
            if out >= 0.0:
                m, way, whole = side, out + guard.radius[c], True
        if not whole:
            guard.crossed[c, t] = False
            if distance == 0.0:
                continue
            _put(guard.side[c], t, m)
        if way > (_CLOSE if attempt else 0.0) and _move(
            guard, contacts, x, c, t, m, way, g, h, whole
        ):
            moved += 1
    return moved


@kernel(inner=True)
def keep_out(guard, bodies, x_before, x_free, x, v, thickness, time):
    """Keeps all cores out of all triangles after a search for contacts.

    Particles that it moves are in contact with the shape of the core from then on.

    Args:
        guard: `contact.guard.guard.Guard`, changed in place.
        bodies: A tuple with packed `shapes`, the same `posed` now, `since` with the way since the
            last search, and `contacts` of the free particles, which are changed in place.
        x_before: Positions at the last search [m], shape [n, 3].
        x_free: Positions now, before contact, changed in place [m], shape [n, 3].
        x: The same after contact, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        thickness: Distance to keep from surfaces [m].
        time: Since the last search [s].

    Returns:
        How many triangles were moved in the first pass.
    """
    guard.counts[0] += 1
    pose_cores(guard, bodies.posed, bodies.since.carry)
    _let_go(guard, bodies, x_before, x_free, x, v, thickness, time)
    guard.counts[1] = find_near(guard, x)
    guard.counts[2] = 0
    for attempt in range(_PASSES):
        moved = _separate(guard, bodies.contacts, x_before, x, attempt)
        if attempt == 0:
            guard.counts[2] = moved
        if moved == 0:
            break
    return guard.counts[2]
