"""Solvers: a folder each, all with the same verbs, which `sim.loop` calls."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from garment_sim_ros.constants import USUAL_STEP
from garment_sim_ros.params import ImplicitSettings, RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.model import ClothModel, Parameters
from garment_sim_ros.sim.piece import Piece, Step
from garment_sim_ros.sim.solvers.implicit import step as implicit
from garment_sim_ros.sim.solvers.relaxation import step as relaxation
from garment_sim_ros.sim.solvers.xpbd import step as xpbd
from garment_sim_ros.sim.state import Workspace


@dataclass(frozen=True, kw_only=True)
class Solver:
    """One way to advance a garment.

    Attributes:
        workspace: Makes the scratch arrays for a model and a number of shapes.
        settings: Its group of numerical parameters.
        pace: ``pace(piece, params, dt)``: how many sub-steps the garment needs in a step of
            dt [s], and how many for each search for contacts.
        begin: ``begin(piece, step)`` makes ready; tells whether the contacts of the step before
            still hold.
        solve: ``solve(piece, step, first, last, searches)``: sub-steps `first` to `last`, without
            the search for contacts if the last of them `searches`.
        meet: ``meet(piece, step)``: that search, contact and velocities.
        finish: ``finish(piece)``, after all sub-steps.
        usual_step: The step that the default parameters are meant for [s].
        at_once: Steps that follow each other may be taken as one up to so much time [s]; 0 where
            what comes out depends on the step.
    """

    workspace: Callable[[ClothModel, int], Workspace]
    settings: type
    pace: Callable[[Piece, Parameters, float], tuple[int, int]]
    begin: Callable[[Piece, Step], bool]
    solve: Callable[[Piece, Step, int, int, bool], None]
    meet: Callable[[Piece, Step], None]
    finish: Callable[[Piece], None]
    usual_step: float = 1 / 60
    at_once: float = 0.0


SOLVERS: Mapping[str, Solver] = {
    "relaxation": Solver(
        workspace=Workspace.room_for,
        settings=RelaxationSettings,
        pace=relaxation.pace,
        begin=relaxation.begin,
        solve=relaxation.solve,
        meet=relaxation.meet,
        finish=relaxation.finish,
        usual_step=USUAL_STEP,
    ),
    "xpbd": Solver(
        workspace=xpbd.XpbdWorkspace.room_for,
        settings=XpbdSettings,
        pace=xpbd.pace,
        begin=xpbd.begin,
        solve=xpbd.solve,
        meet=xpbd.meet,
        finish=xpbd.finish,
        at_once=1 / 60,
    ),
    "implicit": Solver(
        workspace=implicit.ImplicitWorkspace.room_for,
        settings=ImplicitSettings,
        pace=implicit.pace,
        begin=implicit.begin,
        solve=implicit.solve,
        meet=implicit.meet,
        finish=implicit.finish,
    ),
}
"""Solvers by name."""


def longest_step(solver: str, step: float) -> float:
    """The longest time that a solver takes at once of a clock with a fixed step [s]."""
    return step * max(1, math.floor(SOLVERS[solver].at_once / step + 1e-6))
