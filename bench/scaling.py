"""How cost grows with the number of vertices: the cloth of `drape.py`, finer and finer.

    python bench/scaling.py [--sides 50 75 100 150 300] [--frames 12] [--json]

Frames of 1/60 s while the cloth lies on the sphere, processor time of one thread, all sizes in
turns so that a slow moment of the machine hits all of them; medians. The exponent is that of a
straight line through the logarithms. F is the time of three plain C sweeps of the same cloth.
"""

import argparse
import json
import tempfile
import time

import drape
import numpy as np
from springs import grid

from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.params import RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation

SETTINGS = {
    "relaxation": (RelaxationSettings(sweeps=3), drape.FRAME / 3),
    "xpbd": (XpbdSettings(sub_step=drape.FRAME / 10, search_every=10), drape.FRAME),
}
FALL = 20


def scene(solver: str, side: int, pins: int = 0) -> Simulation:
    """A cloth of side x side vertices just over the sphere, the first so many pinned."""
    vertices, triangles = grid(side)
    vertices = vertices - 0.5 * np.array([1.0, 1.0, 0.0]) + [0.0, 0.0, drape.RADIUS + 0.01]
    garment = Garment.from_mesh(
        vertices, triangles, material=drape.MATERIAL, pins=range(pins), bone="bone"
    )
    ball = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": drape.RADIUS})
    frame = Collider(name="frame_bone", kind="frame", bone="bone")
    settings, step = SETTINGS[solver]
    return Simulation(
        (garment,),
        ColliderSet(colliders=(frame, ball)),
        solver=solver,
        settings=settings,
        solver_step=step,
    )


def measure(solver: str, sides: list[int], frames: int, folder: str) -> dict[str, float]:
    """Milliseconds a frame for each size, and the exponent."""
    still = ColliderPoses.identity(2)
    scenes = [scene(solver, side) for side in sides]
    units = [drape.Unit(one, folder) for one in scenes]
    for one in scenes:
        for _ in range(FALL):
            one.advance(still, still, drape.FRAME)
    times = np.zeros((frames, len(sides)))
    sweeps = np.zeros((frames, len(sides)))
    for row, unit_row in zip(times, sweeps):
        for k, one in enumerate(scenes):
            begin = time.thread_time()
            one.advance(still, still, drape.FRAME)
            row[k] = time.thread_time() - begin
            unit_row[k] = units[k].measure(3)
    cost, unit = np.median(times, axis=0), np.median(sweeps, axis=0)
    counts = np.array(sides) ** 2
    figures = {f"{n}_ms": round(1e3 * float(c), 3) for n, c in zip(counts, cost)}
    figures |= {f"{n}_F": round(float(c / u), 2) for n, c, u in zip(counts, cost, unit)}
    exponents = {"exponent": cost, "exponent_of_plain_c": unit}
    return figures | {
        name: round(float(np.polyfit(np.log(counts), np.log(values), 1)[0]), 3)
        for name, values in exponents.items()
    }


def main() -> None:
    """Measures both solvers."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sides", type=int, nargs="+", default=[50, 75, 100, 150, 300])
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    table = {}
    with tempfile.TemporaryDirectory() as folder:
        for solver in SETTINGS:
            table[solver] = measure(solver, options.sides, options.frames, folder)
            if not options.json:
                told = ", ".join(f"{k} {v}" for k, v in table[solver].items())
                print(f"{solver}: {told}", flush=True)
    if options.json:
        print(json.dumps(table))


if __name__ == "__main__":
    main()
