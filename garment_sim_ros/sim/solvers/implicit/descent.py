"""A sub-step of `implicit`: the prediction, and the positions of least energy."""

import numpy as np

from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.motion import carry_pins
from garment_sim_ros.sim.solvers.implicit.cholesky import factorise
from garment_sim_ros.sim.solvers.implicit.contact import take_hold, update_diagonal
from garment_sim_ros.sim.solvers.implicit.forces import (
    add_inertia_and_contact,
    edge_forces,
    hinge_forces,
    move,
    predict_with_share,
)
from garment_sim_ros.sim.solvers.implicit.lbfgs import descend, dot, remember
from garment_sim_ros.sim.solvers.implicit.ties import add_ties, follow_ties

_TOO_FAR = 0.9
"""A step that ends where energy grows along it as fast as this share of how it fell is cut."""


@kernel(inner=True)
def all_forces(x, free, x_start, behind, ties, cloth, friction, hold, force):
    """Less the gradient of a sub-step's energy [N], in the order of elimination, [3, free + 1]."""
    edge_forces(
        x.reshape(-1),
        cloth.edge_particles,
        cloth.edge_place,
        cloth.rest_squared,
        cloth.edge_stiffness,
        force,
    )
    hinge_forces(
        x,
        cloth.hinge_particles,
        cloth.hinge_place,
        cloth.hinge_weight,
        cloth.hinge_stiffness,
        force,
    )
    add_inertia_and_contact(
        x[:free], x_start, behind, cloth.place, cloth.inertia, friction, hold, force
    )
    add_ties(cloth.place, ties, force)
    force[:, free] = np.float32(0.0)


@kernel(inner=True)
def advance(x, behind, ties, place, direction, step):
    """Goes so much of a direction [3, free + 1]."""
    move(x, behind, place, direction, step)
    follow_ties(place, ties, direction, step)


@kernel(inner=True)
def minimise(x, free, x_start, behind, ties, cloth, friction, hold, past, iterations):
    """Steps towards the least energy, from x, which is changed in place."""
    force, other, direction = past.now, past.next, past.direction
    all_forces(x, free, x_start, behind, ties, cloth, friction, hold, force)
    count = 0
    for i in range(iterations):
        descend(force, cloth.fronts, cloth.factor, cloth.scratch, past, count, direction)
        before = dot(force, direction)
        if not before > 0.0:
            break
        advance(x[:free], behind, ties, cloth.place, direction, np.float32(1.0))
        if i + 1 == iterations and count == 0:
            break  # The matrix is an upper bound: the first step is never too long.
        all_forces(x, free, x_start, behind, ties, cloth, friction, hold, other)
        after = dot(other, direction)
        step = 1.0
        if after < -_TOO_FAR * before:
            step = before / (before - after)
            advance(x[:free], behind, ties, cloth.place, direction, np.float32(step - 1.0))
            all_forces(x, free, x_start, behind, ties, cloth, friction, hold, other)
        count = remember(past, count, direction, step, force, other)
        force, other = other, force


@kernel()
def begin_sub_step(
    x,
    v,
    free,
    x_start,
    behind,
    share,
    pin_collider,
    pin_position,
    position,
    orientation,
    origin,
    push,
    keep,
    dt,
):
    """Free particles coast and fall, pinned ones follow their bones.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities; those of pins are changed in place [m/s], shape [n, 3].
        free: Number of free particles, the first ones.
        x_start: Output, positions before [m], shape [n, 3].
        behind: Output, see `predict_with_share`, shape [n, 3].
        share: See `predict_with_share`, shape [free].
        pin_collider: Collider that each pin follows, shape [p].
        pin_position: Its place in that collider's frame [m], shape [p, 3].
        position: Of all colliders at the end of the sub-step [m], shape [c, 3].
        orientation: Their unit quaternions, shape [c, 4].
        origin: World position of the local origin [m], shape [3].
        push: Velocity that outer forces add in the sub-step [m/s], shape [3].
        keep: Part of velocity that is kept.
        dt: Sub-step [s].
    """
    predict_with_share(x[:free], v[:free], x_start, behind, share, push, keep, dt)
    x_start[free:] = x[free:]
    carry_pins(x[free:], v[free:], pin_collider, pin_position, position, orientation, origin, dt)


@kernel()
def keep_up(x, x_before, behind):
    """`behind` after particles were put elsewhere than `x_before`; arrays [n, 3]."""
    for p in range(x.shape[0]):
        for k in range(3):
            behind[p, k] += x_before[p, k] - x[p, k]


@kernel()
def find_positions(
    x,
    free,
    x_start,
    behind,
    x_clear,
    ties,
    cloth,
    hold,
    past,
    contacts,
    carry,
    inner,
    friction,
    lift,
    swift,
    iterations,
):
    """From a prediction and the contacts found there to the positions of least energy.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        free: Number of free particles, the first ones.
        x_start: Positions at the start [m], shape [n, 3].
        behind: See `predict_with_share`; follows x, shape [n, 3].
        x_clear: Positions that the search moved to thickness and lift [m], shape [n, 3].
        ties: `solvers.implicit.workspace.Ties`.
        cloth: `solvers.implicit.workspace.Cloth`.
        hold: `solvers.implicit.workspace.Hold`.
        past: `solvers.implicit.workspace.Past`.
        contacts: What the search found.
        carry: How points move with the shapes in the sub-step, see `PosedShapes`.
        inner: Radius of a ball that fits into each shape [m], shape [m].
        friction: Coulomb coefficient.
        lift: How far above a surface contacts are found [m].
        swift: See `take_hold`.
        iterations: Steps towards the least energy.
    """
    take_hold(x[:free], x_start, x_clear, contacts, carry, inner, lift, cloth.grip, swift, hold)
    update_diagonal(
        cloth.base, cloth.place, cloth.fronts.owner, hold, cloth.diagonal, cloth.changed
    )
    factorise(
        cloth.fronts,
        cloth.stiffness,
        cloth.diagonal,
        cloth.changed,
        cloth.front,
        cloth.update,
        cloth.factor,
    )
    minimise(x, free, x_start, behind, ties, cloth, friction, hold, past, iterations)
