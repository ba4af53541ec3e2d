"""`stability`: drives the solvers to extremes and says where they hold."""

import argparse
import json
from pathlib import Path
from typing import Any

from garment_sim_ros.cli.progress import progress
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.stability.cells import cells
from garment_sim_ros.stability.judge import judge
from garment_sim_ros.stability.map import Row, picture, table

EXAMPLE = "garment-sim stability --out out/stability"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    add("--out", metavar="DIR", type=Path, required=True, help="stability.md, .json and .png")
    add("--solver", choices=tuple(SOLVERS), action="append", help="only this one; may be repeated")
    add("--only", metavar="TEXT", default="", help="only cells with this in their name: 'wind'")
    add("--list", action="store_true", help="name the cells and run none")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run, judge, draw."""
    chosen = [cell for cell in cells() if args.only in cell.name]
    if not chosen:
        raise ParameterError("--only", f"found {args.only!r}", "allowed: see --list")
    if args.list:
        print("\n".join(cell.name for cell in chosen))
        return {"cells": [cell.name for cell in chosen]}
    solvers = args.solver or list(SOLVERS)
    with staged(args.out) as stage:
        rows = []
        for cell in progress(chosen, "cells", len(chosen)):
            scene = cell.scene()
            rows.append(
                Row(
                    extreme=cell.extreme,
                    value=cell.value,
                    outcomes={solver: judge(scene, solver) for solver in solvers},
                )
            )
        told = {
            "cells": len(rows),
            "held": {s: sum(not row.outcomes[s].faults for row in rows) for s in solvers},
            "outcomes": [
                {
                    "extreme": row.extreme,
                    "value": row.value,
                    "solver": solver,
                    "faults": list(outcome.faults),
                    "refused": outcome.refused,
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
    return {"cells": told["cells"], "held": told["held"], "out": str(args.out)}
