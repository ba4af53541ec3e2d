"""What each feature costs, and what it does, alone: the dressed walk with and without it.

    python bench/features.py [--seconds 4] [--solver xpbd] [--json]

A T-shirt and a short skirt of 1,503 and 1,687 vertices on the walking mannequin with hulls, a
solver at its defaults. "Plain" has one layer, no farthest distance and no friction; every other
row adds one thing to it, but one takes bending away. All rows take turns, frame by frame, in one
run: cost is the median over frames of a row's processor time over that of "plain" in the same
frame. Effect is how far the cloth is from where it is without the feature, 95th percentile over
particles and frames; memory is what a row takes more than "plain".
"""

import argparse
import dataclasses
import itertools
import json
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from tradeoff import FRAME, Walk

from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.params import ColliderOptions, Environment
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS

Garments = list[Garment]
Change = Callable[[Garment], Garment]


@dataclasses.dataclass
class Row:
    """What differs from the plain walk."""

    garments: Garments
    environment: Environment = dataclasses.field(default_factory=Environment)


def rows(worn: Garments) -> dict[str, Row]:
    """All rows; the plain one first."""

    def changed(change: Change) -> Row:
        return Row([change(garment) for garment in plain])

    def each(**fields: Any) -> Row:
        return changed(lambda g: dataclasses.replace(g, **fields))

    def fabric(garment: Garment, **fields: float) -> Garment:
        material = dataclasses.replace(garment.material, **fields)
        return dataclasses.replace(garment, material=material)

    def everywhere(name: str, distance: float) -> Row:
        return changed(
            lambda g: dataclasses.replace(
                g, skin_limits={name: np.full(len(g.vertices), distance)}
            )
        )

    plain = [dataclasses.replace(fabric(g, friction=0.0), layer=0, skin_limits={}) for g in worn]
    layered = [dataclasses.replace(g, layer=k) for g, k in zip(plain, (1, 0))]
    breeze = Environment(wind=(2.0, 0.0, 0.0), wind_drag=1.2, wind_lift=0.4)
    return {
        "plain": Row(plain),
        "no bending": changed(lambda g: fabric(g, bending_stiffness=0.0)),
        "friction": changed(lambda g: fabric(g, friction=0.3)),
        "layers": Row(layered),
        "max_distance 0.1 m": everywhere("max_distance", 0.1),
        "backstop 0.02 m": everywhere("backstop", 0.02),
        "tethers": each(tethers=0.02),
        "self-collision 5 mm": each(self_collision=0.005),
        "wind on triangles": Row(plain, breeze),
        "gusts": Row(plain, dataclasses.replace(breeze, gust=1.0)),
        "root motion taken out": Row(
            plain, Environment(root_linear_inertia=0.0, root_angular_inertia=0.0)
        ),
    }


def made(row: Row, colliders: ColliderSet, solver: str) -> tuple[Simulation, float]:
    """A simulation, and the memory that it took [MB]."""
    tracemalloc.start()
    simulation = Simulation(
        row.garments,
        colliders,
        environment=row.environment,
        solver=solver,
    )
    size = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    return simulation, 1e-6 * size


def main() -> None:
    """Runs all rows in turns."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--solver", default="xpbd", choices=SOLVERS)
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    walk = Walk("mannequin", "walk", options.seconds)
    colliders = fit_colliders(walk.body, ColliderOptions())
    worn = load_outfit("tshirt_short_skirt", walk.body, colliders=colliders).garments
    path = walk.poses(colliders)
    simulations, memory = {}, {}
    for name, row in rows(list(worn)).items():
        simulations[name], memory[name] = made(row, colliders, options.solver)
        simulations[name].reset(path[0])
    times: dict[str, list[float]] = {name: [] for name in simulations}
    apart: dict[str, list[np.ndarray]] = {name: [] for name in simulations}
    for start, end in itertools.pairwise(path):
        for name, simulation in simulations.items():
            begin = time.thread_time()
            simulation.advance(start, end, FRAME)
            times[name].append(time.thread_time() - begin)
        for name, simulation in simulations.items():
            for garment in simulation.names:
                x, plain = (s.positions(garment) for s in (simulation, simulations["plain"]))
                apart[name].append(np.linalg.norm(x - plain, axis=1))
    told = {}
    plain_time = np.array(times["plain"])
    for name, spent in times.items():
        ratio = np.array(spent) / plain_time
        told[name] = {
            "cost": round(float(np.median(ratio)), 3),
            "cost_p10": round(float(np.percentile(ratio, 10)), 3),
            "cost_p90": round(float(np.percentile(ratio, 90)), 3),
            "memory_mb": round(memory[name] - memory["plain"], 2),
            "effect_mm_p95": round(
                1e3 * float(np.percentile(np.concatenate(apart[name]), 95.0)), 1
            ),
        }
    plain_ms = 1e3 * float(np.median(plain_time))
    if options.json:
        print(json.dumps({"plain_ms": round(plain_ms, 3), "rows": told}))
        return
    print(f"plain: {plain_ms:.2f} ms a frame")
    print("| Feature | Cost | Memory | Effect, p95 |\n|---|---|---|---|")
    for name, row in told.items():
        print(
            f"| {name} | x {row['cost']:.2f} ({row['cost_p10']:.2f}-{row['cost_p90']:.2f}) | "
            f"{row['memory_mb']:.2f} MB | {row['effect_mm_p95']:.1f} mm |"
        )


if __name__ == "__main__":
    main()
