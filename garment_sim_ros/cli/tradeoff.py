"""`tradeoff`: measures what accuracy costs, setting by setting."""

import argparse
import json
import re
import sys
from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any

from garment_sim_ros.cli.calibrate import run_calibration
from garment_sim_ros.cli.kept_tasks import Task, done, kept_in, kept_or_done
from garment_sim_ros.cli.prices import run_prices
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.collider_params import HULLS, METHODS
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import PRESETS
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.solver_params import MEMBRANES, SPRINGS
from garment_sim_ros.tradeoff.axes import Axis, axis, collider_kinds
from garment_sim_ros.tradeoff.features import FEATURES
from garment_sim_ros.tradeoff.halving import SHARES, better_half
from garment_sim_ros.tradeoff.plots import draw
from garment_sim_ros.tradeoff.points import Point, grid, preset_point
from garment_sim_ros.tradeoff.runner import glanced, measured, referenced
from garment_sim_ros.tradeoff.scenes import PLAIN, SCENES, scene_named
from garment_sim_ros.tradeoff.table import (
    Kept,
    Row,
    across_colliders,
    is_outside,
    machine,
    markdown,
    on_fronts,
    write_csv,
)
from garment_sim_ros.version import VERSION

EXAMPLE = "garment-sim tradeoff drape hung walk --out out/tradeoff"
_PRESETS = tuple(name for name in PRESETS if name != "auto")
_OF_PRESETS = (
    "measure these as nodes run them, and no grid of settings unless --solver is given, too"
)
_OF_VARY = "values of a parameter of solver or colliders to measure; may be repeated"
_OF_HALVING = "all settings on a part of the motion first, the better half on more of it"
_OF_PRICES = (
    "measure instead what each feature, or each of these, costs in time and removes in errors, "
    "from --preset or balanced"
)
_COST, _ERROR, _GAP = "hot_ms", "trajectory_mm", "gap_mm"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    add("scene", metavar="SCENE", nargs="*", help="drape, hung, walk ...; all: every one")
    add("--out", metavar="DIR", type=Path, help="tradeoff.csv, .json, .md, and the fronts")
    add("--solver", choices=tuple(SOLVERS), action="append", help="only this one; may be repeated")
    add("--colliders", choices=METHODS, action="append", help="hulls if none; may be repeated")
    add("--membrane", choices=MEMBRANES, action="append", help="springs if none; may be repeated")
    add("--preset", choices=_PRESETS, nargs="+", default=[], help=_OF_PRESETS)
    add("--vary", type=_axis, action="append", default=[], metavar="NODE.PARAM=V,V", help=_OF_VARY)
    add("--sub-steps", type=_count, nargs="+", default=[], help="sub-steps of a frame to measure")
    add("--passes", type=_count, nargs="+", default=[], help="sweeps or iterations of a sub-step")
    add("--halving", action="store_true", help=_OF_HALVING)
    add("--seconds", type=float, default=0.0, help="of each motion at most; 0: all")
    add("--repeats", type=_count, default=3, help="how often each motion is timed")
    add("--jobs", type=_count, default=1, help="processes; times are right with 1 only")
    add("--prices", choices=tuple(FEATURES), nargs="*", metavar="FEATURE", help=_OF_PRICES)
    add("--calibrate", action="store_true", help="measure this machine, for preset auto")
    add("--list", action="store_true", help="name the scenes and run none")


def _count(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"found {text[:60]!r}; allowed: a whole number from 1")
    return value


def _axis(text: str) -> Axis:
    try:
        return axis(text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(f"{error.problem}; {error.allowed}") from None


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Measure what is missing, tell all."""
    if args.list:
        for name, scene in SCENES.items():
            print(f"{name}: {scene.text}" + (scene.absent and f" ({scene.absent})"))
        return {"scenes": list(SCENES)}
    if args.calibrate:
        return run_calibration()
    if args.out is None:
        raise ParameterError("--out", "not given", "needed: a folder to write into")
    scenes, skipped = _scenes(args.scene)
    if args.prices is not None:
        return run_prices(args, scenes, skipped)
    kept = kept_in(args.out)
    told = _references(args, scenes, kept)
    doubt = {name: of["doubt_mm"] for name, of in told.items()}
    points, dropped = _left(args, scenes, kept)
    rows = [
        row | {"doubt_mm": doubt[_told_of(row["scene"], row["colliders"], row["membrane"])]}
        for row in _rows(args, points, kept)
    ]
    best = on_fronts(rows, _COST, _ERROR)
    closest = across_colliders(rows, _COST, _GAP)
    result = {
        "machine": machine(args.jobs),
        "skipped": skipped,
        "references": told,
        "front": [_name(row) for row in best],
        "front_across_colliders": [_name(row) for row in closest],
        "rows": rows,
        "dropped": dropped,
    }
    with staged(args.out) as stage:
        (stage / "tradeoff.json").write_text(json.dumps(result, indent=1, allow_nan=False) + "\n")
        (stage / "tradeoff.md").write_text(markdown(rows, best))
        write_csv(rows, stage / "tradeoff.csv")
        for scene, kind in dict.fromkeys((row["scene"], row["colliders"]) for row in rows):
            of = [r for r in rows if (r["scene"], r["colliders"]) == (scene, kind)]
            draw(of, _as_file(f"{scene}_{kind}"), stage, cost=_COST, error=_ERROR)
        for scene in dict.fromkeys(row["scene"] for row in closest):
            of = [r for r in rows if r["scene"] == scene and is_outside(r, _GAP)]
            draw(of, _as_file(f"{scene}_all_colliders"), stage, cost=_COST, error=_GAP)
    print(markdown(rows, best), end="")
    if dropped:
        print(f"dropped by halving: {', '.join(map(_name, dropped))}", file=sys.stderr)
    for name, why in skipped.items():
        print(f"skipped: {name}: {why}", file=sys.stderr)
    for name, told_of in told.items():
        if not told_of["converged"]:
            print(
                f"reference not converged: {name}: {told_of['over']} of "
                f"{len(told_of['segments'])} segments, {told_of['doubt_mm']} mm over all",
                file=sys.stderr,
            )
    return result | {"out": str(args.out)}


def _name(row: Row) -> str:
    return f"{row['scene']}, {row['colliders']}: {row['setting']}"


def _scenes(asked: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Names of the scenes to run, and why others are not."""
    names = list(SCENES) if "all" in asked else list(dict.fromkeys(asked))
    if not names:
        raise ParameterError("SCENE", "none given", f"allowed: all, {', '.join(SCENES)}")
    for name in names:
        if name not in SCENES:
            scene_named(name)
    absent = {name: SCENES[name].absent for name in names if SCENES[name].absent}
    return [name for name in names if name not in absent], absent


def _points(args: argparse.Namespace, scene: str) -> list[Point]:
    """The settings that were asked for: presets, the grid, or both."""
    of = SCENES[scene]
    plain = "" if of.body else PLAIN
    points = [preset_point(name, of.frame, plain) for name in args.preset]
    if args.preset and not args.solver:
        return points
    kinds = [plain] if plain else collider_kinds(args.vary, args.colliders or [HULLS])
    solvers, membranes = args.solver or list(SOLVERS), args.membrane or [SPRINGS]
    return points + list(grid(kinds, solvers, args.sub_steps, args.passes, membranes, args.vary))


def _as_file(name: str) -> str:
    """A name that a file can have."""
    return re.sub(r"[^\w.=-]+", "_", name)


def _told_of(scene: str, kind: str, membrane: str) -> str:
    """What a reference is called."""
    return f"{scene}, {kind}" + (f", {membrane}" if membrane != SPRINGS else "")


def _file(args: argparse.Namespace, scene: str, kind: str, membrane: str) -> Path:
    name = _as_file(f"reference_{_told_of(scene, kind, membrane)}")
    return Path(args.out) / (name + (f"_{args.seconds:g}s" if args.seconds else "") + ".npz")


def _file_of(args: argparse.Namespace, scene: str, point: Point) -> Path:
    return _file(args, scene, point.kind, point.membrane)


def _references(
    args: argparse.Namespace, scenes: Sequence[str], kept: Kept
) -> dict[str, dict[str, Any]]:
    """Make the references that are missing; what is to be told of all."""
    wanted = dict.fromkeys(
        (scene, point.kind, point.membrane) for scene in scenes for point in _points(args, scene)
    )
    tasks: dict[str, Task] = {}
    for each in wanted:
        file = _file(args, *each)
        tasks[f"{VERSION} {file.name}"] = referenced, (*each, args.seconds, file)
    # Its file, too, must be there.
    tasks = {k: t for k, t in tasks.items() if kept.get(k) is None or not t[1][-1].exists()}
    for key, row in done(tasks, args.jobs, "references"):
        kept.put(key, row)
    found = {}
    for each in wanted:
        told = kept.get(f"{VERSION} {_file(args, *each).name}")
        assert told is not None
        found[_told_of(*each)] = told
    return found


def _left(
    args: argparse.Namespace, scenes: Sequence[str], kept: Kept
) -> tuple[dict[str, list[Point]], list[Row]]:
    """The settings of each scene that are measured in full, and what halving dropped."""
    points, dropped = {scene: _points(args, scene) for scene in scenes}, []
    for share in SHARES if args.halving else ():
        tasks: dict[str, Task] = {
            f"{_key(scene, point, args)} 1/{share}": (
                glanced,
                (scene, point, args.seconds, share, _file_of(args, scene, point)),
            )
            for scene, of in points.items()
            for point in of
        }
        rows = dict(zip(tasks, kept_or_done(tasks, kept, args.jobs, f"settings, 1/{share}")))
        for scene, of in points.items():
            left: list[Point] = []
            for kind in dict.fromkeys(point.kind for point in of):
                own = [point for point in of if point.kind == kind]
                seen = [rows[f"{_key(scene, point, args)} 1/{share}"] for point in own]
                best = better_half(seen, _COST, _ERROR)
                left += [own[k] for k in best]
                dropped += [row for k, row in enumerate(seen) if k not in best]
            points[scene] = left
    return points, dropped


def _rows(args: argparse.Namespace, points: dict[str, list[Point]], kept: Kept) -> list[Row]:
    """Measure the rows that are missing; all of these settings."""
    tasks: dict[str, Task] = {}
    for scene, of in points.items():
        for point in of:
            file = _file_of(args, scene, point)
            asked = (scene, point, args.seconds, args.repeats, file)
            tasks[_key(scene, point, args)] = measured, asked
    return kept_or_done(tasks, kept, args.jobs, "settings")


def _key(scene: str, point: Point, args: argparse.Namespace) -> str:
    """What makes two rows the same."""
    asked = (VERSION, scene, *astuple(point), args.seconds, args.repeats, args.jobs)
    return " ".join(map(str, asked))
