"""Vectors as fours, and the ends of four edges at once, in flat arrays."""

import numpy as np

from garment_sim_ros.geometry.four import (
    each_four_times,
    four_at,
    put_four,
    put_three,
    three_at,
)
from garment_sim_ros.jit import kernel

_THREE = np.uint64(3)
_FOUR = np.uint64(4)


@kernel(inner=True)
def widen(x, wide):
    """Writes vectors, flat [3 n], as fours, flat [4 n]; the last number of each is 0."""
    for p in range(x.size // 3):
        i = np.uint64(p)
        put_four(wide, _FOUR * i, three_at(x, _THREE * i))


@kernel(inner=True)
def narrow(wide, x):
    """Writes fours, flat [4 n], back as vectors, flat [3 n]."""
    for p in range(x.size // 3):
        i = np.uint64(p)
        put_three(x, _THREE * i, four_at(wide, _FOUR * i))


@kernel(inner=True)
def end_of(particles, n):
    """Where the four of end n is."""
    return _FOUR * np.uint64(particles[n])


@kernel(inner=True)
def ends_of_four(x, particles, e):
    """The ends of four edges from e on.

    Args:
        x: Positions as fours, flat, shape [4 n].
        particles: Ends of the edges, flat, unsigned, shape [2 m].
        e: The first of them.

    Returns:
        (at, a, b, d): where the ends are, first and second in turns; the positions of the first
        ends, of the second ones, and from the second ones to the first.
    """
    n = np.int64(2 * e)
    i0, j0 = end_of(particles, n), end_of(particles, n + 1)
    i1, j1 = end_of(particles, n + 2), end_of(particles, n + 3)
    i2, j2 = end_of(particles, n + 4), end_of(particles, n + 5)
    i3, j3 = end_of(particles, n + 6), end_of(particles, n + 7)
    a0, b0, a1, b1 = four_at(x, i0), four_at(x, j0), four_at(x, i1), four_at(x, j1)
    a2, b2, a3, b3 = four_at(x, i2), four_at(x, j2), four_at(x, i3), four_at(x, j3)
    d = (a0 - b0, a1 - b1, a2 - b2, a3 - b3)
    return (i0, j0, i1, j1, i2, j2, i3, j3), (a0, a1, a2, a3), (b0, b1, b2, b3), d


@kernel(inner=True)
def move_ends(x, ends, first, second):
    """Moves the ends of four edges, none of which is in common, together.

    Args:
        x: Positions as fours, changed in place, flat, shape [4 n].
        ends: From `ends_of_four`.
        first: The part of each way between the ends that the first end goes, a four.
        second: Likewise of the second ends.
    """
    at, a, b, d = ends
    s0, s1, s2, s3 = each_four_times(first)
    t0, t1, t2, t3 = each_four_times(second)
    put_four(x, at[0], a[0] - s0 * d[0])
    put_four(x, at[1], b[0] + t0 * d[0])
    put_four(x, at[2], a[1] - s1 * d[1])
    put_four(x, at[3], b[1] + t1 * d[1])
    put_four(x, at[4], a[2] - s2 * d[2])
    put_four(x, at[5], b[2] + t2 * d[2])
    put_four(x, at[6], a[3] - s3 * d[3])
    put_four(x, at[7], b[3] + t3 * d[3])
