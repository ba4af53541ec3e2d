"""Work against precision: what an error of so many millimetres costs with each solver.

    python bench/work_precision.py [--json]

The cloth of `bench/drape.py` falls on its sphere; after 30 frames of 1/60 s, while it still swings
down, its vertices are compared with a reference: `xpbd` with 960 sub-steps a frame. Error is the
root mean square distance; what is below that of another reference, `implicit` with 64 sub-steps of
30 iterations, cannot be told apart. Work is processor time per frame over F, three plain C sweeps
over the cloth's springs, timed before and after in the same run.
"""

import argparse
import json
import sys
import tempfile
import time
from typing import Any

import numpy as np
from drape import FRAME, RADIUS, Unit, cloth

from garment_sim_ros.geometry.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.params import ImplicitSettings, RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation

FRAMES = 30
REFERENCE = ("xpbd", XpbdSettings(sub_step=FRAME / 960, bending_every=4), FRAME)
CHECK = ("implicit", ImplicitSettings(sub_step=FRAME / 64, iterations=30), FRAME)


def settings() -> dict[str, tuple[str, Any, float]]:
    """Solver, numerical parameters and step of every row."""
    rows: dict[str, tuple[str, Any, float]] = {}
    for steps, sweeps in ((1, 3), (1, 10), (3, 3), (3, 10), (6, 10), (12, 10), (30, 10)):
        rows[f"relaxation, {steps} x {sweeps} sweeps"] = (
            "relaxation",
            RelaxationSettings(sweeps=sweeps),
            FRAME / steps,
        )
    for n in (5, 10, 20, 40, 80, 160):
        rows[f"xpbd, {n} sub-steps"] = ("xpbd", XpbdSettings(sub_step=FRAME / n), FRAME)
    for n, k in ((1, 1), (1, 2), (1, 4), (1, 8), (1, 16), (2, 8), (4, 8), (8, 8), (16, 8)):
        rows[f"implicit, {n} x {k} iterations"] = (
            "implicit",
            ImplicitSettings(sub_step=FRAME / n, iterations=k),
            FRAME,
        )
    return rows


def fall(solver: str, numbers: object, step: float, folder: str) -> tuple[np.ndarray, float]:
    """Vertices after the last frame [m], shape [v, 3], and work per frame [F]."""
    ball = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": RADIUS})
    frame = Collider(name="frame_bone", kind="frame", bone="bone")
    simulation = Simulation(
        (cloth(()),),
        ColliderSet(colliders=(frame, ball)),
        solver=solver,
        settings=numbers,  # type: ignore[arg-type]
        solver_step=step,
    )
    still = ColliderPoses.identity(2)
    unit = Unit(simulation, folder)
    f, times = unit.measure(), []
    for _ in range(FRAMES):
        start = time.thread_time()
        simulation.advance(still, still, FRAME)
        times.append(time.thread_time() - start)
    f = 0.5 * (f + unit.measure())
    return simulation.positions("cloth").astype(np.float64), float(np.median(times)) / f


def distance(a: np.ndarray, b: np.ndarray) -> float:
    """Root mean square distance of two sets of vertices [mm]."""
    return 1e3 * float(np.sqrt(((a - b) ** 2).sum(axis=1).mean()))


def main() -> None:
    """Runs every setting."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        reference = fall(*REFERENCE, folder)[0]
        doubt = distance(fall(*CHECK, folder)[0], reference)
        print(f"references differ by {doubt:.2f} mm", file=sys.stderr)
        rows = {}
        for name, setting in settings().items():
            fall(*setting, folder)  # Once before it counts.
            x, work = fall(*setting, folder)
            rows[name] = {"work_F": round(work, 2), "error_mm": round(distance(x, reference), 2)}
            if not options.json:
                print(f"{name}: {rows[name]['work_F']} F, {rows[name]['error_mm']} mm", flush=True)
    if options.json:
        print(json.dumps({"references_differ_mm": round(doubt, 2), "rows": rows}))


if __name__ == "__main__":
    main()
