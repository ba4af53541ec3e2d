"""Whether the front of speed and accuracy is where it was: fails where it is worse.

    python bench/front.py [--seconds 2] [--scene drape hung fast balanced accurate] [--json]

Takes a minute. Speed is processor time of a frame over F, three sweeps of a plain C loop
(`springs.c`) over the same garments' springs, timed in turns in the same run; accuracy is
absolute. `drape` and `hung` are a sheet of 50 x 50 vertices on a ball and by two corners, at the
settings of `balanced`; `fast`, `balanced` and `accurate` are the presets in the walk of the demo.
A figure that is not a number, or missing, is worse than any limit. Exits with 1 where a figure is
beyond its limit.

Limits of speed leave a third above what was measured, for other processors and busy machines;
those of accuracy a tenth to a fifth. The hung sheet still swings.
"""

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from drape import Unit, run
from presets import Clip, Wearer

from garment_sim_ros.params import XpbdSettings
from garment_sim_ros.presets import chosen
from garment_sim_ros.sim.simulation import Simulation

SHEET = {"cost_F": 18.0, "stretch_p95_percent": 2.4, "rest_speed_mm_s": 2.0, "penetration_mm": 1.0}
LIMITS: Mapping[str, Mapping[str, float]] = {
    "drape": SHEET,
    "hung": {"cost_F": 14.0, "stretch_p95_percent": 4.4},
    "fast": {"cost_F": 10.0, "stretch_p95_percent": 4.0, "pierced": 0.0, "inside_p99": 0.01},
    "balanced": {"cost_F": 38.0, "stretch_p95_percent": 2.8, "pierced": 0.0, "inside_p99": 0.01},
    "accurate": {"cost_F": 72.0, "stretch_p95_percent": 2.1, "pierced": 0.0, "inside_p99": 0.01},
}
"""Largest figures that are allowed, by scene."""


def sheet(name: str, folder: str) -> dict[str, float]:
    """Figures of the sheet at the settings of `balanced`."""
    step = 1 / 180
    return run("xpbd", XpbdSettings(), step, folder, 1 / 60, pinned=name == "hung")


def walk(preset: str, seconds: float, folder: str) -> dict[str, float]:
    """Figures of a preset in the walk."""
    wearer = Wearer(chosen(preset), Clip("walk", "walk"), seconds, "mannequin")
    # Of all springs, however many the preset simulates.
    whole = Simulation(wearer.garments, wearer.avatar.colliders)
    units = [Unit(whole, folder, name) for name in whole.names]
    cost = []
    for n in range(1, len(wearer.poses)):
        unit = sum(u.measure(3) for u in units)
        wearer.frame(n)
        cost.append(wearer.times[-1] / unit)
    told = wearer.figures()
    return {
        "cost_F": float(np.median(cost)),
        "stretch_p95_percent": 100.0 * told["strain_p95"],
        "pierced": told["pierced"],
        "inside_p99": told["inside_p99"],
    }


def worse(
    found: Mapping[str, Mapping[str, float]], limits: Mapping[str, Mapping[str, float]]
) -> list[str]:
    """What is beyond its limit, a line each."""
    lines = []
    for scene, figures in found.items():
        for name, limit in limits[scene].items():
            value = figures.get(name, math.nan)
            if not value <= limit:
                lines.append(f"{scene}: {name} is {value:.4g}; allowed: up to {limit:g}")
    return lines


def main() -> int:
    """Measures, prints, judges."""
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--seconds", type=float, default=2.0, help="of the walk")
    options.add_argument("--scene", nargs="+", choices=list(LIMITS), default=list(LIMITS))
    options.add_argument("--json", action="store_true")
    args = options.parse_args()
    found: dict[str, dict[str, Any]] = {}
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        for name in args.scene:
            is_sheet = name in ("drape", "hung")
            made = sheet(name, folder) if is_sheet else walk(name, args.seconds, folder)
            found[name] = {key: made[key] for key in LIMITS[name]}
            limits = ", ".join(
                f"{key} {value:.4g} of {LIMITS[name][key]:g}" for key, value in found[name].items()
            )
            print(f"{name}: {limits}", flush=True)
    lines = worse(found, LIMITS)
    for line in lines:
        print(f"worse: {line}", file=sys.stderr)
    print(f"{len(lines)} figures worse, {time.monotonic() - began:.0f} s")
    if args.json:
        print(json.dumps(found))
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
