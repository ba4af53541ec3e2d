"""What limits where a garment may be, in every sub-step."""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.sim.holds.skin_places import SkinPlaces
from garment_sim_ros.sim.placement import GarmentLike
from garment_sim_ros.sim.state import State, Workspace


class Constraint(ABC):
    """One of them; those that remember something say so in `shift` and `forget`."""

    once_a_step = False
    """Whether it acts in the last sub-step of a step only, for the time of the step."""

    @abstractmethod
    def hold(self, state: State, left: float, dt: float) -> int:
        """Corrects positions and velocities in place after a sub-step.

        What is held after whole steps only, edges take back in the first sub-step of the next one,
        with a velocity of its way over a sub-step: what is pulled against a limit never rests.

        Args:
            state: Motion of the garment, changed in place.
            left: Time to the end of the step [s].
            dt: Sub-step [s].

        Returns:
            Number of particles held.
        """

    def shift(self, by: NDArray[np.float32]) -> None:  # noqa: B027
        """The local origin has moved: coordinates change by [m], shape [3]."""

    def forget(self) -> None:  # noqa: B027
        """What follows does not depend on what was before: the garment was put elsewhere."""


class SkinLimit(Constraint):
    """Limits how free particles lie to their places as skin.

    Args:
        garment: The garment.
        distance: What the limit is for each vertex [m], infinite for none, shape [v].
        places: Where its particles would be as skin, followed through each step.
        workspace: Of its solver; tells where it touches.
    """

    effect: str
    """What it is, in words."""
    holds_what_is_shown: ClassVar[bool] = False
    """Whether what it limits shall not be shown elsewhere than it is, either."""

    @abstractmethod
    def __init__(
        self,
        garment: GarmentLike,
        distance: FloatArray,
        places: SkinPlaces,
        workspace: Workspace,
    ) -> None: ...
