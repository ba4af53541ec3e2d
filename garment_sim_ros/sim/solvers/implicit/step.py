"""Implicit Euler steps, solved by a quasi-Newton method with a constant sparse matrix.

Each sub-step looks for the positions of least energy: inertia, edges, hinges and contacts. The
matrix is that of projective dynamics (Bouaziz et al. 2014), an upper bound of the energy's Hessian
that is the same for all three axes; it is factored once and, where contacts come and go, in parts
again. The first of the iterations is a step of projective dynamics, which never goes too far; the
following ones learn from those before (Liu, Bouaziz & Kavan 2017, "Quasi-Newton methods for
real-time simulation of hyperelastic materials"). Stretch goes through the whole garment at once;
folding and swinging, which the matrix resists like stretch, take some iterations.

Prediction follows Chen et al. 2024, "Vertex block descent", section 3.7: gravity counts in the
start of the iterations as far as the particle fell freely before.
"""

import math

import numpy as np

from garment_sim_ros.contact.collide import collide
from garment_sim_ros.contact.packed import pose
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.contact.sweep import sweep
from garment_sim_ros.geometry.transforms import interpolate_poses
from garment_sim_ros.params import ImplicitSettings
from garment_sim_ros.sim.elasticity import GRAVITY
from garment_sim_ros.sim.holds.tether_kernels import pull_tethers
from garment_sim_ros.sim.layers.kernels import measure_motion
from garment_sim_ros.sim.model import ClothModel, Parameters
from garment_sim_ros.sim.solvers.implicit.descent import begin_sub_step, find_positions, keep_up
from garment_sim_ros.sim.solvers.implicit.ties import begin_ties
from garment_sim_ros.sim.solvers.implicit.velocities import new_velocities
from garment_sim_ros.sim.solvers.implicit.workspace import ImplicitWorkspace
from garment_sim_ros.sim.solvers.xpbd.sub_steps import same_poses
from garment_sim_ros.sim.state import ColliderState, State, Workspace

_SEARCHES = 3
"""For contacts in a sub-step, at most: another one where a solution took cloth past a shape."""
_BLEND_TIME = 0.2
"""How long a particle's share of free fall is averaged [s]: less, and cloth at rest creeps."""


def _assign(poses: ColliderPoses, others: ColliderPoses) -> None:
    poses.position[:] = others.position
    poses.orientation[:] = others.orientation


def _stop_the_fast(
    colliders: ColliderState, state: State, workspace: ImplicitWorkspace, thickness: float
) -> int:
    """Stops free particles where they would pass through a shape, see `contact.sweep.sweep`."""
    free, before, coast = len(workspace.share), workspace.cloth.clear, workspace.coast
    before[:] = state.x
    np.add(state.x, workspace.x_predicted, out=coast)
    stopped = sweep(
        colliders.shapes,
        colliders.posed,
        workspace.sides.side,
        colliders.sweep,
        state.x[:free],
        workspace.x_start[:free],
        coast[:free],
        np.float32(thickness),
    )
    if stopped:
        keep_up(state.x, before, workspace.x_predicted)
    return int(stopped)


def step(
    model: ClothModel,
    colliders: ColliderState,
    params: Parameters,
    state: State,
    workspace: Workspace,
    dt: float,
) -> None:
    """Advances one garment by one step, in equal sub-steps.

    Each sub-step: a prediction, pins, a search for contacts there, `iterations` steps towards the
    least energy, velocities, tethers. Fast shapes stop particles that they would pass, as
    predicted and as solved. Does not allocate arrays after the first step of a length.

    Args:
        model: The garment.
        colliders: Colliders at the start and end of the step.
        params: Outer forces and `ImplicitSettings`.
        state: Its motion, changed in place.
        workspace: Its `ImplicitWorkspace`.
        dt: Step [s].
    """
    assert isinstance(workspace, ImplicitWorkspace)
    settings = params.settings
    assert isinstance(settings, ImplicitSettings)
    count = max(1, math.ceil(dt / settings.sub_step - 1e-6))
    h = dt / count
    material, environment = model.material, params.environment
    drag = material.air_drag / material.areal_density
    rate = material.damping + drag
    ties = workspace.prepare(model, h, rate)
    thickness = max(material.thickness, colliders.thickness)
    lift = workspace.lift
    # Who is taken along to a speed u in one sub-step, with 19 others (`_WEIGHTS`), gives
    # way by a small part of the radius of a fast shape at most.
    swift = np.float32(workspace.sink / (GRAVITY * h * h))
    free, clear = model.free_count, workspace.cloth.clear
    x_start, behind = workspace.x_start, workspace.x_predicted
    keep = 1.0 / (1.0 + h * rate)
    for k in range(3):
        pull = environment.gravity[k] + drag * environment.wind[k]
        workspace.push[k] = keep * h * pull
    start, end, hold = colliders.start, colliders.end, workspace.hold
    if workspace.between is None:
        workspace.between = (end.copy(), start.copy())
    before, after = workspace.between
    if not same_poses(start.position, start.orientation, after.position, after.orientation):
        hold.grip[:] = 0.0  # Put somewhere else: what was touched is gone.
    # One sub-step is the step that the shapes are posed for; what stands still, stands.
    between_poses = count > 1 and not same_poses(
        start.position, start.orientation, end.position, end.orientation
    )
    _assign(after, start if between_poses else end)
    for s in range(count):
        if between_poses:
            _assign(before, after)
            interpolate_poses(
                start.position,
                start.orientation,
                end.position,
                end.orientation,
                (s + 1) / count,
                after.position,
                after.orientation,
            )
            pose(colliders.shapes, before, after, colliders.origin, colliders.posed)
        begin_sub_step(
            state.x,
            state.v,
            free,
            x_start,
            behind,
            workspace.share,
            model.pin_collider,
            model.pin_position,
            after.position,
            after.orientation,
            colliders.origin,
            workspace.push,
            np.float32(keep),
            np.float32(h),
        )
        _stop_the_fast(colliders, state, workspace, thickness)
        if len(ties.particle):
            begin_ties(
                *(state.x, x_start, behind, ties),
                *(after.position, after.orientation, colliders.origin),
            )
        for _ in range(_SEARCHES):
            clear[:] = state.x
            collide(
                colliders.shapes,
                colliders.posed,
                workspace.sides,
                clear[:free],
                x_start[:free],
                thickness + lift,
                0.0,
                workspace.contacts,
            )
            find_positions(
                state.x,
                free,
                x_start,
                behind,
                clear,
                ties,
                workspace.cloth,
                hold,
                workspace.past,
                workspace.contacts,
                colliders.posed.carry,
                colliders.sweep.inner_radius,
                np.float32(material.friction),
                np.float32(lift),
                swift,
                settings.iterations,
            )
            if not _stop_the_fast(colliders, state, workspace, thickness):
                break
        workspace.contact_count = new_velocities(
            state.x[:free],
            state.v[:free],
            x_start,
            behind,
            np.float32(material.friction),
            workspace.push,
            np.float32(keep),
            np.float32(h),
            np.float32(min(1.0, h / _BLEND_TIME)),
            workspace.share,
            hold,
            workspace.motion,
        )
        if len(workspace.attached.pin):
            attached = workspace.attached
            attached.held[0] = pull_tethers(
                state.x, state.v, attached.pin, attached.length, np.float32(1.0 / h)
            )
            measure_motion(state.v[:free], workspace.motion)
    _assign(after, end)
