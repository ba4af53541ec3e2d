"""A simulation that runs at the level which its frames' times ask for."""

import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import Any, Protocol

from garment_sim_ros.declaration import shown
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import XpbdSettings
from garment_sim_ros.sim.auto.controller import Change, Controller
from garment_sim_ros.sim.auto.levels import LEVELS, MOVED, START, Level
from garment_sim_ros.sim.auto.own_front import own_levels
from garment_sim_ros.sim.model import Parameters


class Paced(Protocol):
    """What is read and set of a `Simulation`."""

    parameters: Parameters
    detail: float

    def prepare(self, share: float) -> None:
        """Makes what it takes to set `detail`."""


class Pacer:
    """Sets sub-steps, searches and share of vertices of a simulation between its frames.

    Neither positions nor velocities change with the level: stiffnesses are physical, and the
    next frame goes on from where the last one ended; only folds that fewer vertices cannot have
    go, within some tenths of a second. Kernels are the same for all levels. As a context it takes
    the time of one frame.

    Args:
        simulation: Of the solver `xpbd`.
        budget: Longest time that a frame may take [ms].
        rate: Of the frames [Hz].
        levels: From cheap to accurate; one is called as `START` says.

    Attributes:
        changes: How often the level changed.
        cause: Why it did last, in words.

    Raises:
        ParameterError: Another solver.
    """

    def __init__(
        self,
        simulation: Paced,
        budget: float,
        rate: float = 60.0,
        levels: Sequence[Level] = LEVELS,
    ) -> None:
        check_solver(simulation.parameters.settings)
        self._simulation, self._most = simulation, simulation.detail
        # A level whose share is no less than that asked for is the next one, but for its cost.
        levels = [lv for lv in levels if lv.detail == 1.0 or lv.detail < self._most]
        self._levels = tuple(levels)
        for share in details(simulation.detail, levels):
            simulation.prepare(share)
        start = [level.name for level in levels].index(START)
        shelter = next(n for n, level in enumerate(levels) if level.detail == 1.0)
        costs = [level.cost for level in levels]
        self._controller = Controller(costs, budget, rate, start, min(start, shelter))
        self._began = 0.0
        self.changes = 0
        self.cause = "start"
        self.apply()

    @classmethod
    def of(cls, simulation: Paced, budget: float) -> "AbstractContextManager[Pacer | None]":
        """One that times frames on the machine's own front; nothing where the budget is 0 [ms]."""
        return cls(simulation, budget, levels=own_levels().levels) if budget else nullcontext()

    @property
    def number(self) -> int:
        """Number of the level; 0 is the lowest."""
        return self._controller.level

    @property
    def level(self) -> Level:
        """The level."""
        return self._levels[self.number]

    @property
    def budget(self) -> float:
        """Longest time that a frame may take [ms]; may be set."""
        return self._controller.budget

    @budget.setter
    def budget(self, budget: float) -> None:
        self._controller.budget = budget

    def apply(self) -> None:
        """Have the simulation run at the level, whatever parameters it was given."""
        now = self._simulation.parameters
        settings = now.settings
        assert isinstance(settings, XpbdSettings)
        if (moved := self.level.settings(settings)) != settings:
            self._simulation.parameters = replace(now, settings=moved)
        self._simulation.detail = min(self._most, self.level.detail)

    def frame(self, work: float, waited: float = 0.0, *, behind: bool = False) -> Change | None:
        """Take a frame's times, see `Controller.frame`; the next one runs at what follows."""
        change = self._controller.frame(work, waited, behind=behind)
        if change is not None:
            self.changes += 1
            self.cause = change.cause
            self.apply()
        return change

    def name(self, number: int) -> str:
        """Name of a level."""
        return self._levels[number].name

    def __enter__(self) -> "Pacer":
        self._began = time.perf_counter()
        return self

    def __exit__(self, *error: Any) -> None:
        if error[0] is None:
            self.frame(1e3 * (time.perf_counter() - self._began))


def details(most: float, levels: Sequence[Level] = LEVELS) -> set[float]:
    """Shares of the vertices that levels have where so many may be simulated."""
    return {min(most, level.detail) for level in levels}


def check_solver(settings: Any) -> None:
    """See that settings are such as levels move.

    Raises:
        ParameterError: They are another solver's.
    """
    if not isinstance(settings, XpbdSettings):
        found = type(settings).__name__.removesuffix("Settings").lower()
        raise ParameterError(
            "solver", f"found {found!r}, which preset auto cannot control", "allowed: xpbd"
        )


def check_unmoved(given: Mapping[str, Any], usual: Mapping[str, Any]) -> None:
    """See that nobody sets what levels move.

    Args:
        given: Parameters by name.
        usual: What the preset says.

    Raises:
        ParameterError: One of `given` is another one than the preset says.
    """
    for name in MOVED:
        if given.get(name) != usual.get(name):
            raise ParameterError(
                name,
                f"found {shown(given.get(name))}, but preset auto controls it",
                "allowed: to leave it out, or another preset",
            )
