"""The first paper's solver: Verlet and a few sweeps of spring correction.

Sun et al. 2007, sections 1.1 to 1.3. Inner forces are never computed; how stiff the cloth looks
depends on the step and on the number of sweeps, not on the material's stiffnesses.
"""

import numpy as np

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.contact.collide import collide
from garment_sim_ros.contact.papers.earliest.contact import EarliestContact
from garment_sim_ros.contact.papers.rays.contact import meet_rays
from garment_sim_ros.contact.sweep import sweep
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.motion import (
    measure_motion,
    move_pins,
    outer_forces,
    predict,
    update_velocities,
)
from garment_sim_ros.sim.piece import Piece, Step
from garment_sim_ros.sim.solvers.relaxation.springs import correct_springs


def pace(piece: Piece, params: Parameters, dt: float) -> tuple[int, int]:
    """One sub-step in each step, with a search for contacts."""
    return 1, 1


def begin(piece: Piece, step: Step) -> bool:
    """Makes ready for a step: outer forces."""
    workspace = piece.workspace
    workspace.keep = outer_forces(piece.model, step.params, step.dt, workspace.push)
    return True


def solve(piece: Piece, step: Step, first: int, last: int, searches: bool) -> None:
    """Outer forces and Verlet, pins, sweeps over all springs, tethers and soft attachments."""
    _predict(piece, step.colliders, np.float32(step.dt))
    _correct(piece, step)


def meet(piece: Piece, step: Step) -> None:
    """Contact as an absolute constraint, and velocities. Does not allocate arrays."""
    model, state, workspace = piece.model, piece.state, piece.workspace
    if step.params.settings.contact == "earliest":
        _meet_earliest(piece, step)
        return
    if step.params.settings.contact == "rays":
        _meet_along_rays(piece, step)
        return
    carry = _meet(piece, step.colliders)
    free, contacts = model.free_count, workspace.contacts
    update_velocities(
        state.x[:free],
        state.v[:free],
        workspace.x_start[:free],
        workspace.x_predicted[:free],
        contacts.shape,
        contacts.normal,
        carry,
        np.float32(step.dt),
        workspace.motion,
    )


def finish(piece: Piece) -> None:
    """Nothing is left to do."""


def _predict(piece: Piece, colliders: ColliderState, h: np.float32) -> None:
    """Free particles fall, pins follow their bones."""
    model, state, workspace = piece.model, piece.state, piece.workspace
    free = model.free_count
    predict(
        state.x[:free],
        state.v[:free],
        workspace.x_start[:free],
        workspace.x_predicted[:free],
        workspace.push,
        np.float32(workspace.keep),
        h,
    )
    move_pins(
        state.x[free:],
        state.v[free:],
        workspace.pins.collider,
        workspace.pins.place,
        workspace.pins.step,
        colliders.now.position,
        colliders.now.orientation,
        colliders.origin,
        h,
    )


def _correct(piece: Piece, step: Step) -> None:
    """Sweeps over the springs, tethers and soft attachments."""
    state, workspace, colliders = piece.state, piece.workspace, step.colliders
    springs = piece.model.springs
    correct_springs(
        state.x.reshape(-1),
        workspace.wide,
        springs.particles,
        springs.drawn_length,
        springs.share,
        springs.colour_start,
        step.params.settings.sweeps,
    )
    if workspace.attached.is_anything:
        workspace.attached.pull(
            *(state.x, state.v, workspace.x_start, colliders.now, colliders.origin),
            keep=workspace.keep,
            dt=step.dt,
            rate=0.0,
        )


def _meet(piece: Piece, colliders: ColliderState) -> SingleArray:
    """Contact with the shapes or the skin; how points move with these."""
    model, state, workspace = piece.model, piece.state, piece.workspace
    free, material = model.free_count, model.material
    x, x_start = state.x[:free], workspace.x_start[:free]
    thickness, contacts = max(material.thickness, colliders.thickness), workspace.contacts
    if colliders.skin is not None:
        workspace.contact_count, carry = colliders.skin.meet(
            x, x_start, thickness, material.friction, contacts
        )
        return carry
    sweep(
        colliders.shapes,
        colliders.posed,
        workspace.sides.side,
        colliders.sweep,
        x,
        x_start,
        workspace.x_predicted[:free],
        np.float32(thickness),
    )
    workspace.contact_count = collide(
        colliders.shapes,
        colliders.posed,
        workspace.sides,
        x,
        x_start,
        thickness,
        material.friction,
        contacts,
    )
    return colliders.posed.carry


def _meet_earliest(piece: Piece, step: Step) -> None:
    """Contact by the earliest hit, and velocities."""
    model, state, workspace = piece.model, piece.state, piece.workspace
    colliders, h = step.colliders, step.dt
    free, material = model.free_count, model.material
    x, v, x_predicted = state.x[:free], state.v[:free], workspace.x_predicted[:free]
    if workspace.earliest is None:
        workspace.earliest = EarliestContact(colliders.shapes)
    # What the springs moved is velocity before the hit, not after it.
    np.subtract(x, x_predicted, out=x_predicted)
    x_predicted /= np.float32(h)
    v += x_predicted
    workspace.contact_count = workspace.earliest.meet(
        colliders.shapes,
        colliders.posed,
        workspace.x_start[:free],
        x,
        v,
        max(material.thickness, colliders.thickness),
        material.friction,
        step.params.settings,
        h,
        workspace.contacts.shape,
    )
    measure_motion(v, workspace.motion)


def _meet_along_rays(piece: Piece, step: Step) -> None:
    """Contact along rays from inside, and velocities."""
    state, workspace, colliders = piece.state, piece.workspace, step.colliders
    free = piece.model.free_count
    x, v = state.x[:free], state.v[:free]
    workspace.contact_count = int(
        meet_rays(
            colliders.shapes,
            colliders.posed,
            colliders.rays,
            x,
            v,
            workspace.x_predicted[:free],
            np.float32(step.dt),
            workspace.contacts.shape,
        )
    )
    measure_motion(v, workspace.motion)
