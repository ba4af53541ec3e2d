"""Letting a garment come to rest on a body that stands still."""

from garment_sim_ros.sim.model import ClothModel, Parameters
from garment_sim_ros.sim.solvers import Step
from garment_sim_ros.sim.state import ColliderState, State, Workspace

_COARSE_STEP = 1 / 180
"""A finer step first settles with this one [s]: draping takes seconds, whatever the step."""
_STEP_LIMIT = 900
"""Steps of either size after which a garment stops all the same."""
_CALM = 2e-3
"""A garment is at rest when the RMS speed peaks below this [m/s]."""
_SHORTEST_CALM = 0.1
"""A peak counts only after this time [s]: the first ones can be low by chance."""


def settle(
    step: Step,
    model: ClothModel,
    colliders: ColliderState,
    params: Parameters,
    state: State,
    workspace: Workspace,
    dt: float,
) -> int:
    """Steps a garment with kinetic damping until it hardly moves, then stops it.

    Whenever the kinetic energy falls, all velocities are set to zero: the motion that passed
    through a low of potential energy ends there. This finds the rest shape in a fraction of the
    time of viscous damping, which must be weak for slow swinging and strong for fast. The step is
    the solver's own, so that what is calm here stays calm later.

    Args:
        step: The solver's step.
        model: The garment.
        colliders: Colliders, the same at the start and end of the step.
        params: Outer forces and settings.
        state: Its motion, changed in place; velocities are zero afterwards.
        workspace: Its scratch arrays.
        dt: Step [s].

    Returns:
        Number of steps taken.
    """
    taken = 0
    calm = model.free_count * _CALM**2
    for h in (max(dt, _COARSE_STEP), dt)[dt >= _COARSE_STEP :]:
        state.v[:] = 0.0
        highest = 0.0
        for n in range(_STEP_LIMIT):
            step(model, colliders, params, state, workspace, h)
            taken += 1
            energy = workspace.motion[0]
            if energy >= highest:
                highest = energy
                continue
            state.v[:] = 0.0
            if highest < calm and n * h > _SHORTEST_CALM:
                break
            highest = 0.0
    state.v[:] = 0.0
    return taken
