"""The first paper's solver: Verlet and a few sweeps of spring correction.

Sun et al. 2007, sections 1.1 to 1.3. Inner forces are never computed; how stiff the cloth looks
depends on the step and on the number of sweeps, not on the material's stiffnesses.
"""

import numpy as np

from garment_sim_ros.contact.collide import collide
from garment_sim_ros.contact.papers.earliest.contact import EarliestContact
from garment_sim_ros.contact.sweep import sweep
from garment_sim_ros.sim.layers.kernels import measure_motion
from garment_sim_ros.sim.model import ClothModel, Parameters
from garment_sim_ros.sim.motion import carry_pins, predict, update_velocities
from garment_sim_ros.sim.solvers.relaxation.springs import correct_springs
from garment_sim_ros.sim.state import ColliderState, State, Workspace


def step(
    model: ClothModel,
    colliders: ColliderState,
    params: Parameters,
    state: State,
    workspace: Workspace,
    dt: float,
) -> None:
    """Advances one garment by one step.

    Outer forces and Verlet, pins, `sweeps` passes over all springs, tethers and soft attachments,
    collision as an absolute constraint, velocities. Does not allocate arrays.

    Args:
        model: The garment.
        colliders: Colliders at the start and end of the step.
        params: Outer forces and number of sweeps.
        state: Its motion, changed in place.
        workspace: Its scratch arrays.
        dt: Step [s].
    """
    free = model.free_count
    x, v = state.x[:free], state.v[:free]
    x_start, x_predicted = workspace.x_start[:free], workspace.x_predicted[:free]
    h = np.float32(dt)

    material, environment = model.material, params.environment
    drag = material.air_drag / material.areal_density
    keep = 1.0 / (1.0 + dt * (material.damping + drag))
    for k in range(3):
        pull = environment.gravity[k] + drag * environment.wind[k]
        workspace.push[k] = keep * dt * pull
    predict(x, v, x_start, x_predicted, workspace.push, np.float32(keep), h)

    carry_pins(
        state.x[free:],
        state.v[free:],
        model.pin_collider,
        model.pin_position,
        colliders.end.position,
        colliders.end.orientation,
        colliders.origin,
        h,
    )

    springs, settings = model.springs, params.settings
    arrays = (state.x.reshape(-1), springs.particles, springs.rest_length, springs.share)
    correct_springs(*arrays, settings.sweeps)
    if workspace.attached.is_anything:
        workspace.attached.pull(
            *(state.x, state.v, workspace.x_start, colliders.end, colliders.origin),
            keep=keep,
            dt=dt,
            rate=0.0,
        )

    contacts, carry = workspace.contacts, colliders.posed.carry
    thickness = max(material.thickness, colliders.thickness)
    if params.settings.contact == "earliest":
        if workspace.earliest is None:
            workspace.earliest = EarliestContact(colliders.shapes)
        # What the springs moved is velocity before the hit, not after it.
        np.subtract(x, x_predicted, out=x_predicted)
        x_predicted /= h
        v += x_predicted
        workspace.contact_count = workspace.earliest.meet(
            colliders.shapes,
            colliders.posed,
            x_start,
            x,
            v,
            thickness,
            material.friction,
            params.settings,
            dt,
            contacts.shape,
        )
        measure_motion(v, workspace.motion)
        return
    if colliders.skin is not None:
        workspace.contact_count, carry = colliders.skin.meet(
            x, x_start, thickness, material.friction, contacts
        )
    else:
        sweep(
            colliders.shapes,
            colliders.posed,
            workspace.sides.side,
            colliders.sweep,
            x,
            x_start,
            x_predicted,
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
    update_velocities(
        x,
        v,
        x_start,
        x_predicted,
        contacts.shape,
        contacts.normal,
        carry,
        h,
        workspace.motion,
    )
