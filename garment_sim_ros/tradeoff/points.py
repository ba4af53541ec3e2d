"""Settings of the solvers as points of a grid."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from garment_sim_ros.params import ImplicitSettings, RelaxationSettings, XpbdSettings
from garment_sim_ros.solver_params import SPRINGS

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
        kind: Kind of colliders.
        solver: Name of the solver.
        sub_steps: In a frame of the scene; of `relaxation`: its steps.
        passes: Sweeps or iterations in each.
        membrane: What resists strain in the plane; `relaxation` has springs.
    """

    kind: str
    solver: str
    sub_steps: int
    passes: int
    membrane: str = SPRINGS

    @property
    def name(self) -> str:
        """As tables and pictures have it."""
        name = f"{self.solver} {self.sub_steps}x{self.passes}"
        return name if self.membrane == SPRINGS else f"{name} {self.membrane}"

    def arguments(self, frame: float) -> dict[str, Any]:
        """Arguments of `Simulation` for frames of so long [s]."""
        if self.solver == "relaxation":
            settings: Any = RelaxationSettings(sweeps=self.passes)
            step = frame / self.sub_steps
        else:
            of = XpbdSettings if self.solver == "xpbd" else ImplicitSettings
            settings = of(
                sub_step=frame / self.sub_steps, iterations=self.passes, membrane=self.membrane
            )
            step = frame
        return {"solver": self.solver, "settings": settings, "solver_step": step}


def grid(
    kinds: Sequence[str],
    solvers: Sequence[str],
    sub_steps: Sequence[int] = (),
    passes: Sequence[int] = (),
    membranes: Sequence[str] = (SPRINGS,),
) -> Iterator[Point]:
    """The points of a grid.

    Args:
        kinds: Kinds of colliders.
        solvers: Names of solvers.
        sub_steps: Numbers of sub-steps for all solvers; those of `GRID` where empty.
        passes: Numbers of sweeps or iterations for all solvers; the same.
        membranes: What resists strain in the plane; `relaxation` is there with springs only.
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
                for n, k in pairs:
                    yield Point(kind=kind, solver=solver, sub_steps=n, passes=k, membrane=membrane)
