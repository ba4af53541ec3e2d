"""Letting a garment come to rest on a body that stands still."""

from collections.abc import Callable

from garment_sim_ros.constants import USUAL_STEP
from garment_sim_ros.sim.worn import Worn

_COARSE_STEP = USUAL_STEP
"""A finer step first settles with this one: draping takes seconds, whatever the step."""
_STEP_LIMIT = 900
"""Steps of either size after which a garment stops all the same."""
_CALM = 2e-3
"""A garment is at rest when the RMS speed peaks below this [m/s]."""
_SHORTEST_CALM = 0.1
"""A peak counts only after this time [s]: the first ones can be low by chance."""


def settle(step: Callable[[float], None], worn: Worn, dt: float) -> int:
    """Steps a garment with kinetic damping until it hardly moves, then stops it.

    Whenever the kinetic energy falls, all velocities are set to zero: the motion that passed
    through a low of potential energy ends there. This finds the rest shape in a fraction of the
    time of viscous damping, which must be weak for slow swinging and strong for fast. The step is
    the simulation's own, so that what is calm here stays calm later.

    Args:
        step: Takes a step of so many seconds; the colliders stand still.
        worn: The garment; velocities are zero afterwards.
        dt: Step [s].

    Returns:
        Number of steps taken.
    """
    taken = 0
    v, calm = worn.state.v, worn.model.free_count * _CALM**2
    for h in (max(dt, _COARSE_STEP), dt)[dt >= _COARSE_STEP :]:
        v[:] = 0.0
        highest = 0.0
        for n in range(_STEP_LIMIT):
            step(h)
            taken += 1
            energy = worn.workspace.motion[0]
            if energy >= highest:
                highest = energy
                continue
            v[:] = 0.0
            if highest < calm and n * h > _SHORTEST_CALM:
                break
            highest = 0.0
    v[:] = 0.0
    return taken
