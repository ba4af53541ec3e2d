"""Runs a scene to its extreme, leaves it alone, and says what is wrong with what remains.

A cell fails where anything is not finite, where the garment leaves all bounds, where energy grows
after the disturbance has ended, where the garment does not come to rest, where it rests elsewhere
than without the disturbance although there is only one place, or where it had to be mended or
reset, unless the body jumped or what came in was broken. A dressed body's cell fails where, in the
end, more body parts run through garments than without the disturbance, or more of a garment is in
the skin (see ``docs/worn.md``).
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GarmentSimError, MessageError
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.elasticity import edge_stiffness
from garment_sim_ros.sim.model import ClothModel, Parameters
from garment_sim_ros.sim.rest_shape import edge_lengths
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.stability.extremes import Scene
from garment_sim_ros.stability.wearer import HowWorn

BOX = 12.0
"""Farthest that a particle may ever be from the first collider, in sizes of the garment."""
STRAIN = 0.5
"""Most that the 95th percentile of stretch may be in the end above what it is undisturbed."""
REST = 2e-3
"""Highest RMS speed in the last 10 frames, in sizes per second."""
PLACE = 2e-3
"""Farthest that a particle may rest from where it would undisturbed, in sizes."""
INSIDE = 0.005
"""Share of a garment's area that may be in the skin in the end, above what is undisturbed."""
GAIN = 0.05
"""Share of the energy at the start of the calm that may be gained in it."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of one cell.

    Attributes:
        faults: What is wrong; empty where nothing is.
        figures: What was measured.
        refused: Why it cannot be simulated, where the simulation says so; else empty.
    """

    faults: tuple[str, ...]
    figures: dict[str, float]
    refused: str = ""


class _Run:
    """One scene with one solver.

    Args:
        scene: The scene.
        solver: Name of the solver.
    """

    def __init__(self, scene: Scene, solver: str) -> None:
        settings = SOLVERS[solver].settings()
        if scene.passes is not None:
            name = "sweeps" if hasattr(settings, "sweeps") else "iterations"
            settings = replace(settings, **{name: scene.passes})
        self._scene = scene
        self.simulation = Simulation(
            scene.garments,
            scene.colliders,
            environment=scene.environment,
            settings=settings,
            solver=solver,
            solver_step=scene.solver_step,
        )
        self._last = self._free_positions()
        self.rejected = 0
        self.farthest = 0.0
        self.finite = True

    @property
    def resets(self) -> int:
        """Times that a garment had to be put back."""
        return sum(self.simulation.health(n).resets for n in self.simulation.names)

    @property
    def mended(self) -> int:
        """Particles that had to be put right."""
        return sum(self.simulation.health(n).recovered for n in self.simulation.names)

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
        self.simulation.reset(scene.motion(scene.busy + 1.0))
        self._go(scene.busy, 0.5 * scene.calm)

    def disturb(self) -> None:
        """Goes through the disturbance."""
        scene, simulation = self._scene, self.simulation
        simulation.reset(scene.motion(0.0))
        self._blow(scene.disturbed)
        self._go(0.0, scene.busy)
        self._blow(scene.environment)

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
        bone = scene.motion(t).position[0]
        for name in self.simulation.names:
            x = self.simulation.positions(name)
            far = float(np.abs(x - bone).max())
            self.finite &= math.isfinite(far)
            self.farthest = max(self.farthest, far)

    def _go(self, start: float, end: float) -> None:
        for n in range(1, max(1, round((end - start) / self._scene.frame)) + 1):
            self.frame(start + n * self._scene.frame)

    def worn(self) -> HowWorn | None:
        """How the garments are worn in the end; None where there is no body."""
        scene = self._scene
        if scene.wearer is None:
            return None
        x = {n: self.simulation.positions(n) for n in self.simulation.names}
        return scene.wearer.look(scene.motion(scene.busy + scene.calm), x)

    def positions(self) -> FloatArray:
        """World positions of all garments [m], shape [n, 3]."""
        return np.concatenate(
            [self.simulation.positions(n).astype(np.float64) for n in self.simulation.names]
        )


class _Energy:
    """Kinetic and potential energy of all garments."""

    def __init__(self, simulation: Simulation, gravity: tuple[float, ...]) -> None:
        self._simulation = simulation
        self._gravity = np.array(gravity)
        self._springs = {n: _stretch(simulation.model(n)) for n in simulation.names}

    def outer(self) -> float:
        """Kinetic energy and that in the field of gravity [J]."""
        total = 0.0
        for name in self._simulation.names:
            model, state = self._simulation.model(name), self._simulation.state(name)
            free = model.free_count
            mass = model.mass[:free].astype(np.float64)
            v = state.v[:free].astype(np.float64)
            x = state.x[:free].astype(np.float64) + self._simulation.origin
            total += float(mass @ (0.5 * (v**2).sum(axis=1) - x @ self._gravity))
        return total

    def kinetic(self) -> float:
        """Kinetic energy [J]."""
        total = 0.0
        for name in self._simulation.names:
            model, state = self._simulation.model(name), self._simulation.state(name)
            v = state.v[: model.free_count].astype(np.float64)
            total += float(0.5 * model.mass[: model.free_count] @ (v**2).sum(axis=1))
        return total

    def stored(self) -> float:
        """What stretched edges hold by the material's stiffness [J]."""
        total = 0.0
        for name, (edges, rest, stiffness) in self._springs.items():
            x = self._simulation.state(name).x.astype(np.float64)
            excess = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1) - rest
            total += float(0.5 * stiffness @ excess**2)
        return total


def _stretch(model: ClothModel) -> tuple[NDArray[np.int32], FloatArray, FloatArray]:
    """Edges, their rest lengths [m] and stiffnesses [N/m]."""
    springs = model.springs
    edges = springs.particles.reshape(-1, 2)[springs.bending :].astype(np.int32)
    triangles = model.particle_triangles
    rest = edge_lengths(model.corners, triangles, edges)
    return (
        edges,
        rest,
        edge_stiffness(model.rest, triangles, edges, model.material, model.corners),
    )


def _strain(simulation: Simulation) -> float:
    """95th percentile of stretch over all garments."""
    strains = []
    for name in simulation.names:
        edges, rest, _ = _stretch(simulation.model(name))
        x = simulation.state(name).x.astype(np.float64)
        apart = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)
        strains.append(apart[rest > 0] / rest[rest > 0] - 1.0)
    return float(np.percentile(np.concatenate(strains), 95.0))


def judge(scene: Scene, solver: str) -> Outcome:
    """Runs a scene and judges it.

    Args:
        scene: The scene.
        solver: Name of the solver; with its default settings.
    """
    try:
        still, run = _Run(scene, solver), _Run(scene, solver)
    except GarmentSimError as error:
        # Saying clearly that something cannot be simulated is a good answer.
        return Outcome(faults=(), figures={}, refused=str(error))
    still.undisturbed()
    run.disturb()
    energy = _Energy(run.simulation, scene.environment.gravity)
    calm = _Calm(outer=[energy.outer()], kinetic=[energy.kinetic()], stored=energy.stored())
    for n in range(1, round(scene.calm / scene.frame) + 1):
        run.frame(scene.busy + n * scene.frame)
        calm.outer.append(energy.outer())
        calm.kinetic.append(energy.kinetic())
        calm.speed.append(run.speed)
    return _verdict(scene, still, run, calm)


@dataclass(kw_only=True)
class _Calm:
    """What was measured after the disturbance, frame by frame.

    Attributes:
        outer: Kinetic energy and that in the field of gravity [J].
        kinetic: Kinetic energy [J].
        stored: What edges held at the start [J].
        speed: RMS speed [m/s].
    """

    outer: list[float]
    kinetic: list[float]
    stored: float
    speed: list[float] = field(default_factory=list)


def _verdict(scene: Scene, still: _Run, run: _Run, calm: _Calm) -> Outcome:
    faults = []
    figures: dict[str, float] = {
        "resets": run.resets,
        "mended": run.mended,
        "rejected": run.rejected,
        "farthest": run.farthest / scene.size,
    }
    if not (run.finite and math.isfinite(sum(calm.outer))):
        faults.append("not finite")
        return Outcome(faults=tuple(faults), figures=figures)
    may_break = scene.broken or scene.jump is not None
    if run.resets and not may_break:
        faults.append("reset")
    if run.mended and not may_break:
        faults.append("mended")
    if run.farthest > BOX * scene.size:
        faults.append("out of bounds")
    strain, usual = _strain(run.simulation), _strain(still.simulation)
    figures |= {"strain_p95": strain, "strain_p95_undisturbed": usual}
    if strain > usual + STRAIN:
        faults.append("stretched")

    mass = float(sum(m.mass.sum() for m in map(run.simulation.model, run.simulation.names)))
    grown, figures["gained"] = _has_grown(scene, calm, mass)
    if grown:
        faults.append("energy grows")
    figures["rest_speed"] = max(calm.speed[-10:]) / scene.size
    if figures["rest_speed"] > REST:
        faults.append("restless")
    worn, usually = run.worn(), still.worn()
    if worn is not None and usually is not None:
        figures |= {"pierced": worn.pierced, "pierced_undisturbed": usually.pierced}
        figures |= {"inside": worn.inside, "inside_undisturbed": usually.inside}
        if worn.pierced > usually.pierced:
            faults.append("pierced")
        if worn.inside > usually.inside + INSIDE:
            faults.append("inside")
    if scene.unique:
        away = float(np.linalg.norm(run.positions() - still.positions(), axis=1).max())
        figures["away"] = away / scene.size
        if away > PLACE * scene.size:
            faults.append("elsewhere")
    return Outcome(faults=tuple(faults), figures={k: float(v) for k, v in figures.items()})


def _has_grown(scene: Scene, calm: _Calm, mass: float) -> tuple[bool, float]:
    """Whether energy has grown, and by what share of all that there was to lose.

    It may be by what edges held in the beginning, and by as little as cloth at rest shows anyway.
    """
    room = max(calm.outer[0] - min(calm.outer), calm.kinetic[0])
    gained = max(calm.outer) - calm.outer[0] - min(calm.stored, room)
    pull = math.sqrt(sum(g * g for g in scene.environment.gravity))
    still = 0.5 * mass * (REST * scene.size) ** 2
    hardly = still + mass * pull * PLACE * scene.size
    late = calm.kinetic[len(calm.kinetic) // 2 :]
    before, after = late[: len(late) // 2], late[len(late) // 2 :]
    grown = gained > GAIN * room + hardly or max(after) > (1.0 + GAIN) * max(before) + still
    return grown, gained / max(room, 1e-12)
