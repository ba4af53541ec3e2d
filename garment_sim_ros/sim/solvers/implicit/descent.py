"""A sub-step of `implicit`: the prediction, and the positions of least energy."""

import numpy as np

from garment_sim_ros.geometry.copying import copy
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.motion import move_pins
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
from garment_sim_ros.sim.solvers.implicit.triangles import triangle_forces

_TOO_FAR = 0.9
"""A step that ends where energy grows along it as fast as this share of how it fell is cut."""


@kernel(inner=True)
def all_forces(moving, ties, cloth, friction, hold, force):
    """Less the gradient of a sub-step's energy [N], in the order of elimination, [3, free + 1]."""
    x, free = moving.x, moving.share.size
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
    triangle_forces(x, cloth.triangles, force)
    add_inertia_and_contact(
        x[:free], moving.x_start, moving.behind, cloth.place, cloth.inertia, friction, hold, force
    )
    add_ties(cloth.place, ties, force)
    force[:, free] = np.float32(0.0)


@kernel(inner=True)
def advance(moving, ties, place, direction, step):
    """Goes so much of a direction [3, free + 1]."""
    move(moving.x[: moving.share.size], moving.behind, place, direction, step)
    follow_ties(place, ties, direction, step)


@kernel(inner=True)
def minimise(moving, ties, cloth, friction, hold, past, iterations, most):
    """Steps towards the least energy, from x, which is changed in place.

    So many iterations; up to `most` where the last of them still gained more than `cloth.enough`.
    """
    force, other, direction = past.now, past.next, past.direction
    all_forces(moving, ties, cloth, friction, hold, force)
    count = 0
    for i in range(max(iterations, most)):
        descend(force, cloth.fronts, cloth.factor, cloth.scratch, past, count, direction)
        before = dot(force, direction)
        if not before > 0.0:
            break
        advance(moving, ties, cloth.place, direction, np.float32(1.0))
        last = i + 1 >= (iterations if before <= cloth.enough else max(iterations, most))
        if last and count == 0:
            break  # The matrix is an upper bound: the first step is never too long.
        all_forces(moving, ties, cloth, friction, hold, other)
        after = dot(other, direction)
        step = 1.0
        if after < -_TOO_FAR * before:
            step = before / (before - after)
            advance(moving, ties, cloth.place, direction, np.float32(step - 1.0))
            all_forces(moving, ties, cloth, friction, hold, other)
        if last:
            break
        count = remember(past, count, direction, step, force, other)
        force, other = other, force


@kernel()
def begin_sub_step(moving, pins, push, keep, dt):
    """Free particles coast and fall, pinned ones move with their colliders.

    Args:
        moving: `Moving`; all but the velocities of free particles is changed in place.
        pins: `PinFrames`.
        push: Velocity that outer forces add in the sub-step [m/s], shape [3].
        keep: Part of velocity that is kept.
        dt: Sub-step [s].
    """
    x, v, x_start, free = moving.x, moving.v, moving.x_start, moving.share.size
    predict_with_share(x[:free], v[:free], x_start, moving.behind, moving.share, push, keep, dt)
    copy(x[free:], x_start[free:])
    move_pins(
        x[free:],
        v[free:],
        pins.collider,
        pins.place,
        pins.step,
        pins.position,
        pins.orientation,
        pins.origin,
        dt,
    )


@kernel()
def keep_up(x, x_before, behind):
    """`behind` after particles were put elsewhere than `x_before`; arrays [n, 3]."""
    for p in range(x.shape[0]):
        for k in range(3):
            behind[p, k] += x_before[p, k] - x[p, k]


@kernel()
def find_positions(moving, ties, cloth, hold, past, met, iterations, most):
    """From a prediction and the contacts found there to the positions of least energy.

    Args:
        moving: `Moving`; positions are changed in place, and what follows them.
        ties: `solvers.implicit.given.Ties`.
        cloth: `solvers.implicit.given.Cloth`; `clear` are the positions that the search moved
            to thickness and lift.
        hold: `solvers.implicit.given.Hold`.
        past: `solvers.implicit.given.Past`.
        met: `solvers.implicit.given.Met`.
        iterations: Steps towards the least energy, see `minimise`.
        most: Likewise.
    """
    take_hold(moving.x[: moving.share.size], moving.x_start, cloth, met, hold)
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
    minimise(moving, ties, cloth, met.friction, hold, past, iterations, most)
