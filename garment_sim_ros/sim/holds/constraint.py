"""What holds a garment after each of the solver's steps, and in sub-steps where garments rest."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.sim.state import ColliderState, State


class Constraint(ABC):
    """One of them; those that remember something say so in `shift` and `forget`."""

    within = False
    """Whether it acts after each sub-step instead, in solvers that let it."""

    @abstractmethod
    def hold(self, state: State, colliders: ColliderState, dt: float) -> int:
        """Corrects positions and velocities in place; tells how many particles it held."""

    def hold_within(self, state: State, left: float, dt: float) -> int:
        """The same after a sub-step of dt [s], `left` seconds before the end; 0 by default.

        What is held after whole steps only, edges take back in the first sub-step of the next one,
        with a velocity of its way over a sub-step: what is pulled against a limit never rests.
        """
        return 0

    def shift(self, by: NDArray[np.float32]) -> None:  # noqa: B027
        """The local origin has moved: coordinates change by [m], shape [3]."""

    def forget(self) -> None:  # noqa: B027
        """What follows does not depend on what was before: the garment was put elsewhere."""
