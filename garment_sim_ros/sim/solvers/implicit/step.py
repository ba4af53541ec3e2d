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

from garment_sim_ros.constants import GRAVITY
from garment_sim_ros.contact.collide import collide
from garment_sim_ros.contact.sweep import sweep
from garment_sim_ros.params import ImplicitSettings
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.holds.tether_kernels import pull_tethers
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.motion import damping_rate, measure_motion, outer_forces
from garment_sim_ros.sim.piece import Piece, Step
from garment_sim_ros.sim.solvers.implicit.descent import begin_sub_step, find_positions, keep_up
from garment_sim_ros.sim.solvers.implicit.given import Met, Moving, PinFrames
from garment_sim_ros.sim.solvers.implicit.ties import begin_ties
from garment_sim_ros.sim.solvers.implicit.velocities import new_velocities
from garment_sim_ros.sim.solvers.implicit.workspace import ImplicitWorkspace
from garment_sim_ros.solver_params import TRIANGLES

_SEARCHES = 3
"""For contacts in a sub-step, at most: another one where a solution took cloth past a shape."""
_BLEND_TIME = 0.2
"""How long a particle's share of free fall is averaged [s]: less, and cloth at rest creeps."""


def pace(piece: Piece, params: Parameters, dt: float) -> tuple[int, int]:
    """How many sub-steps in a step of dt [s]; each has its search for contacts."""
    settings = params.settings
    assert isinstance(settings, ImplicitSettings)
    return max(1, math.ceil(dt / settings.sub_step - 1e-6)), 1


def begin(piece: Piece, step: Step) -> bool:
    """Makes ready for a step: outer forces and the matrix."""
    model, workspace = piece.model, _workspace(piece)
    workspace.keep = outer_forces(model, step.params, step.dt, workspace.push)
    triangles = step.params.settings.membrane == TRIANGLES
    workspace.prepare(model, step.dt, damping_rate(model.material), triangles=triangles)
    if not step.colliders.goes_on:
        workspace.hold.stiffness[:] = 0.0  # Put somewhere else: what was touched is gone.
    return True


def solve(piece: Piece, step: Step, first: int, last: int, searches: bool) -> None:
    """One sub-step, but for its velocities.

    A prediction, pins, a search for contacts there, `iterations` steps towards the least energy.
    Fast shapes stop particles that they would pass, as predicted and as solved. Does not allocate
    arrays.
    """
    _predict(piece, step)
    for _ in range(_SEARCHES):
        _search(piece, step.colliders)
        _descend(piece, step)
        if not _stop_the_fast(piece, step.colliders):
            break


def meet(piece: Piece, step: Step) -> None:
    """Velocities, tethers."""
    model, state, workspace = piece.model, piece.state, _workspace(piece)
    free = model.free_count
    workspace.contact_count = new_velocities(
        state.x[:free],
        state.v[:free],
        workspace.x_start,
        workspace.x_predicted,
        np.float32(model.material.friction),
        workspace.push,
        np.float32(workspace.keep),
        np.float32(step.dt),
        np.float32(min(1.0, step.dt / _BLEND_TIME)),
        workspace.share,
        workspace.hold,
        workspace.motion,
    )
    if len(workspace.attached.pin):
        attached = workspace.attached
        attached.held[0] = pull_tethers(
            state.x, state.v, attached.pin, attached.length, np.float32(1.0 / step.dt)
        )
        measure_motion(state.v[:free], workspace.motion)


def finish(piece: Piece) -> None:
    """Nothing is left to do."""


def _workspace(piece: Piece) -> ImplicitWorkspace:
    workspace = piece.workspace
    assert isinstance(workspace, ImplicitWorkspace)
    return workspace


def _thickness(piece: Piece, colliders: ColliderState) -> float:
    return max(piece.model.material.thickness, colliders.thickness)


def _stop_the_fast(piece: Piece, colliders: ColliderState) -> int:
    """Stops free particles where they would pass through a shape, see `contact.sweep.sweep`."""
    state, workspace = piece.state, _workspace(piece)
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
        np.float32(_thickness(piece, colliders)),
    )
    if stopped:
        keep_up(state.x, before, workspace.x_predicted)
    return int(stopped)


def _predict(piece: Piece, step: Step) -> None:
    """Free particles coast and fall, pins follow bones, a fast shape stops what it would pass."""
    state, workspace = piece.state, _workspace(piece)
    colliders, ties = step.colliders, workspace.ties
    now = colliders.now
    assert ties is not None
    begin_sub_step(
        _moving(piece),
        PinFrames(
            collider=workspace.pins.collider,
            place=workspace.pins.place,
            step=workspace.pins.step,
            position=now.position,
            orientation=now.orientation,
            origin=colliders.origin,
        ),
        workspace.push,
        np.float32(workspace.keep),
        np.float32(step.dt),
    )
    _stop_the_fast(piece, colliders)
    if len(ties.particle):
        begin_ties(
            *(state.x, workspace.x_start, workspace.x_predicted, ties),
            *(now.position, now.orientation, colliders.origin),
        )


def _search(piece: Piece, colliders: ColliderState) -> None:
    """Finds the contacts at the positions as they are."""
    workspace, free = _workspace(piece), piece.model.free_count
    clear = workspace.cloth.clear
    clear[:] = piece.state.x
    collide(
        colliders.shapes,
        colliders.posed,
        workspace.sides,
        clear[:free],
        workspace.x_start[:free],
        _thickness(piece, colliders) + workspace.lift,
        0.0,
        workspace.contacts,
    )


def _descend(piece: Piece, step: Step) -> None:
    """Goes towards the positions of least energy."""
    workspace, colliders, settings = _workspace(piece), step.colliders, step.params.settings
    assert isinstance(settings, ImplicitSettings)
    # A particle that a fast shape accelerates to a speed u in one sub-step, with 19 others
    # (`_WEIGHTS`), sinks in by a small fraction of the shape's radius at most.
    swift = np.float32(workspace.sink / (GRAVITY * step.dt * step.dt))
    find_positions(
        _moving(piece),
        workspace.ties,
        workspace.cloth,
        workspace.hold,
        workspace.past,
        Met(
            contacts=workspace.contacts,
            carry=colliders.posed.carry,
            inner=colliders.sweep.inscribed_radius,
            lift=np.float32(workspace.lift),
            swift=swift,
            friction=np.float32(piece.model.material.friction),
        ),
        settings.iterations,
        settings.most_iterations,
    )


def _moving(piece: Piece) -> Moving:
    """The particles as kernels have them."""
    state, workspace = piece.state, _workspace(piece)
    return Moving(state.x, state.v, workspace.x_start, workspace.x_predicted, workspace.share)
