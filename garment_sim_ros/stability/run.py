"""One scene with one solver, from frame to frame, and what is seen on the way."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import MessageError
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.stability.extremes import Scene
from garment_sim_ros.stability.measures import Edges, Strain, buried, off_pins
from garment_sim_ros.stability.wearer import HowWorn

DEEP = 0.005
"""Depth in a shape from which on a particle counts as inside, in sizes; where there is no skin."""


@dataclass(kw_only=True)
class Seen:
    """The worst of some frames.

    Attributes:
        crushed: As `Strain`.
        most: As `Strain`.
        largest: As `Strain`.
        pierced: Most bones that ran through garments.
        let_go: Most particles whose contact was dropped.
    """

    crushed: float = 0.0
    most: float = 0.0
    largest: float = 0.0
    pierced: int = 0
    let_go: int = 0

    def add(self, strain: Strain, pierced: int, let_go: int) -> None:
        """One more frame."""
        self.crushed = max(self.crushed, strain.crushed)
        self.most = max(self.most, strain.most)
        self.largest = max(self.largest, strain.largest)
        self.pierced = max(self.pierced, pierced)
        self.let_go = max(self.let_go, let_go)


@dataclass(frozen=True, kw_only=True)
class End:
    """What there is in the end.

    Attributes:
        strain: Of the edges.
        let_go: Particles whose contact is dropped.
        tangled: Share of all particles that stay through another garment.
        crossed: Largest share of the edges of a garment through another, or through itself.
        buried: Largest share of a garment in shapes or skin.
        off_pins: How far a pin is off its place, at most, in sizes.
        worn: On a body; None where there is none.
    """

    strain: Strain
    let_go: int
    tangled: float
    crossed: float
    buried: float
    off_pins: float
    worn: HowWorn | None


class Run:
    """One scene with one solver.

    Args:
        scene: The scene.
        solver: Name of the solver.
        settings: Its settings; the defaults where None. A scene may have other passes, or a preset
            that says all.
    """

    def __init__(self, scene: Scene, solver: str, settings: Any = None) -> None:
        settings = settings or SOLVERS[solver].settings()
        if scene.passes is not None:
            name = "sweeps" if hasattr(settings, "sweeps") else "iterations"
            settings = replace(settings, **{name: scene.passes})
        self._scene = scene
        how: dict[str, Any] = {"solver": solver, "settings": settings}
        how |= {"solver_step": scene.solver_step}
        if scene.preset:
            how = {"preset": scene.preset}
        self.simulation = simulation = Simulation(
            scene.garments, scene.colliders, environment=scene.environment, **how
        )
        self._has_detail = bool(scene.preset) and any(
            len(simulation.model(g.name).rest) < len(g.vertices) for g in scene.garments
        )
        self._edges = Edges(scene.garments)
        self._last = self._free_positions()
        self.rejected = 0
        self.farthest = 0.0
        self.finite = True
        self.strain = Strain(0.0, 0.0, 0.0)
        self.pierced = 0

    @property
    def resets(self) -> int:
        """Times that a garment had to be put back."""
        return sum(self.simulation.health(n).resets for n in self.simulation.names)

    @property
    def mended(self) -> int:
        """Particles that had to be put right."""
        return sum(self.simulation.health(n).recovered for n in self.simulation.names)

    @property
    def rewound(self) -> int:
        """Times that a garment, or a part of one, was wound back, as a limb stayed in it."""
        health = [self.simulation.health(n) for n in self.simulation.names]
        return sum(h.rewound + h.rewound_parts for h in health)

    @property
    def let_go(self) -> int:
        """Particles whose contact is dropped."""
        return sum(self.simulation.health(n).let_go for n in self.simulation.names)

    @property
    def speed(self) -> float:
        """RMS speed of the garments' free particles, from where they were a frame before [m/s].

        A particle that something pulls into a surface may have a velocity in every sub-step and
        be in one place after each frame.
        """
        return max(
            math.sqrt(float(((x - self._last[name]) ** 2).sum(axis=1).mean())) / self._scene.frame
            for name, x in self._free_positions().items()
        )

    def _free_positions(self) -> dict[str, FloatArray]:
        """World positions of free particles [m], shape [n, 3] each."""
        simulation = self.simulation
        return {
            name: simulation.state(name).x[: simulation.model(name).free_count] + simulation.origin
            for name in simulation.names
        }

    def undisturbed(self) -> None:
        """Where the garment is without the disturbance."""
        scene = self._scene
        self._begin(scene.busy + 1.0)
        self._go(scene.still_from, scene.still_from + 0.5 * scene.calm)

    def disturb(self) -> Seen:
        """Goes through the disturbance."""
        scene, seen = self._scene, Seen()
        self._begin(0.0)
        self._blow(scene.disturbed)
        self._go(0.0, scene.moves_until, seen)
        self._blow(scene.environment)
        self._go(scene.moves_until, scene.still_from, seen)
        return seen

    def _begin(self, time: float) -> None:
        if self._scene.wearer is not None:
            self._scene.wearer.begin()
        self.simulation.reset(self._scene.motion(time))

    def _blow(self, environment: Environment) -> None:
        simulation = self.simulation
        simulation.parameters = Parameters(
            environment=environment, settings=simulation.parameters.settings
        )

    def frame(self, t: float) -> None:
        """One frame up to a time."""
        scene = self._scene
        start, end = scene.motion(t - scene.frame), scene.motion(t)
        jump = scene.jump is not None and t - scene.frame <= scene.jump[0] < t
        if scene.broken and t <= scene.busy:
            end.position[0] = np.nan
        self._last = self._free_positions()
        try:
            if jump and scene.jump is not None and scene.jump[1] == "reset":
                self.simulation.reset(end)
            elif jump and scene.jump is not None and scene.jump[1] == "keep":
                self.simulation.transport(start, end)
            else:
                self.simulation.advance(start, end, scene.frame)
        except MessageError:
            self.rejected += 1
        poses = scene.motion(t)
        x = self.by_name()
        for vertices in x.values():
            far = float(np.abs(vertices - poses.position[0]).max())
            self.finite &= math.isfinite(far)
            self.farthest = max(self.farthest, far)
        self.strain = self._edges.strain(x)
        self.pierced = 0 if scene.wearer is None else scene.wearer.pierced(poses, x)

    def _go(self, start: float, end: float, seen: Seen | None = None) -> None:
        for n in range(1, round((end - start) / self._scene.frame) + 1):
            self.frame(start + n * self._scene.frame)
            if seen is not None:
                seen.add(self.strain, self.pierced, self.let_go)

    def end(self) -> End:
        """What there is after the last frame."""
        scene, x = self._scene, self.by_name()
        poses = scene.motion(scene.still_from + scene.calm)
        worn = None if scene.wearer is None else scene.wearer.look(poses, x)
        own = self._edges.crossed(x)
        tangled = sum(self.simulation.health(n).tangled for n in self.simulation.names)
        deep = DEEP * scene.size
        return End(
            strain=self.strain,
            let_go=self.let_go,
            tangled=tangled / sum(len(self.simulation.model(n).rest) for n in x),
            crossed=own if worn is None else max(own, worn.crossed),
            buried=worn.inside
            if worn is not None
            else max(buried(g, x[g.name], scene.colliders, poses, deep) for g in scene.garments),
            off_pins=max(off_pins(g, x[g.name], scene.colliders, poses) for g in scene.garments)
            / scene.size,
            worn=worn,
        )

    def by_name(self) -> dict[str, FloatArray]:
        """World positions of all garments [m], shape [v, 3] each."""
        simulation = self.simulation
        if self._has_detail:
            return {n: simulation.positions(n).astype(np.float64) for n in simulation.names}
        # What is simulated: shown are creases round, which makes short edges shorter.
        origin = simulation.origin
        return {n: simulation[n].worn.seen(origin).astype(np.float64) for n in simulation.names}
