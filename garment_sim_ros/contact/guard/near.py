"""Cores and triangles that are near each other: the guard's broad phase."""

import numpy as np

from garment_sim_ros.contact.guard.guard import BLOCK, TRACK
from garment_sim_ros.contact.guard.nearest import along_segment
from garment_sim_ros.geometry.boxes import boxes_near, in_columns
from garment_sim_ros.geometry.four import (
    each_number,
    higher_four,
    lower_four,
    put_three,
    same_four,
    three_at,
)
from garment_sim_ros.geometry.vectors import dot, less
from garment_sim_ros.jit import lean_kernel

_THREE = np.uint64(3)
_SIX = np.uint64(6)


@lean_kernel(inner=True)
def corner(x, i):
    """Position i of an array [n, 3]."""
    return np.float64(x[i, 0]), np.float64(x[i, 1]), np.float64(x[i, 2])


@lean_kernel(inner=True)
def core(ends, c):
    """One end of core c, and the way to the other."""
    p = (ends[c, 0, 0], ends[c, 0, 1], ends[c, 0, 2])
    return p, (ends[c, 1, 0] - p[0], ends[c, 1, 1] - p[1], ends[c, 1, 2] - p[2])


@lean_kernel(inner=True)
def pose_cores(guard, posed, carry):
    """Ends of the cores now, and where they were at the last search, about the local origin.

    Args:
        guard: `Guard`.
        posed: Shapes, posed now.
        carry: How points moved with the shapes since the last search, see `PosedShapes`.
    """
    for c in range(guard.shape.size):
        k = guard.shape[c]
        R, t, turn = posed.rotation[k], posed.centre[k], carry[k]
        for end in range(2):
            e, before, now = guard.ends[c, end], guard.posed[0, c, end], guard.posed[1, c, end]
            for r in range(3):
                now[r] = R[r, 0] * e[0] + R[r, 1] * e[1] + R[r, 2] * e[2] + t[r]
            # The inverse of p + turn p + way, with a rotation 1 + turn.
            a, b, d = now[0] - turn[0, 3], now[1] - turn[1, 3], now[2] - turn[2, 3]
            before[0] = a + turn[0, 0] * a + turn[1, 0] * b + turn[2, 0] * d
            before[1] = b + turn[0, 1] * a + turn[1, 1] * b + turn[2, 1] * d
            before[2] = d + turn[0, 2] * a + turn[1, 2] * b + turn[2, 2] * d


@lean_kernel(inner=True)
def _box_triangles(guard, x):
    """A box for each block of triangles.

    Returns:
        The box of all [m]: its low corner, its high corner.
    """
    places, boxes = x.reshape(-1), guard.box.reshape(-1)
    low, high = same_four(np.float32(np.inf)), same_four(np.float32(-np.inf))
    for b in range(len(guard.box)):
        least, most = same_four(np.float32(np.inf)), same_four(np.float32(-np.inf))
        for n in range(guard.corner_start[b], guard.corner_start[b + 1]):
            place = three_at(places, _THREE * np.uint64(guard.corner[n]))
            least, most = lower_four(place, least), higher_four(place, most)
        put_three(boxes, _SIX * np.uint64(b), least)
        put_three(boxes, _SIX * np.uint64(b) + _THREE, most)
        low, high = lower_four(least, low), higher_four(most, high)
    return each_number(low), each_number(high)


@lean_kernel(inner=True)
def _block_is_near(box, b, p, d, reach):
    """Whether something in the box of block b may be within `reach` of the segment p + s d."""
    hx, hy, hz = box[b, 3] - box[b, 0], box[b, 4] - box[b, 1], box[b, 5] - box[b, 2]
    m = (box[b, 0] + 0.5 * hx, box[b, 1] + 0.5 * hy, box[b, 2] + 0.5 * hz)
    _, square = along_segment(p, d, m)
    return square <= (reach + 0.5 * np.sqrt(hx * hx + hy * hy + hz * hz)) ** 2


@lean_kernel(inner=True)
def find_near(guard, x):
    """Writes the pairs that may be within a core's radius and `TRACK` of each other.

    Args:
        guard: `Guard`, whose `pairs` are the output.
        x: Positions of all particles [m], shape [n, 3].

    Returns:
        Their number.
    """
    low, high = _box_triangles(guard, x)
    in_columns(guard.box, guard.columns)
    box, triangles, pairs = guard.box, guard.triangles, guard.pairs
    count, most = 0, pairs.shape[1] - 1
    for c in range(guard.shape.size):
        reach = guard.radius[c] + TRACK
        p, d = core(guard.posed[1], c)
        lx, hx = min(p[0], p[0] + d[0]) - reach, max(p[0], p[0] + d[0]) + reach
        ly, hy = min(p[1], p[1] + d[1]) - reach, max(p[1], p[1] + d[1]) + reach
        lz, hz = min(p[2], p[2] + d[2]) - reach, max(p[2], p[2] + d[2]) + reach
        apart = (low[0] > hx) | (high[0] < lx) | (low[1] > hy) | (high[1] < ly)
        if apart | (low[2] > hz) | (high[2] < lz):
            continue
        blocks = boxes_near(
            guard.columns,
            *(np.float32(lx), np.float32(ly), np.float32(lz)),
            *(np.float32(hx), np.float32(hy), np.float32(hz)),
            *(np.float32(0.0), guard.blocks),
        )
        for n in range(blocks):
            b = guard.blocks[n]
            if not _block_is_near(box, b, p, d, reach):
                continue
            for t in range(b * BLOCK, min(len(triangles), (b + 1) * BLOCK)):
                i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
                a, e, f = corner(x, i), corner(x, j), corner(x, k)
                m = (0.5 * (a[0] + e[0]), 0.5 * (a[1] + e[1]), 0.5 * (a[2] + e[2]))
                to_a, to_f = less(a, m), less(f, m)
                size = np.sqrt(max(dot(to_a, to_a), dot(to_f, to_f)))
                _, square = along_segment(p, d, m)
                pairs[0, count] = c
                pairs[1, count] = t
                count += 1 if (square <= (reach + size) ** 2) & (count < most) else 0
    return count
