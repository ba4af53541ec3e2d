"""What a simulation is given, in any of the ways in which it may be said."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import ClothNodeParameters, Environment, checked, declarations
from garment_sim_ros.presets import preset_values
from garment_sim_ros.sim.auto.pacer import check_solver, check_unmoved
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.placement import GarmentLike
from garment_sim_ros.sim.solvers import SOLVERS

_BUDGET = "frame_budget_ms"
_DETAIL = "detail"


class OutfitLike(Protocol):
    """What is read of an outfit, as in `garment.outfit.Outfit`."""

    @property
    def garments(self) -> Sequence[GarmentLike]:
        """Its garments."""


def garments_of(given: OutfitLike | GarmentLike | Sequence[GarmentLike]) -> tuple[Any, ...]:
    """The garments of an outfit, of a sequence, or the one garment."""
    garments: Any = getattr(given, "garments", given)
    return (garments,) if hasattr(garments, "vertices") else tuple(garments)


class Numerics(NamedTuple):
    """How a simulation is to be run.

    Attributes:
        solver: Name in `SOLVERS`.
        step: Longest step of the solver [s].
        detail: Share of each garment's vertices that are simulated.
        parameters: Outer forces and the solver's settings.
        budget: Longest time that preset auto lets a frame take [ms]; 0: it moves nothing.
    """

    solver: str
    step: float
    detail: float
    parameters: Parameters
    budget: float


def numerics_of(
    preset: str | None,
    solver: str | None,
    step: float | None,
    detail: float | None,
    environment: Environment | None,
    settings: Any,
    given: Mapping[str, Any],
) -> Numerics:
    """What was asked for: single values win over groups, these over the preset.

    Args:
        preset: Name of a preset; None for the defaults.
        solver: Name in `SOLVERS`; that of the preset where None.
        step: Longest step of the solver [s]; where None that of the preset, else its usual one.
        detail: Share of vertices that are simulated; where None that of the preset, else all.
        environment: Outer forces; those of the preset where None.
        settings: Numerical parameters of the solver; those of the preset where None.
        given: Values of either by name.

    Raises:
        ParameterError: An unknown solver, preset or name, or a value that is not allowed.
    """
    if solver is not None and solver not in SOLVERS:
        raise ParameterError("solver", f"found {solver!r}", f"allowed: {', '.join(SOLVERS)}")
    given = dict(given)
    budget = _budget(preset, given.pop(_BUDGET, 0.0))
    usual = {} if preset is None else preset_values(preset, "cloth_node", solver=solver or "")
    solver = solver or usual.get("solver", "xpbd")
    if step is None:
        step = usual.get("solver_step", SOLVERS[solver].usual_step)
    if not (math.isfinite(step) and step > 0.0):
        raise ParameterError("solver_step", f"found {step!r}", "allowed: above 0 s")
    if detail is None:
        detail = usual.get(_DETAIL, 1.0)
    detail = checked_detail(detail)
    forces = environment or _of_preset(Environment, usual)
    numbers = settings or _of_preset(SOLVERS[solver].settings, usual)
    known = {**declarations(Environment), **declarations(type(numbers))}
    for name in given:
        if name not in known:
            allowed = ", ".join(known)
            raise ParameterError(name, f"unknown to the solver {solver}", f"allowed: {allowed}")
    values = {name: checked(known[name], value) for name, value in given.items()}
    of_forces = {name: v for name, v in values.items() if hasattr(forces, name)}
    of_solver = {name: v for name, v in values.items() if name not in of_forces}
    parameters = Parameters(
        environment=dataclasses.replace(forces, **of_forces),
        settings=dataclasses.replace(numbers, **of_solver),
    )
    if budget:
        check_solver(parameters.settings)
        check_unmoved(vars(parameters.settings), usual)
    return Numerics(solver, step, detail, parameters, budget)


def checked_detail(share: Any) -> float:
    """A share of vertices.

    Raises:
        ParameterError: It is not allowed.
    """
    share = checked(declarations(ClothNodeParameters)[_DETAIL], share)
    return float(share)


def _budget(preset: str | None, value: Any) -> float:
    """The budget of a frame [ms].

    Raises:
        ParameterError: It is not allowed, or there is nothing to keep it with.
    """
    budget: float = checked(declarations(ClothNodeParameters)[_BUDGET], value)
    if budget and preset != "auto":
        raise ParameterError(_BUDGET, f"does nothing with preset {preset}", "allowed with: auto")
    return budget


def _of_preset(group: type, usual: Mapping[str, Any]) -> Any:
    """A group of parameters as a preset has it."""
    return group(**{name: usual[name] for name in declarations(group) if name in usual})
