"""A block of neighbouring particles against ellipsoids, several at once.

In single precision about the block's centre, whose place among the ellipsoids is known in double
precision: what is left to add is small. All numbers of a block are rows of one flat array, so that
the compiler knows that they do not overlap, and no loop branches.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.contact.papers.earliest.poses import ON_SURFACE, to_ball
from garment_sim_ros.jit import kernel

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


@kernel(inner=True)
def _origin_of(table, k, origin):
    """Where the block's centre is among the coordinates of ellipsoid k's unit ball."""
    x, y, z = to_ball(table, k, origin[0], origin[1], origin[2])
    return np.float32(x), np.float32(y), np.float32(z)


@kernel(inner=True)
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
        ax, ay, az = _origin_of(start, k, origin)
        bx, by, bz = _origin_of(end, k, origin)
        a00, a01, a02 = single[0, k, 0], single[0, k, 1], single[0, k, 2]
        a10, a11, a12 = single[0, k, 3], single[0, k, 4], single[0, k, 5]
        a20, a21, a22 = single[0, k, 6], single[0, k, 7], single[0, k, 8]
        b00, b01, b02 = single[1, k, 0], single[1, k, 1], single[1, k, 2]
        b10, b11, b12 = single[1, k, 3], single[1, k, 4], single[1, k, 5]
        b20, b21, b22 = single[1, k, 6], single[1, k, 7], single[1, k, 8]
        base = c * BLOCK
        for p in range(BLOCK):
            x, y, z = rows[START + p], rows[START + BLOCK + p], rows[START + 2 * BLOCK + p]
            px = ax + a00 * x + a01 * y + a02 * z
            py = ay + a10 * x + a11 * y + a12 * z
            pz = az + a20 * x + a21 * y + a22 * z
            x, y, z = rows[END + p], rows[END + BLOCK + p], rows[END + 2 * BLOCK + p]
            dx = bx + b00 * x + b01 * y + b02 * z - px
            dy = by + b10 * x + b11 * y + b12 * z - py
            dz = bz + b20 * x + b21 * y + b22 * z - pz
            along = px * dx + py * dy + pz * dz
            outside = px * px + py * py + pz * pz - _ONE
            squared = dx * dx + dy * dy + dz * dz
            above = max(outside, _ZERO)
            root = along * along - squared * above
            # Without cancellation where the start is close to the surface.
            t = above / max(np.sqrt(max(root, _ZERO)) - along, _TINY)
            t = t if max(max(along + _TINY, -root), t - _ONE) <= _ZERO else NEVER
            t = INSIDE if outside < _ON_SURFACE else t
            time[base + p] = t
            rows[FIRST + p] = min(rows[FIRST + p], t)


@kernel(inner=True)
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
        hits = _ZERO
        for p in range(BLOCK):
            t = time[base + p]
            hits += _ONE if max(abs(t - rows[FIRST + p]), abs(t) - _ONE) <= _ZERO else _ZERO
        if hits == _ZERO:
            continue
        k = near[c]
        number = np.float32(k)
        ax, ay, az = _origin_of(start, k, origin)
        bx, by, bz = _origin_of(end, k, origin)
        a00, a01, a02 = single[0, k, 0], single[0, k, 1], single[0, k, 2]
        a10, a11, a12 = single[0, k, 3], single[0, k, 4], single[0, k, 5]
        a20, a21, a22 = single[0, k, 6], single[0, k, 7], single[0, k, 8]
        b00, b01, b02 = single[1, k, 0], single[1, k, 1], single[1, k, 2]
        b10, b11, b12 = single[1, k, 3], single[1, k, 4], single[1, k, 5]
        b20, b21, b22 = single[1, k, 6], single[1, k, 7], single[1, k, 8]
        # Back from the ball by the transpose, after the squared radii.
        sx = np.float32(start[k, 12] ** 2)
        sy = np.float32(start[k, 13] ** 2)
        sz = np.float32(start[k, 14] ** 2)
        ex = np.float32(end[k, 12] ** 2)
        ey = np.float32(end[k, 13] ** 2)
        ez = np.float32(end[k, 14] ** 2)
        ox = np.float32(start[k, 0] - origin[0])
        oy = np.float32(start[k, 1] - origin[1])
        oz = np.float32(start[k, 2] - origin[2])
        mx = np.float32(end[k, 0] - origin[0])
        my = np.float32(end[k, 1] - origin[1])
        mz = np.float32(end[k, 2] - origin[2])
        for p in range(BLOCK):
            t = time[base + p]
            x, y, z = rows[START + p], rows[START + BLOCK + p], rows[START + 2 * BLOCK + p]
            fx, fy, fz = rows[END + p], rows[END + BLOCK + p], rows[END + 2 * BLOCK + p]
            hx = ax + a00 * x + a01 * y + a02 * z
            hy = ay + a10 * x + a11 * y + a12 * z
            hz = az + a20 * x + a21 * y + a22 * z
            hx += t * (bx + b00 * fx + b01 * fy + b02 * fz - hx)
            hy += t * (by + b10 * fx + b11 * fy + b12 * fz - hy)
            hz += t * (bz + b20 * fx + b21 * fy + b22 * fz - hz)
            # Onto the surface, for what rounding has left.
            back = _ONE / np.sqrt(hx * hx + hy * hy + hz * hz + _TINY)
            hx, hy, hz = hx * back, hy * back, hz * back
            # The hit moves with the ellipsoid from where it was to the end of the step.
            x, y, z = hx * sx, hy * sy, hz * sz
            qx = ox + a00 * x + a10 * y + a20 * z
            qy = oy + a01 * x + a11 * y + a21 * z
            qz = oz + a02 * x + a12 * y + a22 * z
            x, y, z = hx * ex, hy * ey, hz * ez
            gx = b00 * x + b10 * y + b20 * z
            gy = b01 * x + b11 * y + b21 * z
            gz = b02 * x + b12 * y + b22 * z
            wx, wy, wz = mx + gx, my + gy, mz + gz
            nx = b00 * hx + b10 * hy + b20 * hz
            ny = b01 * hx + b11 * hy + b21 * hz
            nz = b02 * hx + b12 * hy + b22 * hz
            nx = nx + reflect * (gx - nx)
            ny = ny + reflect * (gy - ny)
            nz = nz + reflect * (gz - nz)
            back = _ONE / np.sqrt(nx * nx + ny * ny + nz * nz + _TINY)
            nx, ny, nz = nx * back, ny * back, nz * back
            # Velocity relative to the surface.
            vx, vy, vz = (wx - qx) * rate, (wy - qy) * rate, (wz - qz) * rate
            ux = rows[VELOCITY + p] - vx
            uy = rows[VELOCITY + BLOCK + p] - vy
            uz = rows[VELOCITY + 2 * BLOCK + p] - vz
            along = ux * nx + uy * ny + uz * nz
            ux, uy, uz = ux - along * nx, uy - along * ny, uz - along * nz
            lost = friction * (_ONE + restitution) * max(-along, _ZERO)
            slip = np.sqrt(ux * ux + uy * uy + uz * uz)
            kept = max(_ZERO, _ONE - lost / max(slip, _TINY))
            along = max(along, -restitution * along)
            vx += kept * ux + along * nx
            vy += kept * uy + along * ny
            vz += kept * uz + along * nz
            # The rest of the motion, along the surface.
            rx, ry, rz = fx - wx, fy - wy, fz - wz
            depth = rx * nx + ry * ny + rz * nz
            rx, ry, rz = rx - depth * nx, ry - depth * ny, rz - depth * nz
            slip = np.sqrt(rx * rx + ry * ry + rz * rz)
            kept = max(_ZERO, _ONE - friction * max(-depth, _ZERO) / max(slip, _TINY))
            kept *= _ONE - reflect
            # Whether this hit comes before one at the same time.
            dx = wx - rows[HIT + p]
            dy = wy - rows[HIT + BLOCK + p]
            dz = wz - rows[HIT + 2 * BLOCK + p]
            dy = dy if dx == _ZERO else dx
            dz = dz if dy == _ZERO else dy
            late = dz if rows[MET + p] >= _ZERO else -_ONE
            other = max(abs(t - rows[FIRST + p]), abs(t) - _ONE)
            takes = max(late, other) <= _ZERO if t >= _ZERO else False
            rows[HIT + p] = wx if takes else rows[HIT + p]
            rows[HIT + BLOCK + p] = wy if takes else rows[HIT + BLOCK + p]
            rows[HIT + 2 * BLOCK + p] = wz if takes else rows[HIT + 2 * BLOCK + p]
            rows[X + p] = wx + kept * rx if takes else rows[X + p]
            rows[X + BLOCK + p] = wy + kept * ry if takes else rows[X + BLOCK + p]
            rows[X + 2 * BLOCK + p] = wz + kept * rz if takes else rows[X + 2 * BLOCK + p]
            rows[V + p] = vx if takes else rows[V + p]
            rows[V + BLOCK + p] = vy if takes else rows[V + BLOCK + p]
            rows[V + 2 * BLOCK + p] = vz if takes else rows[V + 2 * BLOCK + p]
            rows[MET + p] = number if takes else rows[MET + p]


@kernel(inner=True)
def lowest_zeta(end, single, near, found, origin, rows):
    """Least zeta of the positions `X` over the near ellipsoids; fills the row `LOWEST`.

    Arguments as those of `block_times`.
    """
    for p in range(BLOCK):
        rows[LOWEST + p] = np.float32(np.inf)
    for c in range(found):
        k = near[c]
        bx, by, bz = _origin_of(end, k, origin)
        b00, b01, b02 = single[1, k, 0], single[1, k, 1], single[1, k, 2]
        b10, b11, b12 = single[1, k, 3], single[1, k, 4], single[1, k, 5]
        b20, b21, b22 = single[1, k, 6], single[1, k, 7], single[1, k, 8]
        for p in range(BLOCK):
            x, y, z = rows[X + p], rows[X + BLOCK + p], rows[X + 2 * BLOCK + p]
            px = bx + b00 * x + b01 * y + b02 * z
            py = by + b10 * x + b11 * y + b12 * z
            pz = bz + b20 * x + b21 * y + b22 * z
            rows[LOWEST + p] = min(rows[LOWEST + p], px * px + py * py + pz * pz)
