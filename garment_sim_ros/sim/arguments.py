"""What a simulation is given, in any of the ways in which it may be said."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import Environment, checked, declarations
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.placement import GarmentLike
from garment_sim_ros.sim.solvers import SOLVERS

PRESETS = ("balanced",)
"""Names of sets of parameters; `balanced` is the defaults."""


class OutfitLike(Protocol):
    """What is read of an outfit, as in `garment.outfit.Outfit`."""

    @property
    def garments(self) -> Sequence[GarmentLike]:
        """Its garments."""


def garments_of(given: OutfitLike | GarmentLike | Sequence[GarmentLike]) -> tuple[Any, ...]:
    """The garments of an outfit, of a sequence, or the one garment."""
    garments: Any = getattr(given, "garments", given)
    return (garments,) if hasattr(garments, "vertices") else tuple(garments)


def parameters_of(
    solver: str,
    environment: Environment | None,
    settings: Any,
    given: Mapping[str, Any],
) -> Parameters:
    """Outer forces and a solver's settings, with single ones of them replaced.

    Args:
        solver: Name in `SOLVERS`.
        environment: Outer forces; the defaults where None.
        settings: Numerical parameters of the solver; its defaults where None.
        given: Values of either by name.

    Raises:
        ParameterError: A name that neither has, or a value that is not allowed.
    """
    forces = environment or Environment()
    numbers = settings or SOLVERS[solver].settings()
    known = {**declarations(Environment), **declarations(type(numbers))}
    for name in given:
        if name not in known:
            allowed = ", ".join(known)
            raise ParameterError(name, f"unknown to the solver {solver}", f"allowed: {allowed}")
    values = {name: checked(known[name], value) for name, value in given.items()}
    of_forces = {name: v for name, v in values.items() if hasattr(forces, name)}
    of_solver = {name: v for name, v in values.items() if name not in of_forces}
    return Parameters(
        environment=dataclasses.replace(forces, **of_forces),
        settings=dataclasses.replace(numbers, **of_solver),
    )


def check_preset(preset: str | None) -> None:
    """Whether a preset exists.

    Raises:
        ParameterError: It does not.
    """
    if preset is not None and preset not in PRESETS:
        raise ParameterError("preset", f"found {preset!r}", f"allowed: {', '.join(PRESETS)}")
