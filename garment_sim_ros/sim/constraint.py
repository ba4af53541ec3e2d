"""What holds a garment after each of the solver's steps, whichever solver it is."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.sim.state import ColliderState, State


class Constraint(ABC):
    """One of them; those that remember something say so in `shift` and `forget`."""

    @abstractmethod
    def hold(self, state: State, colliders: ColliderState, dt: float) -> int:
        """Corrects positions and velocities in place; tells how many particles it held."""

    def shift(self, by: NDArray[np.float32]) -> None:  # noqa: B027
        """The local origin has moved: coordinates change by [m], shape [3]."""

    def forget(self) -> None:  # noqa: B027
        """What follows does not depend on what was before: the garment was put elsewhere."""
