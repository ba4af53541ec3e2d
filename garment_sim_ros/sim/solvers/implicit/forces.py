"""Forces of an `implicit` sub-step, and its contacts.

`force` is in the order in which the matrix is eliminated, one row per axis; its last column takes
what acts on pins.
"""

import numpy as np

from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.solvers.implicit.contact import on_the_cone

_ONE = np.uint64(1)
_TWO = np.uint64(2)
_THREE = np.uint64(3)


_LOOSE = np.float32(0.5)
"""Up to this share of free fall a particle hangs on others, and does not fall ahead of them."""


@kernel(inner=True)
def falls(share):
    """How much of what outer forces push the iterations begin with, for a share of free fall.

    Cut short, the iterations move cloth as if it were heavier, but what they begin with it falls
    like anything else: that is work on more than its mass. Cloth that hangs and quivers, which
    makes shares anything between 0 and 1, would be kept quivering by it.
    """
    return max(np.float32(0.0), (share - _LOOSE) / (np.float32(1.0) - _LOOSE))


@kernel(inner=True)
def predict_with_share(x, v, x_start, behind, share, push, keep, dt):
    """Positions from which those of least energy are found.

    They have only a part of what outer forces push: all of it in free fall, none at rest,
    where the start is then the solution; in between, see `falls`. How far that is from where
    particles would be without inner forces is kept by itself: as a difference of two positions it
    would be rounded to a coordinate's last place, which over a short sub-step is much velocity.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities [m/s], shape [n, 3].
        x_start: Output, positions before [m], shape [n, 3].
        behind: Output, the way from there to where particles would be without inner forces [m],
            shape [n, 3].
        share: Which part of it each particle fell freely of late, from 0 to 1, shape [n].
        push: Velocity that outer forces add in the sub-step [m/s], shape [3].
        keep: Part of velocity that is kept.
        dt: Sub-step [s].
    """
    for p in range(x.shape[0]):
        fall = falls(share[p])
        for k in range(3):
            start = x[p, k]
            coasted = keep * v[p, k]
            x_start[p, k] = start
            behind[p, k] = dt * ((np.float32(1.0) - fall) * push[k])
            x[p, k] = start + dt * (coasted + fall * push[k])


@kernel(forceinline=True)
def edge_forces(x, particles, place, rest_squared, stiffness, force):
    """Forces of edges as springs, the first into `force`, which is cleared.

    With the quotient for 1 - l/d of `solvers.xpbd.edges`.

    Args:
        x: Positions, flat [m], shape [3 n].
        particles: Ends, flat, shape [2 m].
        place: Columns of `force` for those, shape [2 m].
        rest_squared: Squared rest lengths [m^2], shape [m].
        stiffness: Shape [m] [N/m].
        force: Output [N], shape [3, free + 1].
    """
    fx, fy, fz = force[0], force[1], force[2]
    force[:] = np.float32(0.0)
    for e in range(rest_squared.size):
        i = _THREE * np.uint64(particles[2 * e])
        j = _THREE * np.uint64(particles[2 * e + 1])
        dx = x[i] - x[j]
        dy = x[i + _ONE] - x[j + _ONE]
        dz = x[i + _TWO] - x[j + _TWO]
        squared = dx * dx + dy * dy + dz * dz + np.float32(1e-20)
        rest = rest_squared[e]
        over = squared - rest
        pull = stiffness[e] * (over + over) / (rest + np.float32(3.0) * squared)
        dx *= pull
        dy *= pull
        dz *= pull
        a = np.uint64(place[2 * e])
        b = np.uint64(place[2 * e + 1])
        fx[a] -= dx
        fy[a] -= dy
        fz[a] -= dz
        fx[b] += dx
        fy[b] += dy
        fz[b] += dz


@kernel(forceinline=True)
def hinge_forces(x, particles, place, weight, stiffness, force):
    """Adds the forces of hinges.

    Args:
        x: Positions [m], shape [n, 3].
        particles: Particles of the hinges, shape [h, 4].
        place: Columns of `force` for those, shape [h, 4].
        weight: Weights of the curvature, shape [h, 4].
        stiffness: Shape [h] [N/m].
        force: Changed in place [N], shape [3, free + 1].
    """
    fx, fy, fz = force[0], force[1], force[2]
    for n in range(stiffness.size):
        i = np.uint64(particles[n, 0])
        j = np.uint64(particles[n, 1])
        k = np.uint64(particles[n, 2])
        m = np.uint64(particles[n, 3])
        a = np.uint64(place[n, 0])
        b = np.uint64(place[n, 1])
        c = np.uint64(place[n, 2])
        d = np.uint64(place[n, 3])
        w0 = weight[n, 0]
        w1 = weight[n, 1]
        w2 = weight[n, 2]
        w3 = weight[n, 3]
        # Differences of positions first: weights cancel only up to rounding.
        x3, y3, z3 = x[m, 0], x[m, 1], x[m, 2]
        s = stiffness[n]
        px = s * (w0 * (x[i, 0] - x3) + w1 * (x[j, 0] - x3) + w2 * (x[k, 0] - x3))
        py = s * (w0 * (x[i, 1] - y3) + w1 * (x[j, 1] - y3) + w2 * (x[k, 1] - y3))
        pz = s * (w0 * (x[i, 2] - z3) + w1 * (x[j, 2] - z3) + w2 * (x[k, 2] - z3))
        fx[a] -= w0 * px
        fy[a] -= w0 * py
        fz[a] -= w0 * pz
        fx[b] -= w1 * px
        fy[b] -= w1 * py
        fz[b] -= w1 * pz
        fx[c] -= w2 * px
        fy[c] -= w2 * py
        fz[c] -= w2 * pz
        fx[d] -= w3 * px
        fy[d] -= w3 * py
        fz[d] -= w3 * pz


@kernel(inner=True)
def add_inertia_and_contact(x, x_start, behind, place, inertia, friction, hold, force):
    """Adds what inertia asks for, and what contacts press and hold.

    A particle beneath its contact's plane is pressed by a spring; along the surface another one
    holds it at its anchor, which moves with the shape, as far as friction goes.

    Args:
        x: Positions [m], shape [free, 3].
        x_start: Positions at the start of the sub-step [m], shape [free, 3].
        behind: From there to the positions without inner forces [m], shape [n, 3].
        place: Column of each particle, shape [free].
        inertia: Mass over squared sub-step, with damping [N/m], shape [free].
        friction: Coulomb coefficient.
        hold: `solvers.implicit.given.Hold`.
        force: Changed in place [N], shape [3, free + 1].
    """
    zero = np.float32(0.0)
    for p in range(x.shape[0]):
        q = np.uint64(place[p])
        m = inertia[p]
        fx = m * behind[p, 0]
        fy = m * behind[p, 1]
        fz = m * behind[p, 2]
        stiffness = hold.stiffness[p]
        if stiffness > zero:
            nx, ny, nz = hold.normal[p, 0], hold.normal[p, 1], hold.normal[p, 2]
            gap = hold.level[p] - (x[p, 0] * nx + x[p, 1] * ny + x[p, 2] * nz)
            if gap > zero:
                ux = x_start[p, 0] - x[p, 0] + hold.lever[p, 0] + hold.shift[p, 0]
                uy = x_start[p, 1] - x[p, 1] + hold.lever[p, 1] + hold.shift[p, 1]
                uz = x_start[p, 2] - x[p, 2] + hold.lever[p, 2] + hold.shift[p, 2]
                ux, uy, uz = on_the_cone(ux, uy, uz, nx, ny, nz, gap, friction)
                fx += stiffness * ux
                fy += stiffness * uy
                fz += stiffness * uz
        force[0, q] += fx
        force[1, q] += fy
        force[2, q] += fz


@kernel(inner=True)
def move(x, behind, place, change, step):
    """Moves particles [free, 3] by `step` times the columns [3, free + 1] of `change`."""
    for p in range(x.shape[0]):
        q = np.uint64(place[p])
        for k in range(3):
            moved = step * change[k, q]
            x[p, k] += moved
            behind[p, k] -= moved
