"""Continuous collision detection (CCD): particles against the motion of shapes in a step.

Contact looks at where particles and shapes are at the end of a step. A shape that moved by more
than it is thick may then be on the other side of the cloth already, or so deep in it that the
short way out is the wrong one. Here the way of a particle relative to a shape is followed from its
start, in steps as long as its distance (sphere tracing, Hart 1996); where it enters the shape, and
goes far enough inside for the short way out to be in doubt, it ends just under the surface where
it came in, and moves with it from there: an impact is inelastic in every direction, or else cloth
slips off a thin limb before its neighbours are moving. Contact then does the rest. All that this
asks of a shape is a distance.

Only pairs are followed where the shape moved by more than a part of its own inscribed radius in
the step, or the particle would have, coasting at its speed past the shape. What only its
neighbours pull through a slow shape was on the wrong side of it: stopped, it would stay there, and
stretched, for good. Whether there are such pairs is known from the shapes' motion and a bound for
each block of particles, so that steps without fast limbs cost next to nothing.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.packed import PackedShapes
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.contact.sides import UNDER
from garment_sim_ros.geometry.four import (
    each_number,
    higher_four,
    lower_four,
    same_four,
    squares,
    three_at,
)
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.jit import lean_kernel

_THREE = np.uint64(3)
_SHORT = 0.5
"""Ways of less than this, in inscribed radii, end on the side where they began."""
_UNDER_SURFACE = 0.25
"""How deep a particle is left at most, in inscribed radii."""
_TRACING_STEPS = 64
_SHORTEST_STEP = 0.2
"""Shortest step of tracing, in inscribed radii: what dips in by less is left to contact."""
_ENTRIES = 4
"""Shapes that one particle is stopped by in a step, at most."""
_THINNEST = np.float32(1e-3)
"""Least inscribed radius that is believed, as a share of the longest shape."""


class Sweep(NamedTuple):
    """What `sweep` needs beside the shapes.

    Attributes:
        inscribed_radius: Radius of a ball that fits into each shape [m], shape [m].
        fast: Scratch: fast shapes, then those of them that are near a block, shape [2 m + 2].
        spread: Scratch: how differently the points of a fast shape move, shape [m + 1].
    """

    inscribed_radius: SingleArray
    fast: NDArray[np.int32]
    spread: SingleArray

    @classmethod
    def of(cls, colliders: ColliderSet, shapes: PackedShapes) -> "Sweep":
        """For the shapes of a set."""
        met = (colliders.colliders[i] for i in shapes.collider)
        radii = [c.shape.inscribed_radius(c.geometry) for c in met if c.shape is not None]
        m = len(radii)
        return cls(
            inscribed_radius=np.maximum(np.array(radii, np.float32), _THINNEST * shapes.longest),
            fast=np.zeros(2 * m + 2, np.int32),
            spread=np.zeros(m + 1, np.float32),
        )


@lean_kernel(inner=True)
def _enters(shapes, posed, k, qx, qy, qz, rx, ry, rz, length, inner, thickness):
    """Where the way from q along r enters shape k, inflated by `thickness`.

    Returns:
        Part of the way, 2 where it does not enter; and the unit direction out of the shape there.
    """
    zero = np.float32(0.0)
    shortest = max(np.float32(_SHORTEST_STEP) * inner, length * np.float32(1.0 / _TRACING_STEPS))
    gone = zero
    for step in range(_TRACING_STEPS + 1):
        t = gone / length
        d, nx, ny, nz = shape_distance(
            shapes, posed, k, qx + t * rx, qy + t * ry, qz + t * rz, length - gone + thickness
        )
        d -= thickness
        if d <= zero:
            if step == 0 and d < np.float32(-_SHORT) * inner:
                break  # It was inside: no side to keep.
            if rx * nx + ry * ny + rz * nz < zero:
                return t, nx, ny, nz
        gone += max(d, shortest)
        if not gone < length:
            break
    return np.float32(2.0), zero, zero, zero


@lean_kernel(inner=True)
def _way(start, end, p):
    """How far particle p goes; flat arrays."""
    i = _THREE * np.uint64(p)
    return three_at(end, i) - three_at(start, i)


@lean_kernel(inner=True)
def _find_fast(posed, way, x_start, x_coast, thickness):
    """Finds the shapes that particles may pass through, or that may pass them; their number."""
    zero = np.float32(0.0)
    half = np.float32(0.5)
    start, coast = x_start.reshape(-1), x_coast.reshape(-1)
    longest = same_four(zero)
    n = x_start.shape[0]
    for p in range(0, n, 4):
        a = _way(start, coast, p)
        b = _way(start, coast, min(p + 1, n - 1))
        c = _way(start, coast, min(p + 2, n - 1))
        d = _way(start, coast, min(p + 3, n - 1))
        longest = higher_four(squares(a, b, c, d), longest)
    a, b, c, d = each_number(longest)
    fastest = np.sqrt(max(max(a, b), max(c, d)))
    count = 0
    for k in range(posed.box.shape[0]):
        cx = half * (posed.box[k, 0] + posed.box[k, 3])
        cy = half * (posed.box[k, 1] + posed.box[k, 4])
        cz = half * (posed.box[k, 2] + posed.box[k, 5])
        hx = posed.box[k, 3] - cx
        hy = posed.box[k, 4] - cy
        hz = posed.box[k, 5] - cz
        turn = zero
        moved = zero
        for r in range(3):
            a = posed.carry[k, r, 0]
            b = posed.carry[k, r, 1]
            c = posed.carry[k, r, 2]
            turn += a * a + b * b + c * c
            w = a * cx + b * cy + c * cz + posed.carry[k, r, 3]
            moved += w * w
        turn = np.sqrt(turn)
        moved = np.sqrt(moved) + turn * np.sqrt(hx * hx + hy * hy + hz * hz)
        way.fast[count] = k
        way.spread[count] = turn
        inner = way.inscribed_radius[k] + thickness
        count += 1 if moved + fastest > np.float32(_SHORT) * inner else 0
    return count


@lean_kernel(inner=True)
def _find_near(posed, way, x, x_start, x_coast, thickness, begin, end, count):
    """Finds those of the fast shapes that are near a block of particles; their number.

    Args:
        posed: Shapes, posed at the end.
        way: See `Sweep`; its first `count` shapes are fast, those near are put behind them.
        x: See `sweep`.
        x_start: See `sweep`.
        x_coast: See `sweep`.
        thickness: See `sweep`.
        begin: First particle of the block.
        end: One past its last.
        count: Number of fast shapes.
    """
    half = np.float32(0.5)
    first = posed.box.shape[0] + 1
    at, start, coast = x.reshape(-1), x_start.reshape(-1), x_coast.reshape(-1)
    low = low_start = low_way = same_four(np.float32(np.inf))
    high = high_start = high_way = same_four(np.float32(-np.inf))
    for p in range(begin, end):
        i = _THREE * np.uint64(p)
        place, before, way_on = three_at(at, i), three_at(start, i), _way(start, coast, p)
        low, high = lower_four(place, low), higher_four(place, high)
        low_start, high_start = lower_four(before, low_start), higher_four(before, high_start)
        low_way, high_way = lower_four(way_on, low_way), higher_four(way_on, high_way)
    (ax, ay, az, _), (bx, by, bz, _) = each_number(low), each_number(high)
    (mx, my, mz, _), (sx, sy, sz, _) = each_number(low_start), each_number(high_start)
    (lx, ly, lz, _), (hx, hy, hz, _) = each_number(low_way), each_number(high_way)
    cx = half * (mx + sx)
    cy = half * (my + sy)
    cz = half * (mz + sz)
    radius = np.sqrt((sx - cx) ** 2 + (sy - cy) ** 2 + (sz - cz) ** 2)
    near = np.int64(0)  # typed: `_stop` would else be compiled for 0, too
    for n in range(count):
        k = way.fast[n]
        slack = way.spread[n] * radius
        wx = (
            posed.carry[k, 0, 0] * cx
            + posed.carry[k, 0, 1] * cy
            + posed.carry[k, 0, 2] * cz
            + posed.carry[k, 0, 3]
        )
        wy = (
            posed.carry[k, 1, 0] * cx
            + posed.carry[k, 1, 1] * cy
            + posed.carry[k, 1, 2] * cz
            + posed.carry[k, 1, 3]
        )
        wz = (
            posed.carry[k, 2, 0] * cx
            + posed.carry[k, 2, 1] * cy
            + posed.carry[k, 2, 2] * cz
            + posed.carry[k, 2, 3]
        )
        ux = max(hx - wx, wx - lx)
        uy = max(hy - wy, wy - ly)
        uz = max(hz - wz, wz - lz)
        margin = thickness + slack
        far = max(ux * ux + uy * uy + uz * uz, wx * wx + wy * wy + wz * wz)
        here = (
            (np.sqrt(far) + slack > np.float32(_SHORT) * (way.inscribed_radius[k] + thickness))
            & (posed.box[k, 0] - margin <= max(bx, sx + wx))
            & (posed.box[k, 3] + margin >= min(ax, mx + wx))
            & (posed.box[k, 1] - margin <= max(by, sy + wy))
            & (posed.box[k, 4] + margin >= min(ay, my + wy))
            & (posed.box[k, 2] - margin <= max(bz, sz + wz))
            & (posed.box[k, 5] + margin >= min(az, mz + wz))
        )
        way.fast[first + near] = k
        near += 1 if here else 0
    return near


@lean_kernel(forceinline=True)
def sweep(shapes, posed, side, way, x, x_start, x_coast, thickness):
    """Stops particles where they entered a shape that they, or it, would pass through.

    Args:
        shapes: Packed shapes.
        posed: The same, posed at the end, their `carry` from when the particles were at `x_start`.
        side: See `Sides`; only shapes under a particle stop it.
        way: See `Sweep`.
        x: Proposed positions, corrected in place [m], shape [n, 3].
        x_start: Where the particles came from [m], shape [n, 3].
        x_coast: Where they would be if their neighbours did not pull at them [m], shape [n, 3].
        thickness: Distance to keep from the surfaces [m].

    Returns:
        Number of particles stopped.
    """
    count = _find_fast(posed, way, x_start, x_coast, thickness)
    if count == 0:
        return 0
    stopped = 0
    first = posed.box.shape[0] + 1
    for begin in range(0, x.shape[0], BLOCK):
        end = min(begin + BLOCK, x.shape[0])
        near = _find_near(posed, way, x, x_start, x_coast, thickness, begin, end, count)
        for p in range(begin, end if near > 0 else begin):
            stopped += _stop(
                shapes, posed, side, way, x, x_start, x_coast, thickness, first, near, p
            )
    return stopped


@lean_kernel(inner=True)
def _stop(shapes, posed, side, way, x, x_start, x_coast, thickness, first, count, p):
    """Stops particle p at the earliest entry into one of the shapes found; 1 if there is one."""
    one = np.float32(1.0)
    zero = np.float32(0.0)
    sx, sy, sz = x_start[p, 0], x_start[p, 1], x_start[p, 2]
    px, py, pz = x[p, 0], x[p, 1], x[p, 2]
    stopped = 0
    last = np.int64(-1)
    for _ in range(_ENTRIES):
        earliest = np.float32(2.0)
        entered = np.int64(-1)
        nx = ny = nz = ex = ey = ez = rx = ry = rz = zero
        for n in range(count):
            k = np.int64(way.fast[first + n])
            if k == last or side[k, p] != UNDER:
                continue
            # In the shape's frame at the end: from where the particle would be, fixed to it.
            qx = sx + (
                posed.carry[k, 0, 0] * sx
                + posed.carry[k, 0, 1] * sy
                + posed.carry[k, 0, 2] * sz
                + posed.carry[k, 0, 3]
            )
            qy = sy + (
                posed.carry[k, 1, 0] * sx
                + posed.carry[k, 1, 1] * sy
                + posed.carry[k, 1, 2] * sz
                + posed.carry[k, 1, 3]
            )
            qz = sz + (
                posed.carry[k, 2, 0] * sx
                + posed.carry[k, 2, 1] * sy
                + posed.carry[k, 2, 2] * sz
                + posed.carry[k, 2, 3]
            )
            ux = px - qx
            uy = py - qy
            uz = pz - qz
            length = np.sqrt(ux * ux + uy * uy + uz * uz)
            inner = way.inscribed_radius[k] + thickness
            short = np.float32(_SHORT) * inner
            wx, wy, wz = qx - sx, qy - sy, qz - sz
            fx, fy, fz = x_coast[p, 0] - qx, x_coast[p, 1] - qy, x_coast[p, 2] - qz
            far = max(wx * wx + wy * wy + wz * wz, fx * fx + fy * fy + fz * fz)
            if not (length > short and far > short * short):
                continue
            t, mx, my, mz = _enters(
                shapes, posed, k, qx, qy, qz, ux, uy, uz, length, inner, thickness
            )
            if t < earliest and (one - t) * length > short:
                earliest = t
                entered = k
                nx, ny, nz = mx, my, mz
                ex, ey, ez = qx + t * ux, qy + t * uy, qz + t * uz
                rx, ry, rz = (one - t) * ux, (one - t) * uy, (one - t) * uz
        if entered < 0:
            break
        stopped = 1
        last = entered
        along = rx * nx + ry * ny + rz * nz
        inner = way.inscribed_radius[entered] + thickness
        along = max(along, np.float32(-_UNDER_SURFACE) * inner)
        px = ex + along * nx
        py = ey + along * ny
        pz = ez + along * nz
    if stopped:
        x[p, 0] = px
        x[p, 1] = py
        x[p, 2] = pz
    return stopped
