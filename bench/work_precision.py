"""Work against precision: what an error of so many millimetres costs with each solver.

    python bench/work_precision.py [--picture docs/measurements/work_precision.png] [--json]
    python bench/work_precision.py --fabric weave

A cloth of 1 m x 1 m, 50 x 50 vertices, hangs by one side, is let go from a slope and swings for
30 frames of 1/60 s. It is of a preset fabric, or of that of `bench/drape.py` (`weave`). Its
vertices are compared with those of a reference in every frame: `xpbd` with 960 sub-steps a frame.
Error is the root mean square distance over vertices and frames; another reference, `implicit` with
32 sub-steps of 20 iterations, tells how good that is. Work is processor time per frame over F,
three plain C sweeps over the cloth's springs, timed in turns with the frames.
"""

import argparse
import dataclasses
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from drape import FRAME, MATERIAL, Unit, cloth
from PIL import Image, ImageDraw, ImageFont

from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.garment.materials import PRESETS
from garment_sim_ros.params import ImplicitSettings, RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation

FRAMES = 30
SLOPE = np.radians(45.0)
"""How far from the horizontal the cloth starts, downwards."""
REFERENCE = ("xpbd", XpbdSettings(sub_step=FRAME / 960, search_every=4), FRAME)
CHECK = ("implicit", ImplicitSettings(sub_step=FRAME / 32, iterations=20), FRAME)
COLOUR = {
    "relaxation": (120, 120, 120),
    "xpbd": (31, 119, 180),
    "xpbd, coarse": (40, 150, 60),
    "implicit": (214, 110, 20),
}


def settings() -> dict[str, dict[str, tuple[str, Any, float]]]:
    """Solver, numerical parameters and step of every row, by solver."""
    rows: dict[str, dict[str, tuple[str, Any, float]]] = {solver: {} for solver in COLOUR}
    for steps in (1, 2, 3, 6, 12, 30):
        for sweeps in (1, 3, 10, 30):
            if steps * sweeps <= 120:
                numbers = RelaxationSettings(sweeps=sweeps)
                step = FRAME / steps
                rows["relaxation"][f"{steps} x {sweeps}"] = ("relaxation", numbers, step)
    for n in (5, 7, 10, 15, 20, 30, 40, 60, 80, 160, 320):
        rows["xpbd"][f"{n}"] = ("xpbd", XpbdSettings(sub_step=FRAME / n), FRAME)
        numbers = XpbdSettings(sub_step=FRAME / n, coarse=True)
        rows["xpbd, coarse"][f"{n}"] = ("xpbd", numbers, FRAME)
    for n in (1, 2, 4, 8, 16):
        for k in (1, 2, 4, 8, 16):
            if n * k <= 64:
                rows["implicit"][f"{n} x {k}"] = (
                    "implicit",
                    ImplicitSettings(sub_step=FRAME / n, iterations=k),
                    FRAME,
                )
    return rows


def swing(
    solver: str, numbers: object, step: float, fabric: str, folder: str
) -> tuple[np.ndarray, float]:
    """Vertices after every frame [m], shape [frames, v, 3], and work per frame [F]."""
    flat = cloth(tuple(range(50)))
    x, y, z = (flat.vertices - flat.vertices[0]).T
    down = np.stack([x * np.cos(SLOPE), y, z - x * np.sin(SLOPE)], axis=-1)
    material = MATERIAL
    if fabric != "weave":
        material = dataclasses.replace(PRESETS[fabric].material, damping=MATERIAL.damping)
    simulation = Simulation(
        (dataclasses.replace(flat, vertices=down, material=material),),
        ColliderSet(colliders=(Collider(name="frame_bone", kind="frame", bone="bone"),)),
        solver=solver,
        settings=numbers,  # type: ignore[arg-type]
        solver_step=step,
    )
    still = ColliderPoses.identity(1)
    unit, cost, way = Unit(simulation, folder), [], []
    for _ in range(FRAMES):
        f = unit.measure(3)
        start = time.thread_time()
        simulation.advance(still, still, FRAME)
        cost.append((time.thread_time() - start) / f)
        way.append(simulation["cloth"].simulated.astype(np.float64))
    return np.array(way), float(np.median(cost))


def distance(a: np.ndarray, b: np.ndarray) -> float:
    """Root mean square distance of two motions [mm]."""
    return 1e3 * float(np.sqrt(((a - b) ** 2).sum(axis=-1).mean()))


def front(rows: dict[str, dict[str, float]]) -> list[str]:
    """Rows that no other one beats in work and error, by work."""
    best, names = np.inf, []
    for name in sorted(rows, key=lambda n: rows[n]["work_F"]):
        if rows[name]["error_mm"] < best:
            best = rows[name]["error_mm"]
            names.append(name)
    return names


def draw(measured: dict[str, dict[str, dict[str, float]]], doubt: float, path: Path) -> None:
    """The picture: error against work, both logarithmic, and each solver's front."""
    all_rows = [row for rows in measured.values() for row in rows.values()]
    lowest = [min(r["work_F"] for r in all_rows), min(r["error_mm"] for r in all_rows)]
    highest = [max(r["work_F"] for r in all_rows), max(r["error_mm"] for r in all_rows)]
    low, high = np.log10(lowest) - 0.1, np.log10(highest) + 0.1
    size, left, top = np.array([560, 380]), 60, 14
    image = Image.new("RGB", (left + size[0] + 14, top + size[1] + 44), (250, 250, 248))
    pen, font, ink = ImageDraw.Draw(image), ImageFont.load_default(13), (40, 44, 48)

    def at(work: float, error: float) -> tuple[float, float]:
        u, v = (np.log10([work, error]) - low) / (high - low) * size
        return left + float(u), top + float(size[1] - v)

    for axis in (0, 1):
        for power in range(-3, 5):
            for digit in (1, 2, 5):
                value = digit * 10.0**power
                if not low[axis] < np.log10(value) < high[axis]:
                    continue
                if axis == 0:
                    x = at(value, 1.0)[0]
                    pen.line((x, top, x, top + size[1]), (222, 222, 218))
                    pen.text((x, top + size[1] + 4), f"{value:g}", ink, font, anchor="ma")
                else:
                    y = at(1.0, value)[1]
                    pen.line((left, y, left + size[0], y), (222, 222, 218))
                    pen.text((left - 6, y), f"{value:g}", ink, font, anchor="rm")
    pen.text((left + size[0] / 2, top + size[1] + 24), "work per frame, F", ink, font, anchor="ma")
    pen.text((left + size[0] / 2, top + 4), "error, mm", ink, font, anchor="ma")
    for name, value in (("5 mm", 5.0), ("the references differ", doubt)):
        y = at(1.0, value)[1]
        pen.line((left, y, left + size[0], y), ink)
        pen.text((left + 6, y - 2), name, ink, font, anchor="ls")
    for n, (solver, rows) in enumerate(measured.items()):
        for row in rows.values():
            x, y = at(row["work_F"], row["error_mm"])
            pen.ellipse((x - 3, y - 3, x + 3, y + 3), outline=COLOUR[solver])
        best = [at(rows[m]["work_F"], rows[m]["error_mm"]) for m in front(rows)]
        pen.line(best, COLOUR[solver], 2)
        for x, y in best:
            pen.ellipse((x - 3, y - 3, x + 3, y + 3), COLOUR[solver])
        pen.text((left + size[0] - 6, top + 6 + 18 * n), solver, COLOUR[solver], font, anchor="ra")
    image.save(path)


def main() -> None:
    """Runs every setting."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--fabric", default="cotton_jersey", choices=("weave", *PRESETS))
    parser.add_argument("--picture", type=Path, help="PNG to draw")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    measured: dict[str, dict[str, dict[str, float]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        reference = swing(*REFERENCE, options.fabric, folder)[0]
        doubt = distance(swing(*CHECK, options.fabric, folder)[0], reference)
        print(f"references differ by {doubt:.2f} mm", file=sys.stderr, flush=True)
        for solver, rows in settings().items():
            swing(*next(iter(rows.values())), options.fabric, folder)  # Once before it counts.
            measured[solver] = {}
            for name, setting in rows.items():
                way, work = swing(*setting, options.fabric, folder)
                row = {"work_F": round(work, 2), "error_mm": round(distance(way, reference), 3)}
                measured[solver][name] = row
            if not options.json:
                for name in front(measured[solver]):
                    row = measured[solver][name]
                    print(f"{solver} {name}: {row['work_F']} F, {row['error_mm']} mm", flush=True)
    if options.picture:
        draw(measured, doubt, options.picture)
    if options.json:
        print(json.dumps({"references_differ_mm": round(doubt, 3), "rows": measured}))


if __name__ == "__main__":
    main()
