"""Settings of the solvers as points of a grid."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from garment_sim_ros.declaration import declarations, validated
from garment_sim_ros.params import (
    ClothNodeParameters,
    ColliderOptions,
    ImplicitSettings,
    RelaxationSettings,
    XpbdSettings,
)
from garment_sim_ros.presets import collider_options, preset_values, worn_with
from garment_sim_ros.sim.solvers import SOLVERS, longest_step
from garment_sim_ros.solver_params import SPRINGS
from garment_sim_ros.tradeoff.axes import Axis, Options, acting, solver_options, words

GRID: Mapping[str, Sequence[tuple[int, int]]] = {
    "relaxation": ((1, 3), (3, 3), (3, 10), (6, 3), (12, 3)),
    "xpbd": ((4, 1), (8, 1), (18, 1), (36, 1), (72, 1)),
    "implicit": ((1, 4), (1, 8), (2, 8), (4, 8), (8, 8)),
}
"""Sub-steps of a frame, and sweeps or iterations in each, by solver."""


@dataclass(frozen=True, kw_only=True)
class Point:
    """One setting.

    Attributes:
        kind: Colliders, as `axes.collider_arguments` takes them.
        solver: Name of the solver.
        sub_steps: In a frame of the scene; of `relaxation`: its steps.
        passes: Sweeps or iterations in each.
        membrane: What resists strain in the plane; `relaxation` has springs.
        options: Other settings of the solver by name.
        preset: Name of a preset, which says all of the solver but `options`; empty without.
    """

    kind: str
    solver: str
    sub_steps: int
    passes: int
    membrane: str = SPRINGS
    options: Options = ()
    preset: str = ""

    @property
    def name(self) -> str:
        """As tables and pictures have it."""
        if self.preset:
            return " ".join((self.preset, *words(self.options)))
        membrane = () if self.membrane == SPRINGS else (self.membrane,)
        size = f"{self.sub_steps}x{self.passes}"
        return " ".join((self.solver, size, *membrane, *words(self.options)))

    def arguments(self, frame: float) -> dict[str, Any]:
        """Arguments of `Simulation` for frames of so long [s]."""
        if self.preset:
            step = _step(self.preset)
            return {"preset": self.preset, "solver_step": step, **dict(self.options)}
        if self.solver == "relaxation":
            settings: Any = RelaxationSettings(sweeps=self.passes)
            step = frame / self.sub_steps
        else:
            of = XpbdSettings if self.solver == "xpbd" else ImplicitSettings
            settings = of(
                sub_step=frame / self.sub_steps, iterations=self.passes, membrane=self.membrane
            )
            step = frame
        return {
            "solver": self.solver,
            "settings": settings,
            "solver_step": step,
            **dict(self.options),
        }


def grid(
    kinds: Sequence[str],
    solvers: Sequence[str],
    sub_steps: Sequence[int] = (),
    passes: Sequence[int] = (),
    membranes: Sequence[str] = (SPRINGS,),
    axes: Sequence[Axis] = (),
) -> Iterator[Point]:
    """The points of a grid.

    Args:
        kinds: Kinds of colliders.
        solvers: Names of solvers.
        sub_steps: Numbers of sub-steps for all solvers; those of `GRID` where empty.
        passes: Numbers of sweeps or iterations for all solvers; the same.
        membranes: What resists strain in the plane; `relaxation` is there with springs only.
        axes: Other parameters of the solvers.
    """
    for kind in kinds:
        for solver in solvers:
            pairs = GRID[solver]
            if sub_steps or passes:
                counts = sub_steps or sorted({n for n, _ in pairs})
                pairs = tuple((n, k) for n in counts for k in passes or (pairs[0][1],))
            for membrane in membranes:
                if solver == "relaxation" and membrane != SPRINGS:
                    continue
                for options in solver_options(axes, solver):
                    for n, k in pairs:
                        yield Point(
                            kind=kind,
                            solver=solver,
                            sub_steps=n,
                            passes=k,
                            membrane=membrane,
                            options=options,
                        )


def preset_point(preset: str, frame: float, kind: str = "") -> Point:
    """A preset, with the steps that a node takes, as a point.

    Args:
        preset: Its name; of `auto` this is where it begins.
        frame: Length of the scene's frames [s]; a longer step is as long as they are.
        kind: Colliders; empty: the preset's own.

    Raises:
        ParameterError: There is no such preset.
    """
    values = preset_values(preset, "cloth_node")
    solver = values.get("solver", declarations(ClothNodeParameters)["solver"].default)
    group = SOLVERS[solver].settings
    settings: Any = validated(group, {k: v for k, v in values.items() if k in declarations(group)})
    steps = _whole(frame / _step(preset))
    if solver != "relaxation":
        steps *= _whole(frame / steps / settings.sub_step)
    return Point(
        kind=kind or _preset_colliders(preset),
        solver=solver,
        sub_steps=steps,
        passes=settings.sweeps if solver == "relaxation" else settings.iterations,
        membrane=getattr(settings, "membrane", SPRINGS),
        preset=preset,
    )


def _preset_colliders(preset: str) -> str:
    """The same text as that of the grid where all that holds and meets garments is the same."""
    values = collider_options(preset)
    how = validated(ColliderOptions, values)
    others = acting(how, {k: v for k, v in values.items() if k != "method"})
    return preset if others or worn_with(preset) != worn_with(None) else how.method


def _step(preset: str) -> float:
    """The longest step that a node takes at once [s]."""
    usual = declarations(ClothNodeParameters)
    values = preset_values(preset, "cloth_node")
    solver, step = (values.get(name, usual[name].default) for name in ("solver", "solver_step"))
    return longest_step(solver, float(step))


def _whole(ratio: float) -> int:
    """A whole number that is no less, but for rounding."""
    return max(1, math.ceil(ratio - 1e-6))
