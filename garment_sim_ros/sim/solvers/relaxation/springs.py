"""Gauss-Seidel correction of springs."""

import numpy as np

from garment_sim_ros.geometry.four import four_at, put_four, roots, same_four, squares
from garment_sim_ros.jit import exact_kernel, kernel
from garment_sim_ros.sim.solvers.wide import end_of, ends_of_four, move_ends, narrow, widen


@exact_kernel(inner=True)
def _excess(rest, squared):
    """Excess lengths over lengths, exactly 0 for springs at rest.

    An approximate root leaves an excess of some 1e-7 for ever. It moves ends along the axes where
    their coordinates are small, is rounded away along the others, and so turns the cloth: with
    many sweeps in a small step, a pendulum swings too fast.
    """
    return same_four(np.float32(1.0)) - rest / roots(squared)


@kernel(inner=True)
def _correct_four(x, particles, rest_length, share, s):
    """Corrects springs s to s + 3, which have no end in common."""
    at, ends = np.uint64(s), ends_of_four(x, particles, np.int64(s))
    d = ends[3]
    # 1e-20 m^2 keeps the quotient finite where two particles coincide.
    squared = squares(d[0], d[1], d[2], d[3]) + same_four(np.float32(1e-20))
    excess = _excess(four_at(rest_length, at), squared)
    first = four_at(share, at) * excess
    move_ends(x, ends, first, excess - first)


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
    widen(x, wide)
    for _ in range(sweeps):
        for colour in range(colour_start.size - 1):
            end = np.int64(colour_start[colour + 1])
            s = np.int64(colour_start[colour])
            while s + 4 <= end:
                _correct_four(wide, particles, rest_length, share, s)
                s += 4
            while s < end:
                i, j = end_of(particles, 2 * s), end_of(particles, 2 * s + 1)
                a, b = four_at(wide, i), four_at(wide, j)
                d = a - b
                squared = squares(d, d, d, d) + same_four(np.float32(1e-20))
                excess = _excess(same_four(rest_length[s]), squared)
                first = same_four(share[s]) * excess
                put_four(wide, i, a - first * d)
                put_four(wide, j, b + (excess - first) * d)
                s += 1
    narrow(wide, x)
