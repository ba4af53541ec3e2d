"""Gauss-Seidel correction of springs."""

import numpy as np

from garment_sim_ros.jit import exact_kernel, kernel

_ONE = np.uint64(1)
_TWO = np.uint64(2)
_THREE = np.uint64(3)


@exact_kernel(inner=True)
def _excess(rest, squared):
    """Excess length over length, exactly 0 for a spring at rest.

    An approximate root leaves an excess of some 1e-7 for ever. It moves ends along the axes where
    their coordinates are small, is rounded away along the others, and so turns the cloth: with
    many sweeps in a small step, a pendulum swings too fast.
    """
    return np.float32(1.0) - rest / np.sqrt(squared)


@kernel(forceinline=True)
def correct_springs(x, particles, rest_length, share, sweeps):
    """Moves the ends of each spring to its rest length, in order, `sweeps` times.

    Sun et al. 2007, equations 2 and 3: with V the excess length along the spring, the first end
    moves by -w0 / (w0 + w1) V and the second by w1 / (w0 + w1) V. Both stretch and compression
    are corrected.

    Args:
        x: Positions, changed in place, flat [m], shape [3 n].
        particles: Ends of the springs, flat, unsigned, shape [2 m].
        rest_length: Rest lengths [m], shape [m].
        share: w0 / (w0 + w1), shape [m].
        sweeps: Number of passes over all springs.
    """
    for _ in range(sweeps):
        for s in range(rest_length.size):
            # Unsigned offsets into a flat array: no test for negative ones, no strides.
            i = _THREE * np.uint64(particles[2 * s])
            j = _THREE * np.uint64(particles[2 * s + 1])
            ix, iy, iz = x[i], x[i + _ONE], x[i + _TWO]
            jx, jy, jz = x[j], x[j + _ONE], x[j + _TWO]
            dx = ix - jx
            dy = iy - jy
            dz = iz - jz
            # 1e-20 m^2 keeps the quotient finite where two particles coincide.
            excess = _excess(rest_length[s], dx * dx + dy * dy + dz * dz + np.float32(1e-20))
            a = share[s] * excess
            b = excess - a
            x[i] = ix - a * dx
            x[i + _ONE] = iy - a * dy
            x[i + _TWO] = iz - a * dz
            x[j] = jx + b * dx
            x[j + _ONE] = jy + b * dy
            x[j + _TWO] = jz + b * dz
