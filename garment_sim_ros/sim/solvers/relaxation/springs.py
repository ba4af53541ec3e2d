"""Gauss-Seidel correction of springs."""

import numpy as np

from garment_sim_ros.geometry.four import (
    each_four_times,
    four_at,
    put_four,
    put_three,
    roots,
    same_four,
    squares,
    three_at,
)
from garment_sim_ros.jit import exact_kernel, kernel

_THREE = np.uint64(3)
_FOUR = np.uint64(4)


@exact_kernel(inner=True)
def _excess(rest, squared):
    """Excess lengths over lengths, exactly 0 for springs at rest.

    An approximate root leaves an excess of some 1e-7 for ever. It moves ends along the axes where
    their coordinates are small, is rounded away along the others, and so turns the cloth: with
    many sweeps in a small step, a pendulum swings too fast.
    """
    return same_four(np.float32(1.0)) - rest / roots(squared)


@kernel(inner=True)
def _end(particles, n):
    """Where the position of end n is in an array of fours."""
    return _FOUR * np.uint64(particles[n])


@kernel(inner=True)
def _correct_four(x, particles, rest_length, share, s):
    """Corrects springs s to s + 3, which have no end in common."""
    at, n = np.uint64(s), np.int64(2 * s)
    i0, j0 = _end(particles, n), _end(particles, n + 1)
    i1, j1 = _end(particles, n + 2), _end(particles, n + 3)
    i2, j2 = _end(particles, n + 4), _end(particles, n + 5)
    i3, j3 = _end(particles, n + 6), _end(particles, n + 7)
    a0, b0, a1, b1 = four_at(x, i0), four_at(x, j0), four_at(x, i1), four_at(x, j1)
    a2, b2, a3, b3 = four_at(x, i2), four_at(x, j2), four_at(x, i3), four_at(x, j3)
    d0, d1, d2, d3 = a0 - b0, a1 - b1, a2 - b2, a3 - b3
    # 1e-20 m^2 keeps the quotient finite where two particles coincide.
    squared = squares(d0, d1, d2, d3) + same_four(np.float32(1e-20))
    excess = _excess(four_at(rest_length, at), squared)
    first = four_at(share, at) * excess
    s0, s1, s2, s3 = each_four_times(first)
    t0, t1, t2, t3 = each_four_times(excess - first)
    put_four(x, i0, a0 - s0 * d0)
    put_four(x, j0, b0 + t0 * d0)
    put_four(x, i1, a1 - s1 * d1)
    put_four(x, j1, b1 + t1 * d1)
    put_four(x, i2, a2 - s2 * d2)
    put_four(x, j2, b2 + t2 * d2)
    put_four(x, i3, a3 - s3 * d3)
    put_four(x, j3, b3 + t3 * d3)


@kernel(forceinline=True)
def correct_springs(x, wide, particles, rest_length, share, colour_start, sweeps):
    """Moves the ends of each spring to its rest length, in order, `sweeps` times.

    Sun et al. 2007, equations 2 and 3: with V the excess length along the spring, the first end
    moves by -w0 / (w0 + w1) V and the second by w1 / (w0 + w1) V. Both stretch and compression
    are corrected. Springs of a colour are corrected four at a time, with the result of one by one.

    Args:
        x: Positions, changed in place, flat [m], shape [3 n].
        wide: Scratch: the same as fours, shape [4 n].
        particles: Ends of the springs, flat, unsigned, shape [2 m].
        rest_length: Rest lengths [m], shape [m].
        share: w0 / (w0 + w1), shape [m].
        colour_start: Where each colour starts, shape [colours + 1].
        sweeps: Number of passes over all springs.
    """
    for p in range(x.size // 3):
        n = np.uint64(p)
        put_four(wide, _FOUR * n, three_at(x, _THREE * n))
    for _ in range(sweeps):
        for colour in range(colour_start.size - 1):
            end = np.int64(colour_start[colour + 1])
            s = np.int64(colour_start[colour])
            while s + 4 <= end:
                _correct_four(wide, particles, rest_length, share, s)
                s += 4
            while s < end:
                i, j = _end(particles, 2 * s), _end(particles, 2 * s + 1)
                a, b = four_at(wide, i), four_at(wide, j)
                d = a - b
                squared = squares(d, d, d, d) + same_four(np.float32(1e-20))
                excess = _excess(same_four(rest_length[s]), squared)
                first = same_four(share[s]) * excess
                put_four(wide, i, a - first * d)
                put_four(wide, j, b + (excess - first) * d)
                s += 1
    for p in range(x.size // 3):
        n = np.uint64(p)
        put_three(x, _THREE * n, four_at(wide, _FOUR * n))
