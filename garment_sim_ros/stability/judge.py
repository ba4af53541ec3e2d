"""Runs a scene to its extreme, leaves it alone, and says what is wrong with what remains.

What is judged, and by what limits, is in ``docs/measurements/stability.md``. Limits of stretch
come from the fabric and what acts on it (`limits`), never from another run, which may be broken
itself: the run without the disturbance is judged as well, by the same limits, and is compared with
only where cloth can be at rest in one place.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.stability import limits
from garment_sim_ros.stability.energy import Energy
from garment_sim_ros.stability.extremes import Scene
from garment_sim_ros.stability.run import End, Run, Seen

BOX = 12.0
"""Farthest that a particle may ever be from the first collider, in sizes of the garment."""
REST = 2e-3
"""Highest RMS speed in the last 10 frames, in sizes per second."""
PLACE = 2e-3
"""Farthest that a particle may rest from where it would undisturbed, and a pin from where it is
pinned, in sizes."""
MOVED, MOVED_BY = 0.05, 0.025
"""Farthest that a garment as a whole may rest from where it would be as skin, and from where it
would be undisturbed, in heights of the body: raised arms lift a shirt."""
INSIDE = 0.005
"""Share of a garment that may be in the skin, or in shapes, at rest."""
CROSSED = 0.01
"""Share of a garment's edges that may run through another one, or itself, at rest."""
TANGLED = 0.001
"""Share of all particles that may stay through another garment at rest, as some at a border do."""
UNDER = 0.02
"""Share of what lies on a garment that may be under it, at rest."""
GAIN = 0.05
"""Share of the energy at the start of the calm that may be gained in it."""
RECOVER = 0.5
"""After so long [s] no body part may run through a garment, no contact be dropped, and nothing be
put right any more."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of one cell.

    Attributes:
        faults: What is wrong; empty where nothing is.
        figures: What was measured.
        refused: Why it cannot be simulated, where the simulation says so; else empty.
        skipped: Why it was not tried; else empty.
    """

    faults: tuple[str, ...] = ()
    figures: dict[str, float] = field(default_factory=dict)
    refused: str = ""
    skipped: str = ""


def judge(scene: Scene, solver: str, settings: Any = None) -> Outcome:
    """Runs a scene and judges it.

    Args:
        scene: The scene.
        solver: Name of the solver.
        settings: Its settings; the defaults where None.
    """
    try:
        still, run = Run(scene, solver, settings), Run(scene, solver, settings)
    except GarmentSimError as error:
        # Saying clearly that something cannot be simulated is a good answer.
        return Outcome(refused=str(error))
    still.undisturbed()
    place = still.end() if still.finite else None
    seen = run.disturb()
    energy = Energy(run.simulation, scene.environment.gravity)
    kinetic, gravitational, stored = energy.now()
    calm = _Calm(outer=[kinetic + gravitational], kinetic=[kinetic], stored=stored)
    for n in range(1, round(scene.calm / scene.frame) + 1):
        run.frame(scene.still_from + n * scene.frame)
        kinetic, gravitational, _ = energy.now()
        calm.outer.append(kinetic + gravitational)
        calm.kinetic.append(kinetic)
        calm.speed.append(run.speed)
        calm.seen.add(run.strain, 0, 0)
        if n * scene.frame > RECOVER:
            calm.back.add(run.strain, run.pierced, run.let_go)
        else:
            calm.resets, calm.mended = run.resets, run.mended
    return _verdict(scene, (still, place), run, seen, calm)


@dataclass(kw_only=True)
class _Calm:
    """What was measured after the disturbance, frame by frame.

    Attributes:
        outer: Kinetic energy and that in the field of gravity [J].
        kinetic: Kinetic energy [J].
        stored: What edges and hinges held at the start [J].
        speed: RMS speed [m/s].
        seen: The worst stretch.
        back: The worst of all after `RECOVER`.
        resets: Times that a garment had been put back until then.
        mended: Particles that had been put right until then.
    """

    outer: list[float]
    kinetic: list[float]
    stored: float
    speed: list[float] = field(default_factory=list)
    seen: Seen = field(default_factory=Seen)
    back: Seen = field(default_factory=Seen)
    resets: int = 0
    mended: int = 0


def _verdict(
    scene: Scene, undisturbed: tuple[Run, End | None], run: Run, seen: Seen, calm: _Calm
) -> Outcome:
    still, place = undisturbed
    figures: dict[str, float] = {
        "resets": run.resets,
        "mended": run.mended,
        "rewound": run.rewound,
        "rejected": run.rejected,
        "farthest": run.farthest / scene.size,
    }
    if place is None or not (run.finite and math.isfinite(sum(calm.outer))):
        return Outcome(faults=("not finite",), figures=figures)
    faults = []
    may_break = scene.broken or scene.jump is not None
    # What nothing finite can follow may be put right, but not for ever.
    if run.resets > (calm.resets if may_break else 0):
        faults.append("reset")
    if run.mended > (calm.mended if may_break else 0):
        faults.append("mended")
    if run.farthest > BOX * scene.size:
        faults.append("out of bounds")
    end = run.end()
    lively, figures["acting"] = _on_the_way(scene, seen, calm, may_break)
    faults += lively

    mass = float(sum(m.mass.sum() for m in map(run.simulation.model, run.simulation.names)))
    grown, figures["gained"] = _has_grown(scene, calm, mass)
    if grown:
        faults.append("energy grows")
    figures["rest_speed"] = max(calm.speed[-10:]) / scene.size
    if figures["rest_speed"] > REST:
        faults.append("restless")
    at_rest, before = _at_rest(scene, end), _at_rest(scene, place)
    faults += at_rest
    faults += [f"{fault} undisturbed" for fault in before if fault not in at_rest]
    if end.worn is not None and place.worn is not None:
        by = float(np.linalg.norm(end.worn.moved - place.worn.moved, axis=1).max())
        figures["moved_by"] = by
        if by > MOVED_BY and "elsewhere" not in faults:
            faults.append("elsewhere")
    if scene.unique:
        here, there = run.by_name(), still.by_name()
        away = max(np.linalg.norm(here[n] - there[n], axis=1).max() for n in here)
        figures["away"] = float(away) / scene.size
        if away > PLACE * scene.size and "elsewhere" not in faults:
            faults.append("elsewhere")
    figures |= _figures(end, seen, calm)
    figures |= {f"{k}_undisturbed": v for k, v in _figures(place).items()}
    return Outcome(faults=tuple(faults), figures={k: float(v) for k, v in figures.items()})


def _on_the_way(scene: Scene, seen: Seen, calm: _Calm, may_break: bool) -> tuple[list[str], float]:
    """Faults before it rests, and by how much what acts would stretch the fabric."""
    faults = []
    limit, acting = limits.meanwhile(scene), limits.acting(scene)
    for moment in [calm.seen] if may_break else [seen, calm.seen]:
        if moment.most > limit.most or moment.largest > limit.largest:
            faults.append("stretched meanwhile")
        if moment.crushed > limit.crushed:
            faults.append("crushed meanwhile")
    for moment in [calm.back] if may_break or acting > limits.BREAKS else [seen, calm.back]:
        if moment.pierced:
            faults.append("pierced meanwhile")
        if moment.let_go and limits.hanging(scene) < limits.BREAKS:
            faults.append("dropped meanwhile")
    return list(dict.fromkeys(faults)), acting


def _at_rest(scene: Scene, end: End) -> list[str]:
    """Faults of what there is in the end."""
    limit = limits.at_rest(scene)
    stretched = end.strain.most > limit.most or end.strain.largest > limit.largest
    found = {
        "stretched": stretched,
        "crushed": end.strain.crushed > limit.crushed,
        "inside": end.buried > INSIDE and not scene.forced,
        "dropped": end.let_go > 0 and limits.hanging(scene) < limits.BREAKS,
        "tangled": end.tangled > TANGLED or end.crossed > CROSSED,
        "elsewhere": end.off_pins > PLACE,
    }
    if end.worn is not None:
        found["pierced"] = end.worn.pierced > 0
        moved = np.linalg.norm(end.worn.moved, axis=1).max()
        found["elsewhere"] |= bool(moved > MOVED + limits.SAGS * limits.hanging(scene))
        found["layers"] = end.worn.under > UNDER
    return [fault for fault, is_there in found.items() if is_there]


def _figures(end: End, seen: Seen | None = None, calm: _Calm | None = None) -> dict[str, float]:
    """Figures of what there is in the end, and on the way there."""
    figures: dict[str, float] = {
        "strain_p95": end.strain.most,
        "strain_largest": end.strain.largest,
        "crushed": end.strain.crushed,
        "let_go": end.let_go,
        "tangled": end.tangled,
        "crossed": end.crossed,
        "inside": end.buried,
        "off_pins": end.off_pins,
    }
    if end.worn is not None:
        moved = float(np.linalg.norm(end.worn.moved, axis=1).max())
        figures |= {"pierced": end.worn.pierced, "moved": moved, "under": end.worn.under}
    if seen is not None and calm is not None:
        for name, of in (("meanwhile", seen), ("calm", calm.seen), ("back", calm.back)):
            figures |= {f"{k}_{name}": v for k, v in vars(of).items()}
    return figures


def _has_grown(scene: Scene, calm: _Calm, mass: float) -> tuple[bool, float]:
    """Whether energy has grown, and by what share of all that there was to lose.

    It may be by what edges and hinges held in the beginning, and by as little as cloth at rest
    shows anyway.
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
