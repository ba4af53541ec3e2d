"""Directions of descent from a constant matrix and the last few steps.

Liu, Bouaziz & Kavan 2017, "Quasi-Newton methods for real-time simulation of hyperelastic
materials", algorithm 1: L-BFGS (Nocedal & Wright, "Numerical optimization", algorithm 7.4) whose
initial matrix is that of projective dynamics.
"""

import numpy as np

from garment_sim_ros.geometry.copying import copy
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.solvers.implicit.cholesky import solve_factorised


@kernel(inner=True)
def dot(a, b):
    """Inner product of two arrays [3, n]."""
    total = 0.0
    for k in range(3):
        for i in range(a.shape[1]):
            total += np.float64(a[k, i] * b[k, i])
    return total


@kernel(inner=True)
def add(out, a, factor):
    """Adds a multiple of an array [3, n] to another."""
    f = np.float32(factor)
    for k in range(3):
        for i in range(a.shape[1]):
            out[k, i] += f * a[k, i]


@kernel(forceinline=True)
def descend(force, fronts, factor, scratch, past, count, direction):
    """Where to go from a point with a force.

    Args:
        force: Less the gradient [N], shape [3, n].
        fronts: See `sim.solvers.implicit.dissection.Fronts`.
        factor: Of the matrix, see `cholesky.factorise`.
        scratch: Scratch of a solution.
        past: `solvers.implicit.given.Past`.
        count: Number of steps that it has; the latest are kept.
        direction: Output [m], shape [3, n].
    """
    copy(force, direction)
    kept = min(count, past.step.shape[0])
    for i in range(count - 1, count - 1 - kept, -1):
        c = i % past.step.shape[0]
        past.share[c] = dot(past.step[c], direction) / past.curvature[c]
        add(direction, past.force[c], -past.share[c])
    solve_factorised(fronts, factor, direction, scratch)
    for i in range(count - kept, count):
        c = i % past.step.shape[0]
        back = dot(past.force[c], direction) / past.curvature[c]
        add(direction, past.step[c], past.share[c] - back)


@kernel(forceinline=True)
def remember(past, count, direction, step, before, after):
    """Keeps a step and how much it changed the force; the new count of those kept.

    Args:
        past: `solvers.implicit.given.Past`.
        count: Number of steps that it has.
        direction: Of the step [m], shape [3, n].
        step: How much of that was taken.
        before: Force before [N], shape [3, n].
        after: Force after [N], shape [3, n].
    """
    c = count % past.step.shape[0]
    for k in range(3):
        for i in range(direction.shape[1]):
            past.step[c, k, i] = np.float32(step) * direction[k, i]
            past.force[c, k, i] = before[k, i] - after[k, i]
    past.curvature[c] = dot(past.step[c], past.force[c])
    # Along such a step the energy is not convex: it says nothing of the lowest point.
    return count + 1 if past.curvature[c] > 0.0 else count
