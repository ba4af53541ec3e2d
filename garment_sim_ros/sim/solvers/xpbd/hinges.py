"""Implicit bending, acting on velocities."""

import numpy as np

from garment_sim_ros.jit import kernel


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
        x: Positions [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        particles: Particles of the hinges, shape [h, 4].
        hinges: From `prepare_hinges`, shape [h, 8].
        dt: Step [s].
    """
    for n in range(particles.shape[0]):
        i = np.uint64(particles[n, 0])
        j = np.uint64(particles[n, 1])
        k = np.uint64(particles[n, 2])
        m = np.uint64(particles[n, 3])
        a = hinges[n]
        for d in range(3):
            # Differences of positions first: weights cancel only up to rounding.
            c = (
                a[0] * (x[i, d] - x[m, d])
                + a[1] * (x[j, d] - x[m, d])
                + a[2] * (x[k, d] - x[m, d])
                + dt * (a[0] * v[i, d] + a[1] * v[j, d] + a[2] * v[k, d] + a[3] * v[m, d])
            )
            v[i, d] -= a[4] * c
            v[j, d] -= a[5] * c
            v[k, d] -= a[6] * c
            v[m, d] -= a[7] * c
