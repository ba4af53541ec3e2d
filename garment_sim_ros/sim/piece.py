"""One garment as the loop over sub-steps has it."""

from dataclasses import dataclass
from typing import NamedTuple

from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.holds.constraint import Constraint
from garment_sim_ros.sim.model import ClothModel, Parameters
from garment_sim_ros.sim.state import State, Workspace


@dataclass(kw_only=True)
class Piece:
    """A garment, its motion, and what acts on it in each sub-step.

    Attributes:
        model: Its particles and springs.
        state: Its motion.
        workspace: Scratch arrays of its solver.
        constraints: What holds it, in the order in which they act.
        held: How many particles they held in the last sub-step.
    """

    model: ClothModel
    state: State
    workspace: Workspace
    constraints: tuple[Constraint, ...] = ()
    held: int = 0


class Step(NamedTuple):
    """A step, as solvers are told it.

    Attributes:
        colliders: The colliders, which move from sub-step to sub-step.
        params: Outer forces and the solver's settings.
        sub_steps: Number of them.
        search_every: Those for each search for contacts; `sub_steps` is a multiple of it.
        dt: Sub-step [s].
    """

    colliders: ColliderState
    params: Parameters
    sub_steps: int
    search_every: int
    dt: float
