"""Moving particles against moving ellipsoids: the earliest hit decides (Gong et al., 4).

The motion of a particle is met with every ellipsoid, in the space in which that one is the unit
ball, where it is a straight line; of all hits the earliest counts. Nothing depends on the order of
the ellipsoids: ties go to the hit that is smaller in its coordinates.

Particles go in blocks of neighbours: ellipsoids whose box does not touch the block's are rejected
for all of it, the others meet all of it at once (`block_times`).
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.papers.earliest.block import (
    BLOCK,
    END,
    FIRST,
    INSIDE,
    LOWEST,
    MET,
    NEVER,
    START,
    VELOCITY,
    V,
    X,
    block_rows,
    block_times,
    lowest_zeta,
    respond,
)
from garment_sim_ros.contact.papers.earliest.poses import ON_SURFACE, PosedEllipsoids, prepare
from garment_sim_ros.contact.papers.earliest.way_out import leave
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.jit import kernel

RESPONSES = ("surface", "inelastic", "reflection")


def collide_earliest(
    start: PosedEllipsoids,
    end: PosedEllipsoids,
    x_start: FloatArray,
    x: FloatArray,
    velocity: FloatArray,
    dt: float,
    *,
    response: str = "surface",
    restitution: float = 0.0,
    friction: float = 0.3,
) -> IntArray:
    """Moves particles out of ellipsoids after one step.

    A particle that starts inside leaves by the shortest way that does not enter another ellipsoid,
    before its motion is met with the ellipsoids.

    Args:
        start: The ellipsoids when the step starts, inflated by the cloth's thickness.
        end: The same when it ends.
        x_start: Particles at the start [m], shape [n, 3]; neighbours should be near each other.
        x: Proposed positions at the end, corrected in place [m], shape [n, 3].
        velocity: Velocities, corrected in place [m/s], shape [n, 3].
        dt: Duration of the step [s].
        response: ``surface``: by the surface's normal, with restitution and friction, the rest of
            the motion slides; ``inelastic``: the same without either; ``reflection``: equation
            (9), along the ray from the centre, while approaching, and the motion ends at the hit.
        restitution: Share of the normal velocity that is given back.
        friction: Coulomb coefficient.

    Returns:
        The ellipsoid that each particle met, -1 for none, shape [n].

    Raises:
        GeometryError: An unknown response, or arrays that do not fit.
    """
    numbers = response_numbers(response, restitution, friction)
    if len(start.centre) != len(end.centre) or not x_start.shape == x.shape == velocity.shape:
        raise GeometryError("start and end must hold the same ellipsoids and particles")
    hit = np.full(len(x), -1, dtype=np.int32)
    m = len(start.centre)
    if m and len(x):
        meet(start.table(), end.table(), room_for(m), x_start, x, velocity, dt, *numbers, hit)
    return hit


def response_numbers(
    response: str, restitution: float, friction: float
) -> tuple[np.float32, np.float32, np.float32]:
    """A response as `meet` takes it: whether along the ray, restitution, friction.

    Raises:
        GeometryError: An unknown response.
    """
    if response not in RESPONSES:
        raise GeometryError(f"response {response!r}; allowed: {RESPONSES}")
    if response == "inelastic":
        restitution = friction = 0.0
    elif response == "reflection":
        restitution, friction = 1.0, 0.0
    reflect = np.float32(response == "reflection")
    return reflect, np.float32(restitution), np.float32(friction)


def room_for(m: int) -> tuple[NDArray[np.float64 | np.float32 | np.int32], ...]:
    """Scratch of `meet` for m ellipsoids."""
    return (
        np.empty((6, m)),
        np.empty((2, m, 9), np.float32),
        np.empty(m, np.int32),
        np.arange(m, dtype=np.int32),
        block_rows(),
        np.empty(m * BLOCK, np.float32),
        np.empty(m),
        np.empty((2, 3)),
        np.empty(3),
    )


@kernel(inner=True)
def _near_block(x_start, x, begin, stop, box, near, gap, frame, origin):
    """Ellipsoids near the motions of a block's particles.

    Args:
        x_start: Positions at the start [m], shape [n, 3].
        x: Positions at the end [m], shape [n, 3].
        begin: First particle.
        stop: The one after the last.
        box: Boxes around the ellipsoids [m], shape [6, m].
        near: Output, their indices, shape [m].
        gap: Scratch, shape [m].
        frame: Scratch, shape [2, 3].
        origin: Output: the block's centre [m], shape [3].

    Returns:
        How many, and how far away from the block they were looked for [m].
    """
    margin = 0.0
    for r in range(3):
        least = most = x[begin, r]
        for p in range(begin, stop):
            least = min(least, x[p, r], x_start[p, r])
            most = max(most, x[p, r], x_start[p, r])
        origin[r] = 0.5 * (np.float64(least) + most)
        frame[0, r] = least
        frame[1, r] = most
        margin = max(margin, np.float64(most) - least)
    # Room for a way out that does not lead past the shapes of this block.
    margin = 0.004 + 0.125 * margin
    ax, ay, az = frame[0, 0] - margin, frame[0, 1] - margin, frame[0, 2] - margin
    bx, by, bz = frame[1, 0] + margin, frame[1, 1] + margin, frame[1, 2] + margin
    m = box.shape[1]
    for k in range(m):
        apart = max(ax - box[3, k], ay - box[4, k], az - box[5, k])
        beyond = max(box[0, k] - bx, box[1, k] - by, box[2, k] - bz)
        gap[k] = max(apart, beyond)
    found = 0
    for k in range(m):
        near[found] = k
        found += 1 if gap[k] <= 0.0 else 0
    return found, margin


@kernel()
def meet(start, end, scratch, x_start, x, velocity, dt, reflect, restitution, friction, hit):
    """See `collide_earliest`; poses as of `PosedEllipsoids.table`, scratch of `room_for`.

    Returns:
        Number of particles that met an ellipsoid.
    """
    box, single, near, everything, rows, time, gap, frame, origin = scratch
    prepare(start, box, single[0], True)
    prepare(end, box, single[1], False)
    m = start.shape[0]
    rate = np.float32(1.0 / dt)
    count = 0
    for begin in range(0, x.shape[0], BLOCK):
        stop = min(begin + BLOCK, x.shape[0])
        for p in range(begin, stop):
            hit[p] = -1
        found, margin = _near_block(x_start, x, begin, stop, box, near, gap, frame, origin)
        if found == 0:
            continue
        for i in range(BLOCK):
            p = min(begin + i, stop - 1)
            for r in range(3):
                rows[START + r * BLOCK + i] = x_start[p, r] - origin[r]
                rows[END + r * BLOCK + i] = x[p, r] - origin[r]
                rows[VELOCITY + r * BLOCK + i] = velocity[p, r]
        asked = near
        block_times(start, end, single, asked, found, origin, rows, time)
        earliest = NEVER
        for i in range(BLOCK):
            earliest = min(earliest, rows[FIRST + i])
        if earliest == NEVER:
            continue
        if earliest == INSIDE:
            if _let_out(start, everything, origin, rows) > margin:
                asked = everything
                found = m
            block_times(start, end, single, asked, found, origin, rows, time)
        respond(
            start,
            end,
            single,
            asked,
            found,
            origin,
            rows,
            time,
            rate,
            reflect,
            restitution,
            friction,
        )
        lowest_zeta(end, single, asked, found, origin, rows)
        for i in range(stop - begin):
            p = begin + i
            k = int(rows[MET + i])
            if k < 0 and rows[FIRST + i] != INSIDE:
                continue
            wx = origin[0] + rows[X + i]
            wy = origin[1] + rows[X + BLOCK + i]
            wz = origin[2] + rows[X + 2 * BLOCK + i]
            if rows[LOWEST + i] < 1.0 - ON_SURFACE:
                wx, wy, wz, left = leave(end, asked, found, wx, wy, wz)
                k = left if k < 0 else k
            if max(abs(wx - x[p, 0]), abs(wy - x[p, 1]), abs(wz - x[p, 2])) > margin:
                wx, wy, wz, _ = leave(end, everything, m, wx, wy, wz)
            x[p, 0], x[p, 1], x[p, 2] = wx, wy, wz
            for r in range(3):
                velocity[p, r] = rows[V + r * BLOCK + i]
            hit[p] = k
            count += 1 if k >= 0 else 0
    return count


@kernel(inner=True)
def _let_out(start, everything, origin, rows):
    """Lets those of a block that start inside begin where they leave the ellipsoids.

    Returns:
        How far one went at most [m].
    """
    farthest = 0.0
    for i in range(BLOCK):
        if rows[FIRST + i] == INSIDE:
            px = origin[0] + rows[START + i]
            py = origin[1] + rows[START + BLOCK + i]
            pz = origin[2] + rows[START + 2 * BLOCK + i]
            wx, wy, wz, _ = leave(start, everything, start.shape[0], px, py, pz)
            rows[START + i] = wx - origin[0]
            rows[START + BLOCK + i] = wy - origin[1]
            rows[START + 2 * BLOCK + i] = wz - origin[2]
            farthest = max(farthest, abs(wx - px), abs(wy - py), abs(wz - pz))
    return farthest
