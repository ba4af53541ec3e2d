"""Implicit bending, acting on velocities."""

import numpy as np

from garment_sim_ros.geometry.four import four_at, put_four, same_four
from garment_sim_ros.jit import kernel

_FOUR = np.uint64(4)


@kernel()
def prepare_hinges(particles, weight, stiffness, inverse_mass, keep, dt, hinges):
    """What a bending step of dt needs of each hinge.

    Args:
        particles: Particles, shape [h, 4].
        weight: Weights w of the curvature, shape [h, 4].
        stiffness: Stiffnesses k [N/m], shape [h].
        inverse_mass: Inverse masses [1/kg], shape [n].
        keep: Part of velocity that damping leaves in the step; of what forces add, too.
        dt: Step [s].
        hinges: Output: w, and m_i^-1 w_i / dt / (sum m_j^-1 w_j^2 + 1 / (k dt^2)), shape [h, 8].
    """
    for n in range(stiffness.size):
        total = 0.0
        for k in range(4):
            total += keep * inverse_mass[particles[n, k]] * weight[n, k] * weight[n, k]
        pull = stiffness[n] * dt * dt
        scale = pull / (total * pull + 1.0) / dt
        for k in range(4):
            hinges[n, k] = weight[n, k]
            hinges[n, 4 + k] = keep * inverse_mass[particles[n, k]] * weight[n, k] * scale


@kernel(forceinline=True)
def bend(x, v, particles, hinges, dt):
    """Changes velocities so that each hinge, in turn, has its force at the end of the step.

    One Gauss-Seidel pass over the constraints C = sum_k w_k (x_k + dt v_k) with compliance. C has
    three components with one and the same gradient: no root, no division. Acting on velocities, a
    step may span several sub-steps of the edges.

    Args:
        x: Positions, four numbers each of which the last one does not count, flat [m], [4 n].
        v: Velocities, likewise, changed in place [m/s], shape [4 n].
        particles: Particles of the hinges, shape [h, 4].
        hinges: From `prepare_hinges`, shape [h, 8].
        dt: Step [s].
    """
    for n in range(particles.shape[0]):
        i = _FOUR * np.uint64(particles[n, 0])
        j = _FOUR * np.uint64(particles[n, 1])
        k = _FOUR * np.uint64(particles[n, 2])
        m = _FOUR * np.uint64(particles[n, 3])
        vi, vj, vk, vm = four_at(v, i), four_at(v, j), four_at(v, k), four_at(v, m)
        a = hinges[n]
        a0, a1, a2, a3 = same_four(a[0]), same_four(a[1]), same_four(a[2]), same_four(a[3])
        # Differences of positions first: weights cancel only up to rounding.
        o = four_at(x, m)
        bent = a0 * (four_at(x, i) - o) + a1 * (four_at(x, j) - o) + a2 * (four_at(x, k) - o)
        c = bent + same_four(dt) * (a0 * vi + a1 * vj + a2 * vk + a3 * vm)
        put_four(v, i, vi - same_four(a[4]) * c)
        put_four(v, j, vj - same_four(a[5]) * c)
        put_four(v, k, vk - same_four(a[6]) * c)
        put_four(v, m, vm - same_four(a[7]) * c)
