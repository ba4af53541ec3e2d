"""The end of an `implicit` sub-step: velocities from what the solution moved."""

import numpy as np

from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.solvers.implicit.contact import on_the_cone
from garment_sim_ros.sim.solvers.implicit.forces import falls


@kernel()
def new_velocities(x, v, x_start, behind, friction, push, keep, dt, blend, share, hold, motion):
    """Velocities from positions; shares and anchors follow.

    What a contact presses keeps the surface's velocity across it: contact is inelastic, and being
    moved out gives no kick.

    Args:
        x: Positions [m], shape [free, 3].
        v: Velocities, changed in place [m/s], shape [free, 3].
        x_start: Positions at the start of the sub-step [m], shape [free, 3].
        behind: From there to the positions without inner forces [m], shape [n, 3].
        friction: Coulomb coefficient.
        push: Velocity that outer forces add in the sub-step [m/s], shape [3].
        keep: Part of velocity that is kept.
        dt: Sub-step [s].
        blend: How much of the new share counts.
        share: Changed in place, see `predict_with_share`, shape [free].
        hold: `solvers.implicit.given.Hold`; levers become relative to the new positions.
        motion: Output, sum and maximum of squared speeds [m^2/s^2], shape [2].

    Returns:
        Number of particles that contacts press.
    """
    zero = np.float32(0.0)
    one = np.float32(1.0)
    rate = one / dt
    squared = push[0] * push[0] + push[1] * push[1] + push[2] * push[2]
    touching = 0
    total = 0.0
    fastest = zero
    for p in range(x.shape[0]):
        stiffness = hold.stiffness[p]
        nx, ny, nz = hold.normal[p, 0], hold.normal[p, 1], hold.normal[p, 2]
        level = hold.level[p]
        fall = falls(share[p])
        for k in range(3):
            # Where the particle would have been without inner forces and contact.
            level -= hold.normal[p, k] * (x_start[p, k] + dt * (keep * v[p, k] + fall * push[k]))
        gained = zero
        for k in range(3):
            gain = push[k] - behind[p, k] * rate
            v[p, k] = keep * v[p, k] + gain
            gained += gain * push[k]
        now = min(one, max(zero, gained / squared)) if squared > zero else one
        now = share[p] + blend * (now - share[p])
        share[p] = now if now >= zero else one  # Also after something that was not a number.
        if stiffness > zero:
            gap = hold.level[p] - (x[p, 0] * nx + x[p, 1] * ny + x[p, 2] * nz)
            if max(gap, level) > zero:
                touching += 1
                leaving = (
                    (v[p, 0] - rate * hold.shift[p, 0]) * nx
                    + (v[p, 1] - rate * hold.shift[p, 1]) * ny
                    + (v[p, 2] - rate * hold.shift[p, 2]) * nz
                )
                leaving = max(leaving, zero)
                v[p, 0] -= leaving * nx
                v[p, 1] -= leaving * ny
                v[p, 2] -= leaving * nz
            if gap > zero:
                ux = x_start[p, 0] - x[p, 0] + hold.lever[p, 0] + hold.shift[p, 0]
                uy = x_start[p, 1] - x[p, 1] + hold.lever[p, 1] + hold.shift[p, 1]
                uz = x_start[p, 2] - x[p, 2] + hold.lever[p, 2] + hold.shift[p, 2]
                ux, uy, uz = on_the_cone(ux, uy, uz, nx, ny, nz, gap, friction)
                hold.lever[p, 0] = ux - gap * nx
                hold.lever[p, 1] = uy - gap * ny
                hold.lever[p, 2] = uz - gap * nz
            else:
                hold.lever[p, 0] = hold.lever[p, 1] = hold.lever[p, 2] = zero
        speed = v[p, 0] * v[p, 0] + v[p, 1] * v[p, 1] + v[p, 2] * v[p, 2]
        total += speed
        fastest = max(fastest, speed)
    motion[0] = total
    motion[1] = fastest
    return touching
