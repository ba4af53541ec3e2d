"""One setting in one scene: validity first, then cost and accuracy."""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.tradeoff.axes import words
from garment_sim_ros.tradeoff.energy import energy_drift
from garment_sim_ros.tradeoff.metrics import (
    distance_mm,
    is_finite,
    pierced,
    rest_speed_mm_s,
    worn_figures,
)
from garment_sim_ros.tradeoff.playing import Played, Player
from garment_sim_ros.tradeoff.points import Point
from garment_sim_ros.tradeoff.reference import Reference, reference
from garment_sim_ros.tradeoff.scenes import Staged, staged_scene
from garment_sim_ros.tradeoff.table import Row

REST = 2.0
"""RMS speed above which garments are not at rest [mm/s]; or twice that of the reference."""
_LOOSE = 0.5
"""Contacts that are dropped count after so long [s]."""
_STATIC = 2.0
"""How long what the reference rests as is left alone [s]."""


def referenced(scene: str, kind: str, membrane: str, seconds: float, file: Path) -> Row:
    """Find or make the reference of a scene; what is reported of it."""
    found = Reference.load(file)
    if found is None:
        found = reference(staged_scene(scene, kind, seconds), membrane=membrane)
        found.save(file)
    return found.told()


def measured(scene: str, point: Point, seconds: float, repeats: int, file: Path) -> Row:
    """One row of the table, from the reference in a file."""
    return _row(scene, point, seconds, file, partial(measure, repeats=repeats))


def glanced(scene: str, point: Point, seconds: float, share: int, file: Path) -> Row:
    """The same of the first of `share` equal parts of the motion, cost and error only."""
    return _row(scene, point, seconds, file, partial(glance, share=share))


def _row(scene: str, point: Point, seconds: float, file: Path, figures: Callable[..., Row]) -> Row:
    row = {
        "scene": scene,
        "colliders": point.kind,
        "solver": point.solver,
        "sub_steps": point.sub_steps,
        "passes": point.passes,
        "membrane": point.membrane,
        "options": " ".join(words(point.options)),
        "preset": point.preset,
        "setting": point.name,
    }
    against = Reference.load(file)
    if against is None:
        return row | {"faults": ["no reference"]}
    staged = staged_scene(scene, point.kind, seconds)
    try:
        return row | figures(staged, point, against)
    except GarmentSimError as error:
        return row | {"faults": ["refused"], "refused": " ".join(str(error).split())}


def glance(staged: Staged, point: Point, against: Reference, share: int) -> Row:
    """Faults, cost and error of a setting in the first part of the motion.

    Args:
        staged: The scene.
        point: The setting.
        against: The scene's reference, with the same colliders.
        share: One over the share of the motion; a segment that begins in it is in it.

    Raises:
        GarmentSimError: It cannot be simulated.
    """
    player = Player(staged, point.arguments(staged.scene.frame))
    player.put_on(settle=False)
    end = -(-staged.frames // share)
    player.begin(against.starts[0])
    played = player.play(0, end)
    faults = []
    if not is_finite(played.paths):
        faults = ["not finite"]
    elif pierced(staged, played.paths) > 0.0:
        faults = ["pierced"]
    figures: Row = {"hot_ms": plain(1e3 * float(np.median(played.processor)))}
    if faults != ["not finite"]:
        figures["trajectory_mm"] = plain(_trajectory_mm(player, against, end))
    return {"faults": faults, **figures}


def measure(staged: Staged, point: Point, against: Reference, repeats: int = 3) -> Row:
    """Faults, costs and errors of a setting.

    Args:
        staged: The scene.
        point: The setting.
        against: The scene's reference, with the same colliders.
        repeats: How often the motion is run to take its time.

    Raises:
        GarmentSimError: It cannot be simulated.
    """
    player = Player(staged, point.arguments(staged.scene.frame))
    compile_s = _first_use(player, against)
    runs = []
    for _ in range(repeats):
        player.put_on(settle=False)
        player.begin(against.starts[0])
        runs.append(player.play(0, staged.frames))
    end, played = staged.frames, runs[-1]
    held = player.play(end, end + staged.still_frames)
    mended = player.mended
    faults, figures = _judged(staged, against, (played, held), mended)
    figures |= {"compile_s": round(compile_s, 3), **_hot(runs)}
    if "not finite" not in faults:
        figures |= _errors(player, against)
        figures["energy_drift"] = energy_drift(staged, point)
    return {"faults": faults, **{name: plain(value) for name, value in figures.items()}}


def _first_use(player: Player, against: Reference) -> float:
    """How much longer the first two frames took than the next time [s]: compiling, loading."""
    took = []
    for _ in range(2):
        began = time.perf_counter()
        player.put_on(settle=False)
        player.begin(against.starts[0])
        player.play(0, min(2, player.staged.frames))
        took.append(time.perf_counter() - began)
    return max(0.0, took[0] - took[1])


def _judged(
    staged: Staged, against: Reference, runs: tuple[Played, Played], mended: int
) -> tuple[list[str], Row]:
    """Faults, and what they were found by."""
    played, held = runs
    if not (is_finite(played.paths) and is_finite(held.paths)):
        return ["not finite"], {}
    figures: Row = worn_figures(staged, played.paths)
    if staged.scene.rests:
        figures["rest_speed_mm_s"] = rest_speed_mm_s(held.paths, staged.scene.frame)
    loose = [*played.let_go, *held.let_go][round(_LOOSE / staged.scene.frame) :]
    figures["dropped"] = max(loose)
    figures["mended"] = mended
    found = {
        "pierced": figures["pierced"] > 0.0,
        "not at rest": figures.get("rest_speed_mm_s", 0.0) > max(REST, 2.0 * against.rest_speed),
        "dropped contacts": figures["dropped"] > 0,
        "put right": mended > 0,
    }
    return [fault for fault, there in found.items() if there], figures


def _hot(runs: list[Played]) -> Row:
    """Processor time of frames one after the other."""
    each = [1e3 * float(np.median(run.processor)) for run in runs]
    every = 1e3 * np.concatenate([run.processor for run in runs])
    return {
        "hot_ms": float(np.median(each)),
        "hot_ms_p95": float(np.percentile(every, 95.0)),
        "hot_spread": (max(each) - min(each)) / float(np.median(each)),
    }


def _errors(player: Player, against: Reference) -> Row:
    """Errors against the reference, and what frames take when they are paced."""
    player.begin(against.starts[0])
    paced = player.play(0, player.staged.frames, paced=True)
    return {
        "trajectory_mm": _trajectory_mm(player, against, player.staged.frames),
        "static_mm": _static_mm(player, against) if against.rest else None,
        "paced_ms": 1e3 * float(np.median(paced.processor)),
        "paced_ms_p95": 1e3 * float(np.percentile(paced.processor, 95.0)),
        "paced_wall_ms": 1e3 * float(np.median(paced.wall)),
    }


def _trajectory_mm(player: Player, against: Reference, end: int) -> float:
    """RMS distance from the reference in the segments that begin before a frame [mm]."""
    squares, frames = 0.0, 0
    for start, (first, last) in zip(against.starts, against.segments):
        if first < end:
            player.begin(start)
            paths = player.play(first, last).simulated
            whole = {name: x[first : last + 1] for name, x in against.paths.items()}
            squares += distance_mm(paths, whole) ** 2 * (last - first)
            frames += last - first
    return float(np.sqrt(squares / frames))


def _static_mm(player: Player, against: Reference) -> float:
    """RMS distance from the reference's rest shape, where it was put, some time later [mm]."""
    staged = player.staged
    end = staged.frames
    still = player.snapshot(end)
    for name, x in against.rest.items():
        still.x[name][:] = x
        still.v[name][:] = 0.0
    player.begin(still)
    alone = player.play(end, end + max(12, round(_STATIC / staged.scene.frame)))
    return distance_mm({name: x[-1] for name, x in alone.simulated.items()}, against.rest)


def plain(value: Any) -> Any:
    """A value as JSON and CSV have it: four figures, none that is not finite."""
    if isinstance(value, float):
        return float(f"{value:.4g}") if np.isfinite(value) else None
    return value
