"""`stability`: drives the solvers to extremes and says where they hold."""

import argparse
import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from garment_sim_ros.cli.preset_options import add_preset_options, choice_of
from garment_sim_ros.cli.progress import progress
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import LifecycleParameters, declarations, validated
from garment_sim_ros.presets import Choice, chosen
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.stability.cells import Cell, cells
from garment_sim_ros.stability.judge import Outcome, judge
from garment_sim_ros.stability.map import Row, held_by, picture, table

EXAMPLE = "garment-sim stability --out out/stability"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    add("--out", metavar="DIR", type=Path, required=True, help="stability.md, .json and .png")
    add("--solver", choices=tuple(SOLVERS), action="append", help="only this one; may be repeated")
    add_preset_options(parser)
    add(
        "--only",
        metavar="TEXT",
        action="append",
        help="only cells (one extreme each) with this in their name: 'wind'; may be repeated",
    )
    add("--seed", type=int, default=1, help="of the cells that are drawn at random")
    add("--list", action="store_true", help="name the cells and run none")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run, judge, draw."""
    chosen = _chosen(args)
    if args.list:
        print("\n".join(cell.name + (cell.absent and f" ({cell.absent})") for cell in chosen))
        return {"cells": [cell.name for cell in chosen]}
    settings = _settings(args)
    with staged(args.out) as stage:
        rows = []
        for cell in progress(chosen, "cells", len(chosen)):
            rows.append(_row(cell, settings, _is_usual(args)))
        told: dict[str, Any] = {
            "cells": len(rows),
            "preset": args.preset,
            "skipped": {f"{r.extreme}: {r.value}": r.skipped for r in rows if r.skipped},
            "held": held_by(rows),
            "outcomes": [
                {
                    "extreme": row.extreme,
                    "value": row.value,
                    "solver": solver,
                    "faults": list(outcome.faults),
                    "refused": outcome.refused,
                    "skipped": outcome.skipped,
                    "seconds": round(row.seconds[solver], 1),
                    **outcome.figures,
                }
                for row in rows
                for solver, outcome in row.outcomes.items()
            ],
        }
        (stage / "stability.json").write_text(json.dumps(told, indent=1) + "\n")
        (stage / "stability.md").write_text(table(rows))
        picture(rows, stage / "stability.png")
    print(table(rows), end="")
    for name, why in told["skipped"].items():
        print(f"skipped: {name}: {why}", file=sys.stderr)
    return {key: told[key] for key in ("cells", "skipped", "held")} | {"out": str(args.out)}


def _chosen(args: argparse.Namespace) -> list[Cell]:
    """The cells that are asked for.

    Raises:
        ParameterError: No cell has what one of them shall have in its name.
    """
    every, texts = list(cells(args.seed)), args.only or [""]
    for text in texts:
        if not any(text in cell.name for cell in every):
            raise ParameterError(
                "--only",
                f"found {text!r}, which is in no cell's name",
                "allowed: a part of a name that --list prints",
            )
    return [cell for cell in every if any(text in cell.name for text in texts)]


def _settings(args: argparse.Namespace) -> dict[str, Any]:
    """Settings by solver: of all, or of those that are asked for.

    Raises:
        ParameterError: What the scenes themselves say, or what a solver does not have.
    """
    if args.solver:
        if any(text.split("=")[0].strip() == "cloth_node.solver" for text in args.set):
            raise ParameterError("--set cloth_node.solver", "is beside --solver", "allowed: one")
        return {
            name: _settings_of(chosen(args.preset, [*args.set, f"cloth_node.solver={name}"]))
            for name in args.solver
        }
    choice = choice_of(args)
    if _is_usual(args):
        return {name: solver.settings() for name, solver in SOLVERS.items()}
    return {choice.solver: _settings_of(choice)}


def _settings_of(choice: Choice) -> Any:
    """Settings of one solver, see `_settings`."""
    group = SOLVERS[choice.solver].settings
    allowed = ["solver", *declarations(group)]
    for node, single in choice.single.items():
        for name in single:
            if node != "cloth_node" or name not in allowed:
                known = ", ".join(f"cloth_node.{n}" for n in allowed)
                raise ParameterError(
                    f"--set {node}.{name}", "is what the scenes say", f"allowed: {known}"
                )
    return validated(group, choice.values("cloth_node", group))


def _is_usual(args: argparse.Namespace) -> bool:
    """Whether no preset but the default, and no single values are asked for."""
    return args.preset == LifecycleParameters().preset and not args.set


def _row(cell: Cell, settings: Mapping[str, Any], usual: bool) -> Row:
    """One cell with every solver; those of a preset only where nothing else is asked for."""
    outcomes, seconds = {}, {}
    scene = None if cell.absent else cell.scene()
    for solver, numbers in settings.items():
        began = time.perf_counter()
        why = cell.absent
        if scene and scene.preset and (own := Choice(preset=scene.preset).solver) != solver:
            why = f"{scene.preset} has {own}"
        elif scene and scene.preset and not usual:
            why = f"{scene.preset} says all; allowed: no --preset or --set beside it"
        outcomes[solver] = (
            Outcome(skipped=why) if why or not scene else judge(scene, solver, numbers)
        )
        seconds[solver] = time.perf_counter() - began
    return Row(extreme=cell.extreme, value=cell.value, outcomes=outcomes, seconds=seconds)
