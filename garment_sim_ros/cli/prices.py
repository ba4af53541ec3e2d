"""`tradeoff --prices`: what each feature costs and what it removes."""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from garment_sim_ros.cli.kept_tasks import Task, kept_in, kept_or_done
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.tradeoff.features import FEATURES
from garment_sim_ros.tradeoff.price_list import line, markdown, write_csv
from garment_sim_ros.tradeoff.prices import priced
from garment_sim_ros.tradeoff.table import machine
from garment_sim_ros.version import VERSION

_USUAL = "balanced"


def run_prices(
    args: argparse.Namespace, scenes: Sequence[str], skipped: Mapping[str, str]
) -> dict[str, Any]:
    """Price what is missing, tell all.

    Args:
        args: The command's options.
        scenes: Names of the scenes.
        skipped: Why others are left out, by name.
    """
    tasks: dict[str, Task] = {}
    for scene in scenes:
        for preset in args.preset or [_USUAL]:
            for feature in args.prices or FEATURES:
                asked = (scene, preset, feature, args.seconds, args.repeats)
                key = " ".join(map(str, ("price", VERSION, *asked, args.jobs)))
                tasks[key] = priced, asked
    rows = kept_or_done(tasks, kept_in(args.out), args.jobs, "features")
    result = {"machine": machine(args.jobs), "skipped": dict(skipped), "prices": rows}
    with staged(args.out) as stage:
        (stage / "prices.json").write_text(json.dumps(result, indent=1, allow_nan=False) + "\n")
        (stage / "prices.md").write_text(markdown(rows))
        write_csv(rows, stage / "prices.csv")
    for (scene, preset), of in _by_base(rows).items():
        base = next(
            (r[f"{r['in_preset']}_ms"] for r in of if "in_preset" in r and "on_ms" in r), 0
        )
        print(f"{scene}, {preset}: {base:.2f} ms a frame")
        for row in of:
            print(f"  {line(row)}")
    for name, why in skipped.items():
        print(f"skipped: {name}: {why}", file=sys.stderr)
    return result | {"out": str(args.out)}


def _by_base(rows: Sequence[dict[str, Any]]) -> dict[tuple[str, str], list[dict[str, Any]]]:
    """Rows by scene and preset."""
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        found.setdefault((row["scene"], row["preset"]), []).append(row)
    return found
