"""The preset `auto` in a node: frames are timed from when they are due, and changes are told."""

import time
from collections.abc import Callable, Sequence
from typing import Any

from garment_sim_ros.params import ClothNodeParameters
from garment_sim_ros.presets import preset_values
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.ros.ticker import Ticker
from garment_sim_ros.sim.auto.levels import Level
from garment_sim_ros.sim.auto.own_front import own_levels
from garment_sim_ros.sim.auto.pacer import Pacer, check_solver, check_unmoved
from garment_sim_ros.stamps import SECOND

AUTO = "auto"
SHARE = 0.7
"""Part of a frame's period that it may take where no budget is given: much of it is done before
the frame is due, and the other nodes need a core as well."""
_BEHIND = 2
"""More frames' time than this makes the cloth be behind."""
_NOT = "time must not decide where step_on is poses: preset auto runs as balanced does"


class Pace:
    """Keeps a stepper's frames within their budget, or does nothing.

    Args:
        stepper: Of the garments.
        p: The node's parameters.
        preset: Name of the node's preset.
        log: Takes a line of text.
        levels: What it moves between; those of this machine where None.
    """

    def __init__(
        self,
        stepper: ClothStepper,
        p: ClothNodeParameters,
        preset: str,
        log: Callable[[str], Any],
        levels: Sequence[Level] | None = None,
    ) -> None:
        self._stepper = stepper
        self._log = log
        self._pacer: Pacer | None = None
        self._began = self._waited = self._work = 0.0
        self._free = 0
        if preset != AUTO:
            return
        if p.step_on == "poses":
            log(_NOT)
            return
        self._most = _BEHIND / p.rate / p.solver_step + 0.5
        own = own_levels()
        levels = own.levels if levels is None else levels
        log(f"auto: {len(levels)} levels, costs {own.told}; {budget_of(p):.3g} ms for a frame")
        self._pacer = Pacer(stepper.simulation, budget_of(p), p.rate, levels)
        stepper.never_coarse()

    def apply(self) -> None:
        """Go on at the level after the simulation was given other parameters."""
        if self._pacer is not None:
            self._pacer.apply()

    def take(self, p: ClothNodeParameters) -> None:
        """Take over another budget."""
        if self._pacer is not None:
            self._pacer.budget = budget_of(p)

    def begin(self) -> None:
        """Work at a frame begins."""
        self._began = time.perf_counter()

    def wait(self, ticker: Ticker, due: int) -> None:
        """A frame is made now that was due at a time of the ticker's [ns].

        Where work ahead of it went on until then nothing was waited for.
        """
        if not ticker.is_simulated:
            self._waited = max(0.0, 1e3 * (ticker.now() - max(due, self._free)) / SECOND)

    def rest(self, ticker: Ticker) -> None:
        """Work at it ends for now, ahead of the frame."""
        self._work += 1e3 * (time.perf_counter() - self._began)
        self._free = ticker.now()

    def look(self, until: int) -> int:
        """See how much is due up to a time [ns], before it is simulated; the same time."""
        stepper = self._stepper
        is_steady = self._pacer is not None and not stepper.is_behind
        if is_steady and stepper.due(until) > self._most:
            self._frame(0.0, self._waited, behind=True)
        return until

    def end(self, *, moved: bool) -> None:
        """A frame ends; those in which garments are put on, or stand, do not count."""
        work, waited = self._work + 1e3 * (time.perf_counter() - self._began), self._waited
        self._work = self._waited = 0.0
        if self._pacer is not None and moved and not self._stepper.is_behind:
            self._frame(work, waited)

    def figures(self) -> dict[str, object]:
        """What goes to `quality` and to diagnostics."""
        if self._pacer is None:
            return {}
        return {
            "auto_level": self._pacer.number,
            "auto_sub_steps": self._pacer.level.sub_steps,
            "auto_detail": self._stepper.simulation.detail,
            "auto_changes": self._pacer.changes,
            "auto_name": self._pacer.level.name,
            "auto_cause": self._pacer.cause,
            "frame_budget_ms": self._pacer.budget,
        }

    def _frame(self, work: float, waited: float, *, behind: bool = False) -> None:
        assert self._pacer is not None
        change = self._pacer.frame(work, waited, behind=behind)
        if change is not None:
            before, after = map(self._pacer.name, change[:2])
            self._log(f"auto: from {before} to {after}, {change.cause}")


def moves(preset: str, p: ClothNodeParameters) -> bool:
    """Whether a node's preset moves anything."""
    return preset == AUTO and p.step_on != "poses"


def budget_of(p: ClothNodeParameters) -> float:
    """Longest time that a frame may take [ms]."""
    return p.frame_budget_ms or 1e3 * SHARE / p.rate


def check_pace(preset: str, settings: Any, p: ClothNodeParameters) -> None:
    """See that nothing is given that `auto` moves.

    Raises:
        ParameterError: It is, or the solver is another one.
    """
    if moves(preset, p):
        check_solver(settings)
        check_unmoved(vars(settings), preset_values(AUTO, "cloth_node"))
