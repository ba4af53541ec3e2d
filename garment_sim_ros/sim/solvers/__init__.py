"""Solvers: one file each, all with the same `step`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from garment_sim_ros.params import ImplicitSettings, RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.model import ClothModel, Parameters
from garment_sim_ros.sim.solvers.implicit import step as implicit
from garment_sim_ros.sim.solvers.relaxation import step as relaxation
from garment_sim_ros.sim.solvers.xpbd import step as xpbd
from garment_sim_ros.sim.state import ColliderState, State, Workspace

Step = Callable[[ClothModel, ColliderState, Parameters, State, Workspace, float], None]


@dataclass(frozen=True, kw_only=True)
class Solver:
    """One way to advance a garment.

    Attributes:
        step: ``step(model, collider_state, params, state, workspace, dt)``.
        workspace: Makes the scratch arrays that its step needs for a model and a number of shapes.
        settings: Its group of numerical parameters.
        usual_step: The step that those parameters are meant for [s].
        step_layers: Advances garments over garments that meet within the step, see
            `xpbd.step_layers`; None where they are parted after it.
    """

    step: Step
    workspace: Callable[[ClothModel, int], Workspace]
    settings: type
    usual_step: float = 1 / 60
    step_layers: Callable[..., None] | None = None


SOLVERS: Mapping[str, Solver] = {
    "relaxation": Solver(
        step=relaxation.step,
        workspace=Workspace.room_for,
        settings=RelaxationSettings,
        usual_step=1 / 180,
    ),
    "xpbd": Solver(
        step=xpbd.step,
        workspace=xpbd.XpbdWorkspace.room_for,
        settings=XpbdSettings,
        step_layers=xpbd.step_layers,
    ),
    "implicit": Solver(
        step=implicit.step,
        workspace=implicit.ImplicitWorkspace.room_for,
        settings=ImplicitSettings,
    ),
}
"""Solvers by name."""
