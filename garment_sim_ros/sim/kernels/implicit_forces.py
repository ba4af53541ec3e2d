"""Forces of an `implicit` sub-step, and its contacts.

`force` is in the order in which the matrix is eliminated, one row per axis; its last column takes
what acts on pins.
"""

import numpy as np

from garment_sim_ros.geometry.jit import kernel

_ONE = np.uint64(1)
_TWO = np.uint64(2)
_THREE = np.uint64(3)


_LOOSE = np.float32(0.5)
"""Up to this share of free fall a particle hangs on others, and does not fall ahead of them."""


@kernel()
def falls(share):
    """How much of what outer forces push the iterations begin with, for a share of free fall.

    Cut short, the iterations move cloth as if it were heavier, but what they begin with it falls
    like anything else: that is work on more than its mass. Cloth that hangs and quivers, which
    makes shares anything between 0 and 1, would be kept quivering by it.
    """
    return max(np.float32(0.0), (share - _LOOSE) / (np.float32(1.0) - _LOOSE))


@kernel()
def predict_with_share(x, v, x_start, x_inertial, share, push, keep, dt):
    """Positions without inner forces, and those from which these are found.

    The latter have only a part of what outer forces push: all of it in free fall, none at rest,
    where the start is then the solution; in between, see `falls`.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities [m/s], shape [n, 3].
        x_start: Output, positions before [m], shape [n, 3].
        x_inertial: Output, positions without inner forces [m], shape [n, 3].
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
            x_inertial[p, k] = start + dt * (coasted + push[k])
            x[p, k] = start + dt * (coasted + fall * push[k])


@kernel()
def edge_forces(x, particles, place, rest_squared, stiffness, force):
    """Forces of edges as springs, the first into `force`, which is cleared.

    With the quotient for 1 - l/d of `kernels.edges`.

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


@kernel()
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
        for axis in range(3):
            # Differences of positions first: weights cancel only up to rounding.
            pull = stiffness[n] * (
                w0 * (x[i, axis] - x[m, axis])
                + w1 * (x[j, axis] - x[m, axis])
                + w2 * (x[k, axis] - x[m, axis])
            )
            force[axis, a] -= w0 * pull
            force[axis, b] -= w1 * pull
            force[axis, c] -= w2 * pull
            force[axis, d] -= w3 * pull


@kernel()
def on_the_cone(ux, uy, uz, nx, ny, nz, gap, friction):
    """A contact's force over its stiffness: the gap along the normal, and as much of u as holds.

    That is the part of u across the normal, shortened to friction times the gap (Coulomb's law).
    """
    along = ux * nx + uy * ny + uz * nz
    ux -= along * nx
    uy -= along * ny
    uz -= along * nz
    slip = np.sqrt(ux * ux + uy * uy + uz * uz)
    limit = friction * gap
    held = np.float32(1.0) if slip <= limit else limit / slip
    return held * ux + gap * nx, held * uy + gap * ny, held * uz + gap * nz


@kernel()
def add_inertia_and_contact(x, x_start, x_inertial, place, inertia, friction, hold, force):
    """Adds m (x_inertial - x) / h^2, and what contacts press and hold.

    A particle beneath its contact's plane is pressed by a spring; along the surface another one
    holds it at its anchor, which moves with the shape, as far as friction goes.

    Args:
        x: Positions [m], shape [free, 3].
        x_start: Positions at the start of the sub-step [m], shape [free, 3].
        x_inertial: Positions without inner forces [m], shape [free, 3].
        place: Column of each particle, shape [free].
        inertia: Mass over squared sub-step, with damping [N/m], shape [free].
        friction: Coulomb coefficient.
        hold: `solvers.implicit.Hold`.
        force: Changed in place [N], shape [3, free + 1].
    """
    zero = np.float32(0.0)
    for p in range(x.shape[0]):
        q = np.uint64(place[p])
        m = inertia[p]
        fx = m * (x_inertial[p, 0] - x[p, 0])
        fy = m * (x_inertial[p, 1] - x[p, 1])
        fz = m * (x_inertial[p, 2] - x[p, 2])
        grip = hold.grip[p]
        if grip > zero:
            nx, ny, nz = hold.normal[p, 0], hold.normal[p, 1], hold.normal[p, 2]
            gap = hold.level[p] - (x[p, 0] * nx + x[p, 1] * ny + x[p, 2] * nz)
            if gap > zero:
                ux = x_start[p, 0] - x[p, 0] + hold.lever[p, 0] + hold.ride[p, 0]
                uy = x_start[p, 1] - x[p, 1] + hold.lever[p, 1] + hold.ride[p, 1]
                uz = x_start[p, 2] - x[p, 2] + hold.lever[p, 2] + hold.ride[p, 2]
                ux, uy, uz = on_the_cone(ux, uy, uz, nx, ny, nz, gap, friction)
                fx += grip * ux
                fy += grip * uy
                fz += grip * uz
        force[0, q] += fx
        force[1, q] += fy
        force[2, q] += fz


@kernel()
def move(x, place, change, step):
    """Adds `step` times the columns [3, free + 1] of `change` to particles [free, 3]."""
    for p in range(x.shape[0]):
        q = np.uint64(place[p])
        x[p, 0] += step * change[0, q]
        x[p, 1] += step * change[1, q]
        x[p, 2] += step * change[2, q]


@kernel()
def new_velocities(
    x, v, x_start, x_inertial, friction, push, keep, dt, blend, share, hold, motion
):
    """Velocities from positions; shares and anchors follow.

    What a contact presses keeps the surface's velocity across it: contact is inelastic, and being
    moved out gives no kick.

    Args:
        x: Positions [m], shape [free, 3].
        v: Velocities, changed in place [m/s], shape [free, 3].
        x_start: Positions at the start of the sub-step [m], shape [free, 3].
        x_inertial: Positions without inner forces [m], shape [free, 3].
        friction: Coulomb coefficient.
        push: Velocity that outer forces add in the sub-step [m/s], shape [3].
        keep: Part of velocity that is kept.
        dt: Sub-step [s].
        blend: How much of the new share counts.
        share: Changed in place, see `predict_with_share`, shape [free].
        hold: `solvers.implicit.Hold`; levers become relative to the new positions.
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
        grip = hold.grip[p]
        nx, ny, nz = hold.normal[p, 0], hold.normal[p, 1], hold.normal[p, 2]
        level = hold.level[p]
        fall = falls(share[p])
        for k in range(3):
            # Where the particle would have been without inner forces and contact.
            level -= hold.normal[p, k] * (x_start[p, k] + dt * (keep * v[p, k] + fall * push[k]))
        gained = zero
        for k in range(3):
            gain = push[k] + (x[p, k] - x_inertial[p, k]) * rate
            v[p, k] = keep * v[p, k] + gain
            gained += gain * push[k]
        now = min(one, max(zero, gained / squared)) if squared > zero else one
        now = share[p] + blend * (now - share[p])
        share[p] = now if now >= zero else one  # Also after something that was not a number.
        if grip > zero:
            gap = hold.level[p] - (x[p, 0] * nx + x[p, 1] * ny + x[p, 2] * nz)
            if max(gap, level) > zero:
                touching += 1
                leaving = (
                    (v[p, 0] - rate * hold.ride[p, 0]) * nx
                    + (v[p, 1] - rate * hold.ride[p, 1]) * ny
                    + (v[p, 2] - rate * hold.ride[p, 2]) * nz
                )
                leaving = max(leaving, zero)
                v[p, 0] -= leaving * nx
                v[p, 1] -= leaving * ny
                v[p, 2] -= leaving * nz
            if gap > zero:
                ux = x_start[p, 0] - x[p, 0] + hold.lever[p, 0] + hold.ride[p, 0]
                uy = x_start[p, 1] - x[p, 1] + hold.lever[p, 1] + hold.ride[p, 1]
                uz = x_start[p, 2] - x[p, 2] + hold.lever[p, 2] + hold.ride[p, 2]
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


@kernel()
def take_hold(x, x_start, x_clear, contacts, carry, lift, grip, hold):
    """Planes of contact after a search with `lift` on top of the thickness.

    Each lies across the way out that the search found, `lift` below where that ends; a particle
    that is pinched between two sides is to go all the way.

    Args:
        x: Positions [m], shape [free, 3].
        x_start: Positions at the start of the sub-step [m], shape [free, 3].
        x_clear: Positions that the search moved to thickness and lift [m], shape [free, 3].
        contacts: What the search found.
        carry: How points move with the shapes in a sub-step, see `PosedShapes`, shape [m, 3, 4].
        lift: How far above a surface contacts are found [m].
        grip: Stiffness of a contact [N/m], shape [free].
        hold: `solvers.implicit.Hold`, changed in place.
    """
    zero = np.float32(0.0)
    for p in range(x.shape[0]):
        c = contacts.shape[p]
        if c < 0:
            hold.grip[p] = zero
            continue
        if hold.grip[p] == zero:
            hold.lever[p] = zero
        hold.grip[p] = grip[p]
        dx = x_clear[p, 0] - x[p, 0]
        dy = x_clear[p, 1] - x[p, 1]
        dz = x_clear[p, 2] - x[p, 2]
        way = np.sqrt(dx * dx + dy * dy + dz * dz)
        if way > np.float32(0.1) * lift:
            way = np.float32(1.0) / way
            hold.normal[p, 0] = way * dx
            hold.normal[p, 1] = way * dy
            hold.normal[p, 2] = way * dz
        else:
            hold.normal[p] = contacts.normal[p]
        level = zero if contacts.depth[p] == np.float32(np.inf) else -lift
        sx, sy, sz = x_start[p, 0], x_start[p, 1], x_start[p, 2]
        for k in range(3):
            level += hold.normal[p, k] * x_clear[p, k]
            hold.ride[p, k] = (
                carry[c, k, 0] * sx + carry[c, k, 1] * sy + carry[c, k, 2] * sz + carry[c, k, 3]
            )
        hold.level[p] = level


@kernel()
def update_diagonal(base, place, owner, hold, diagonal, changed):
    """The matrix's diagonal with the contacts' stiffnesses; marks the fronts that it changes.

    Args:
        base: Without contacts, in the order of elimination [N/m], shape [free].
        place: Column of each particle, shape [free].
        owner: Front of each column, shape [free].
        hold: `solvers.implicit.Hold`.
        diagonal: Changed in place [N/m], shape [free].
        changed: Set where a front has another entry now, shape [fronts].
    """
    for p in range(place.size):
        q = place[p]
        now = base[q] + np.float64(hold.grip[p])
        if now != diagonal[q]:
            diagonal[q] = now
            changed[owner[q]] = True
