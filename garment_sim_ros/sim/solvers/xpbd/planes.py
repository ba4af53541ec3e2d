"""Contact between two searches: against the tangent planes where particles touched.

A search (`contact.collide`) costs more than the rest of a sub-step. Between two of them a
particle that was in contact meets the plane through its place, across the normal found there,
moving on as the shape moved. On the outside of a round shape the plane lies outside of it: a
particle that slides lifts off by a few micrometres, and the next search puts it back.

A search moves particles out along the normal where they are. Pulled deep into a round shape, as by
edges of a pin in it, that is not where they touched: what moves them out also moves them sideways,
which is work from nowhere. They come back to their planes first; without friction in loose cloth,
which is pulled so only where it began in a shape and has to get free of it.
"""

import numpy as np

from garment_sim_ros.jit import kernel

_SHALLOW = np.float32(0.02)
"""Up to this depth, in inscribed radii of a shape, the normal is that of the surface above."""
_NEAR = np.float32(0.25)
"""Farthest that pressed particles are pulled before a search, in inscribed radii."""


@kernel(forceinline=True)
def remember_planes(x, x_start, planes, carry):
    """Keeps where particles touch and how the shape moves there.

    Args:
        x: Positions after the search [m], shape [n, 3].
        x_start: Positions at the start of that sub-step [m], shape [n, 3].
        planes: `Planes`; output, places and how far they move.
        carry: How points move with the shapes in a sub-step, see `PosedShapes`, shape [m, 3, 4].
    """
    shape, place = planes.shape, planes.place
    for p in range(shape.size):
        c = shape[p]
        if c >= 0:
            for k in range(3):
                place[p, k] = x[p, k]
    follow_shapes(x_start, shape, carry, planes.shift)


@kernel(inner=True)
def follow_shapes(x, shape, carry, shift):
    """How far the planes of particles at x move in a sub-step.

    Shapes change their motion from one step to the next.

    Args:
        x: Positions at the start of the sub-step [m], shape [n, 3].
        shape: Shape that each touches, -1 for none, shape [n].
        carry: As in `remember_planes`.
        shift: Output, how far the plane moves [m], shape [n, 3].
    """
    for p in range(shape.size):
        c = shape[p]
        if c >= 0:
            for k in range(3):
                shift[p, k] = (
                    carry[c, k, 0] * x[p, 0]
                    + carry[c, k, 1] * x[p, 1]
                    + carry[c, k, 2] * x[p, 2]
                    + carry[c, k, 3]
                )


@kernel(forceinline=True)
def touch_planes(x, v, x_start, planes, friction, dt):
    """Contact with the planes: friction and inelastic, as `contact.collide.collide` has it.

    A particle that shapes press from two sides has no slip.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities that led there, changed in place [m/s], shape [n, 3].
        x_start: Positions at the start of the sub-step [m], shape [n, 3].
        planes: `Planes`; places are moved on in place.
        friction: Coulomb coefficient.
        dt: Sub-step [s].
    """
    shape, normal, pressed = planes.shape, planes.normal, planes.depth
    place, shift = planes.place, planes.shift
    zero = np.float32(0.0)
    rate = np.float32(1.0) / dt
    for p in range(shape.size):
        if shape[p] < 0:
            continue
        nx = normal[p, 0]
        ny = normal[p, 1]
        nz = normal[p, 2]
        rx = shift[p, 0]
        ry = shift[p, 1]
        rz = shift[p, 2]
        place[p, 0] += rx
        place[p, 1] += ry
        place[p, 2] += rz
        if pressed[p] == np.float32(np.inf):
            x[p, 0] = x_start[p, 0] + rx
            x[p, 1] = x_start[p, 1] + ry
            x[p, 2] = x_start[p, 2] + rz
            v[p, 0] = rx * rate
            v[p, 1] = ry * rate
            v[p, 2] = rz * rate
            continue
        depth = (
            (place[p, 0] - x[p, 0]) * nx
            + (place[p, 1] - x[p, 1]) * ny
            + (place[p, 2] - x[p, 2]) * nz
        )
        if depth > zero:
            _lift(x, v, x_start, p, depth, (nx, ny, nz), (rx, ry, rz), friction, rate)


@kernel(forceinline=True)
def return_to_planes(x, v, x_start, planes, inscribed_radius, friction, dt):
    """Contact with the planes before a search, of what is deep below them; it stays shallow there.

    What shapes press from two sides is left to the search.

    Args:
        x: As in `touch_planes`, as all but two of the others.
        v: Likewise.
        x_start: Likewise.
        planes: `Planes`, which are not moved on.
        inscribed_radius: Of each shape, see `contact.sweep.Sweep` [m], shape [m].
        friction: As in `touch_planes`.
        dt: Likewise.
    """
    shape, normal, pressed = planes.shape, planes.normal, planes.depth
    place, shift = planes.place, planes.shift
    zero = np.float32(0.0)
    rate = np.float32(1.0) / dt
    for p in range(shape.size):
        c = shape[p]
        if c < 0:
            continue
        nx = normal[p, 0]
        ny = normal[p, 1]
        nz = normal[p, 2]
        rx = shift[p, 0]
        ry = shift[p, 1]
        rz = shift[p, 2]
        if pressed[p] == np.float32(np.inf):
            _stay_near(x, v, x_start, p, (rx, ry, rz), _NEAR * inscribed_radius[c], rate)
            continue
        depth = (
            (place[p, 0] + rx - x[p, 0]) * nx
            + (place[p, 1] + ry - x[p, 1]) * ny
            + (place[p, 2] + rz - x[p, 2]) * nz
        ) - _SHALLOW * inscribed_radius[c]
        if depth > zero:
            _lift(x, v, x_start, p, depth, (nx, ny, nz), (rx, ry, rz), friction, rate)


@kernel(inner=True)
def _stay_near(x, v, x_start, p, r, farthest, rate):
    """Moves particle p back to within `farthest` of its place on a surface that moves by r."""
    wx = x[p, 0] - x_start[p, 0] - r[0]
    wy = x[p, 1] - x_start[p, 1] - r[1]
    wz = x[p, 2] - x_start[p, 2] - r[2]
    length = np.sqrt(wx * wx + wy * wy + wz * wz)
    if not length > farthest:
        return
    back = farthest / length - np.float32(1.0)
    x[p, 0] += back * wx
    x[p, 1] += back * wy
    x[p, 2] += back * wz
    v[p, 0] += back * wx * rate
    v[p, 1] += back * wy * rate
    v[p, 2] += back * wz * rate


@kernel(inner=True)
def _lift(x, v, x_start, p, depth, n, r, friction, rate):
    """Moves particle p out by `depth` along n, with friction, at a surface that moves by r."""
    zero = np.float32(0.0)
    nx, ny, nz = n
    rx, ry, rz = r
    ux = x[p, 0] - x_start[p, 0] - rx
    uy = x[p, 1] - x_start[p, 1] - ry
    uz = x[p, 2] - x_start[p, 2] - rz
    along = ux * nx + uy * ny + uz * nz
    ux -= along * nx
    uy -= along * ny
    uz -= along * nz
    slip = np.sqrt(ux * ux + uy * uy + uz * uz)
    limit = friction * depth
    held = np.float32(1.0) if slip <= limit else limit / slip
    ux = depth * nx - held * ux
    uy = depth * ny - held * uy
    uz = depth * nz - held * uz
    x[p, 0] += ux
    x[p, 1] += uy
    x[p, 2] += uz
    vx = v[p, 0] + ux * rate
    vy = v[p, 1] + uy * rate
    vz = v[p, 2] + uz * rate
    leaving = (vx - rx * rate) * nx + (vy - ry * rate) * ny + (vz - rz * rate) * nz
    leaving = max(leaving, zero)
    v[p, 0] = vx - leaving * nx
    v[p, 1] = vy - leaving * ny
    v[p, 2] = vz - leaving * nz


@kernel(forceinline=True)
def stop_at_contacts(x, v, x_start, x_before, planes, carry, friction, dt, motion):
    """Velocities after a search: none into a shape, and less slip, by Coulomb's law.

    Being moved out of a shape changes no velocity. A particle that could not go straight out is
    pinched between shapes, and goes with the deepest.

    Args:
        x: Positions after the search [m], shape [n, 3].
        v: Velocities before contact, changed in place [m/s], shape [n, 3].
        x_start: Positions at the start of the sub-step [m], shape [n, 3].
        x_before: Positions before the search [m], shape [n, 3].
        planes: `Planes`; of them what the search found.
        carry: How points move with the shapes in a sub-step, see `PosedShapes`, shape [m, 3, 4].
        friction: Coulomb coefficient.
        dt: Sub-step [s].
        motion: Output, sum and maximum of squared speeds [m^2/s^2], shape [2].
    """
    shape, normal, depth = planes.shape, planes.normal, planes.depth
    zero = np.float32(0.0)
    rate = np.float32(1.0) / dt
    total = 0.0
    fastest = zero
    for p in range(shape.size):
        c = shape[p]
        vx = v[p, 0]
        vy = v[p, 1]
        vz = v[p, 2]
        if c >= 0:
            sx = x_start[p, 0]
            sy = x_start[p, 1]
            sz = x_start[p, 2]
            nx = normal[p, 0]
            ny = normal[p, 1]
            nz = normal[p, 2]
            ux = vx - rate * (
                carry[c, 0, 0] * sx + carry[c, 0, 1] * sy + carry[c, 0, 2] * sz + carry[c, 0, 3]
            )
            uy = vy - rate * (
                carry[c, 1, 0] * sx + carry[c, 1, 1] * sy + carry[c, 1, 2] * sz + carry[c, 1, 3]
            )
            uz = vz - rate * (
                carry[c, 2, 0] * sx + carry[c, 2, 1] * sy + carry[c, 2, 2] * sz + carry[c, 2, 3]
            )
            out = (
                (x[p, 0] - x_before[p, 0]) * nx
                + (x[p, 1] - x_before[p, 1]) * ny
                + (x[p, 2] - x_before[p, 2]) * nz
            )
            along = ux * nx + uy * ny + uz * nz
            if out < np.float32(0.5) * depth[p]:
                vx -= ux
                vy -= uy
                vz -= uz
                v[p, 0] = vx
                v[p, 1] = vy
                v[p, 2] = vz
            elif along < zero:
                ux -= along * nx
                uy -= along * ny
                uz -= along * nz
                slip = np.sqrt(ux * ux + uy * uy + uz * uz)
                limit = -friction * along
                held = np.float32(1.0) if slip <= limit else limit / slip
                vx -= along * nx + held * ux
                vy -= along * ny + held * uy
                vz -= along * nz + held * uz
                v[p, 0] = vx
                v[p, 1] = vy
                v[p, 2] = vz
        speed = vx * vx + vy * vy + vz * vz
        total += speed
        fastest = max(fastest, speed)
    motion[0] = total
    motion[1] = fastest
