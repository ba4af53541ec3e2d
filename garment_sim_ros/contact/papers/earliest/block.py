"""A block of neighbouring particles against ellipsoids, several at once.

In single precision about the block's centre, whose place among the ellipsoids is known in double
precision: what is left to add is small. All numbers of a block are rows of one flat array, so that
the compiler knows that they do not overlap, and no loop branches.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.contact.papers.earliest.poses import ON_SURFACE, to_ball
from garment_sim_ros.geometry.vectors import along, dot, length, less, plus
from garment_sim_ros.jit import lean_kernel

_Vector = tuple[np.float32, np.float32, np.float32]

BLOCK = 16
NEVER = np.float32(2.0)
"""The time of no hit."""
INSIDE = np.float32(-1.0)
"""The time of a particle that starts inside."""
START, END, VELOCITY, HIT, X, V, FIRST, MET, LOWEST = (
    BLOCK * row for row in (0, 3, 6, 9, 12, 15, 18, 19, 20)
)
"""Where the rows begin: starts and ends of the motions [m] and velocities [m/s] as proposed (three
rows each); hits, positions and velocities after them; time of the hit; index of the ellipsoid or
-1; least zeta."""
_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_TINY = np.float32(1e-30)
_ON_SURFACE = np.float32(-ON_SURFACE)


def block_rows() -> NDArray[np.float32]:
    """Room for the rows of a block."""
    return np.zeros(21 * BLOCK, np.float32)


@lean_kernel(inner=True)
def _origin_of(table, k, origin):
    """Where the block's centre is among the coordinates of ellipsoid k's unit ball."""
    x, y, z = to_ball(table, k, origin[0], origin[1], origin[2])
    return np.float32(x), np.float32(y), np.float32(z)


@lean_kernel(inner=True)
def _matrix(single, k):
    """The map of ellipsoid k to its unit ball: three rows."""
    m = single[k]
    return (m[0], m[1], m[2]), (m[3], m[4], m[5]), (m[6], m[7], m[8])


@lean_kernel(inner=True)
def _to_ball(origin, A, v):
    """Where v is in the unit ball's coordinates, in which the block's centre is at `origin`."""
    return (
        origin[0] + A[0][0] * v[0] + A[0][1] * v[1] + A[0][2] * v[2],
        origin[1] + A[1][0] * v[0] + A[1][1] * v[1] + A[1][2] * v[2],
        origin[2] + A[2][0] * v[0] + A[2][1] * v[1] + A[2][2] * v[2],
    )


@lean_kernel(inner=True)
def _from_ball(A, v):
    """A direction back from the ball: the transpose times v."""
    return (
        A[0][0] * v[0] + A[1][0] * v[1] + A[2][0] * v[2],
        A[0][1] * v[0] + A[1][1] * v[1] + A[2][1] * v[2],
        A[0][2] * v[0] + A[1][2] * v[1] + A[2][2] * v[2],
    )


@lean_kernel(inner=True)
def _get(rows, at, p):
    """Lane p of a vector of the block, whose rows begin at `at`."""
    return rows[at + p], rows[at + BLOCK + p], rows[at + 2 * BLOCK + p]


@lean_kernel(inner=True)
def _put(rows, at, p, takes, v):
    """Writes a vector to lane p of the block where it takes it."""
    rows[at + p] = v[0] if takes else rows[at + p]
    rows[at + BLOCK + p] = v[1] if takes else rows[at + BLOCK + p]
    rows[at + 2 * BLOCK + p] = v[2] if takes else rows[at + 2 * BLOCK + p]


@lean_kernel(inner=True)
def block_times(start, end, single, near, found, origin, rows, time):
    """When each particle meets each near ellipsoid, from 0 to 1; fills the row `FIRST`.

    Args:
        start: The ellipsoids when the step starts, see `PosedEllipsoids.table`.
        end: The same when it ends.
        single: Their maps, see `prepare`, shape [2, m, 9].
        near: Indices of the ellipsoids to ask.
        found: How many of those.
        origin: The block's centre [m], shape [3].
        rows: The block.
        time: Output: times, `NEVER` or `INSIDE`, flat, shape [at least found * BLOCK].
    """
    for p in range(BLOCK):
        rows[FIRST + p] = NEVER
    for c in range(found):
        k = near[c]
        from_start, from_end = _origin_of(start, k, origin), _origin_of(end, k, origin)
        a, b = _matrix(single[0], k), _matrix(single[1], k)
        base = c * BLOCK
        for p in range(BLOCK):
            q = _to_ball(from_start, a, _get(rows, START, p))
            d = less(_to_ball(from_end, b, _get(rows, END, p)), q)
            along = dot(q, d)
            outside = dot(q, q) - _ONE
            squared = dot(d, d)
            above = max(outside, _ZERO)
            root = along * along - squared * above
            # Without cancellation where the start is close to the surface.
            t = above / max(np.sqrt(max(root, _ZERO)) - along, _TINY)
            t = t if max(max(along + _TINY, -root), t - _ONE) <= _ZERO else NEVER
            t = INSIDE if outside < _ON_SURFACE else t
            time[base + p] = t
            rows[FIRST + p] = min(rows[FIRST + p], t)


class _Hit(NamedTuple):
    """A hit on an ellipsoid.

    Attributes:
        before: Where the place on the surface was when the step started, about the block's centre
            [m].
        after: Where it is when it ends [m].
        normal: Unit direction of the response.
    """

    before: _Vector
    after: _Vector
    normal: _Vector


@lean_kernel(inner=True)
def _squared_radii(table, k):
    """Of ellipsoid k [m^2]."""
    row = table[k]
    return np.float32(row[12] ** 2), np.float32(row[13] ** 2), np.float32(row[14] ** 2)


@lean_kernel(inner=True)
def _centre(table, k, origin):
    """Of ellipsoid k about the block's centre [m]."""
    row = table[k]
    return (
        np.float32(row[0] - origin[0]),
        np.float32(row[1] - origin[1]),
        np.float32(row[2] - origin[2]),
    )


@lean_kernel(inner=True)
def _scaled(v, w):
    """Products of the coordinates."""
    return v[0] * w[0], v[1] * w[1], v[2] * w[2]


@lean_kernel(inner=True)
def _unit(v):
    back = _ONE / np.sqrt(dot(v, v) + _TINY)
    return v[0] * back, v[1] * back, v[2] * back


@lean_kernel(inner=True)
def _hit(start, end, a, b, q, t, f, reflect):
    """Where a particle hits an ellipsoid.

    Args:
        start: Squared radii and centre of the ellipsoid when the step starts.
        end: The same when it ends.
        a: Its map to the unit ball when the step starts.
        b: The same when it ends.
        q: Where the particle starts, in the unit ball's coordinates.
        t: When it hits.
        f: Where it ends there.
        reflect: See `respond`.
    """
    # Onto the surface, for what rounding has left.
    h = _unit(along(q, less(f, q), t))
    # The hit moves with the ellipsoid from where it was to the end of the step. Back from the ball
    # by the transpose, after the squared radii.
    before = plus(start[1], _from_ball(a, _scaled(h, start[0])))
    ray = _from_ball(b, _scaled(h, end[0]))
    normal = _from_ball(b, h)
    normal = along(normal, less(ray, normal), reflect)
    return _Hit(before, plus(end[1], ray), _unit(normal))


@lean_kernel(inner=True)
def _rebound(hit, velocity, rate, restitution, friction):
    """Velocity after a hit [m/s].

    Args:
        hit: `_Hit`.
        velocity: As proposed [m/s].
        rate: See `respond`.
        restitution: Likewise.
        friction: Likewise.
    """
    n = hit.normal
    way = less(hit.after, hit.before)
    surface = way[0] * rate, way[1] * rate, way[2] * rate
    u = less(velocity, surface)
    towards = dot(u, n)
    u = along(u, n, -towards)
    lost = friction * (_ONE + restitution) * max(-towards, _ZERO)
    kept = max(_ZERO, _ONE - lost / max(length(u), _TINY))
    towards = max(towards, -restitution * towards)
    return (
        surface[0] + (kept * u[0] + towards * n[0]),
        surface[1] + (kept * u[1] + towards * n[1]),
        surface[2] + (kept * u[2] + towards * n[2]),
    )


@lean_kernel(inner=True)
def _slide(hit, goal, reflect, friction):
    """Where the rest of the motion, along the surface, ends.

    Args:
        hit: `_Hit`.
        goal: Where the particle was to end, about the block's centre [m].
        reflect: See `respond`.
        friction: Likewise.
    """
    rest = less(goal, hit.after)
    depth = dot(rest, hit.normal)
    rest = along(rest, hit.normal, -depth)
    kept = max(_ZERO, _ONE - friction * max(-depth, _ZERO) / max(length(rest), _TINY))
    return along(hit.after, rest, kept * (_ONE - reflect))


@lean_kernel(inner=True)
def _takes(rows, p, t, place):
    """Whether a hit is a particle's earliest one, and before another one at the same time."""
    d = less(place, _get(rows, HIT, p))
    dy = d[1] if d[0] == _ZERO else d[0]
    dz = d[2] if dy == _ZERO else dy
    late = dz if rows[MET + p] >= _ZERO else -_ONE
    other = max(abs(t - rows[FIRST + p]), abs(t) - _ONE)
    return max(late, other) <= _ZERO if t >= _ZERO else False


@lean_kernel(inner=True)
def _hits_first(rows, time, base):
    """Whether an ellipsoid, whose times begin at base, is any particle's earliest hit."""
    hits = _ZERO
    for p in range(BLOCK):
        t = time[base + p]
        hits += _ONE if max(abs(t - rows[FIRST + p]), abs(t) - _ONE) <= _ZERO else _ZERO
    return hits != _ZERO


@lean_kernel(inner=True)
def respond(
    start, end, single, near, found, origin, rows, time, rate, reflect, restitution, friction
):
    """Positions and velocities after the earliest hits; fills the rows `HIT`, `X`, `V`, `MET`.

    Of hits at the same time the one counts that is smaller in its coordinates.

    Args:
        start: See `block_times`, as those up to `time`.
        end: See `start`.
        single: See `start`.
        near: See `start`.
        found: See `start`.
        origin: See `start`.
        rows: The block.
        time: What `block_times` made.
        rate: One over the duration of the step [1/s].
        reflect: 1 for equation (9), along the ray from the centre; 0 for the surface's normal.
        restitution: Share of the normal velocity that is given back.
        friction: Coulomb coefficient.
    """
    for p in range(3 * BLOCK):
        rows[X + p] = rows[END + p]
        rows[V + p] = rows[VELOCITY + p]
    for p in range(BLOCK):
        rows[MET + p] = -_ONE
    for c in range(found):
        base = c * BLOCK
        if not _hits_first(rows, time, base):
            continue
        k = near[c]
        number = np.float32(k)
        from_start, from_end = _origin_of(start, k, origin), _origin_of(end, k, origin)
        a, b = _matrix(single[0], k), _matrix(single[1], k)
        before = _squared_radii(start, k), _centre(start, k, origin)
        after = _squared_radii(end, k), _centre(end, k, origin)
        for p in range(BLOCK):
            t = time[base + p]
            goal = _get(rows, END, p)
            q = _to_ball(from_start, a, _get(rows, START, p))
            hit = _hit(before, after, a, b, q, t, _to_ball(from_end, b, goal), reflect)
            v = _rebound(hit, _get(rows, VELOCITY, p), rate, restitution, friction)
            x = _slide(hit, goal, reflect, friction)
            takes = _takes(rows, p, t, hit.after)
            _put(rows, HIT, p, takes, hit.after)
            _put(rows, X, p, takes, x)
            _put(rows, V, p, takes, v)
            rows[MET + p] = number if takes else rows[MET + p]


@lean_kernel(inner=True)
def lowest_zeta(end, single, near, found, origin, rows):
    """Least zeta of the positions `X` over the near ellipsoids; fills the row `LOWEST`.

    Arguments as those of `block_times`.
    """
    for p in range(BLOCK):
        rows[LOWEST + p] = np.float32(np.inf)
    for c in range(found):
        k = near[c]
        from_end, b = _origin_of(end, k, origin), _matrix(single[1], k)
        for p in range(BLOCK):
            q = _to_ball(from_end, b, _get(rows, X, p))
            rows[LOWEST + p] = min(rows[LOWEST + p], dot(q, q))
