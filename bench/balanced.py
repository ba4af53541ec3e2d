"""The dressed walk at settings that balance speed and accuracy: four figures for each.

    python bench/balanced.py [--setting xpbd:20:10:1 relaxation:6:3] [--json]

A T-shirt and a short skirt of 1,503 and 1,687 vertices on the walking mannequin, 60 frames a
second. A setting is ``relaxation:STEPS:SWEEPS`` or ``xpbd:SUB_STEPS:SEARCH_EVERY:ITERATIONS``,
steps for each frame; a last ``:1`` asks for the coarse level. Fabrics are the outfit's but for
`--stretch` and `--shear`: jersey gives by more than the goal itself. The figures:

- processor time of a frame of one thread, all contacts included, median over the walk; `ms`
  as it would be where three C sweeps over the springs of `bench/springs.py` take 140 us, from F of
  both garments in the same run, `ms_here` as it is;
- stretch of mesh edges, 95th percentile over the walk after its first second, 10 times a second;
- depth in the colliders' surfaces at particles, edge midpoints and triangle centres, 99th
  percentile over the same;
- highest RMS speed of a garment in the last 10 frames of standing still on the last pose.
"""

import argparse
import dataclasses
import itertools
import json
import tempfile
import time
from typing import Any

import numpy as np
from drape import Unit
from tradeoff import FRAME, Walk

from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.generators import tshirt
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.jit import kernel
from garment_sim_ros.params import ColliderOptions, RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation

GOALS = {"ms": 3.0, "stretch_p95": 0.02, "depth_mm_p99": 2.0, "rest_mm_s": 1.0}


@kernel()
def deepest(shapes, posed, points, depth):
    """Depth of points [n, 3] in the deepest shape [m], 0 outside of all, shape [n]."""
    for p in range(points.shape[0]):
        depth[p] = 0.0
        for k in range(shapes.kind.size):
            d, _, _, _ = shape_distance(
                shapes, posed, k, points[p, 0], points[p, 1], points[p, 2], np.float32(0.0)
            )
            depth[p] = max(depth[p], -d)


class Meter:
    """Stretch and depth of one garment, collected."""

    def __init__(self, simulation: Simulation, name: str, vertices: Any, triangles: Any) -> None:
        self.simulation, self.name, self.triangles = simulation, name, triangles
        self.edges = mesh_topology(triangles).edges
        self.rest = np.linalg.norm(np.diff(vertices[self.edges], axis=1)[:, 0], axis=1)
        self.stretch: list[Any] = []
        self.depth: list[Any] = []

    def add(self) -> None:
        """Takes the garment as it is."""
        simulation = self.simulation
        x = simulation.positions(self.name).astype(np.float64) - simulation.origin
        span = x[self.edges]
        length = np.linalg.norm(span[:, 1] - span[:, 0], axis=1)
        self.stretch.append(length / self.rest - 1.0)
        points = np.concatenate([x, span.mean(axis=1), x[self.triangles].mean(axis=1)])
        depth = np.zeros(len(points), np.float32)
        colliders = simulation.collider_state
        deepest(colliders.shapes, colliders.posed, points.astype(np.float32), depth)
        self.depth.append(depth)


def chosen(text: str) -> tuple[str, Any, float]:
    """Solver, settings and longest step [s] of a setting."""
    solver, *numbers = text.split(":")
    n = [int(number) for number in numbers]
    if solver == "relaxation":
        return solver, RelaxationSettings(sweeps=n[1]), FRAME / n[0]
    settings = XpbdSettings(
        sub_step=FRAME / n[0], search_every=n[1], iterations=n[2], coarse=n[3:] == [1]
    )
    return solver, settings, FRAME


def worn(walk: Walk, colliders: ColliderSet, options: Any) -> list[Garment]:
    """The outfit's garments; a T-shirt of another ease where one is asked for."""
    garments = list(load_outfit(options.outfit, walk.body, colliders=colliders).garments)
    for k, garment in enumerate(garments):
        if options.ease is not None and garment.name == "tshirt":
            cut = tshirt(walk.body, colliders=colliders, ease=options.ease)
            garments[k] = dataclasses.replace(cut, material=garment.material, layer=garment.layer)
    return garments


def run(walk: Walk, setting: str, options: Any, folder: str) -> dict[str, float]:
    """Walks once, stands, and gives the figures."""
    solver, settings, step = chosen(setting)
    colliders = fit_colliders(walk.body, ColliderOptions())
    stiff = {
        "stretch_stiffness_warp": options.stretch,
        "stretch_stiffness_weft": options.stretch,
        "shear_stiffness": options.shear,
    }
    garments = [
        dataclasses.replace(g, material=dataclasses.replace(g.material, **stiff))
        for g in worn(walk, colliders, options)
    ]
    path = walk.poses(colliders)
    simulation = Simulation(
        garments, colliders, solver=solver, settings=settings, solver_step=step
    )
    units = [Unit(simulation, folder, garment.name) for garment in garments]
    simulation.reset(path[0])
    meters = [Meter(simulation, g.name, g.vertices, g.triangles) for g in garments]
    f = sum(unit.measure() for unit in units)
    times = []
    for frame, (start, end) in enumerate(itertools.pairwise(path), start=1):
        begin = time.thread_time()
        simulation.advance(start, end, FRAME)
        times.append(time.thread_time() - begin)
        if frame in walk.skins:
            for meter in meters:
                meter.add()
    f = 0.5 * (f + sum(unit.measure() for unit in units))
    speeds = []
    for _ in range(round(options.stand / FRAME)):
        simulation.advance(path[-1], path[-1], FRAME)
        speeds.append(max(simulation.health(g.name).rms_speed for g in garments))
    # Three C sweeps over the 14,406 springs of `springs.py`, from those over these springs.
    c_us = 1e6 * f * 14406 / sum(unit.count for unit in units)
    stretch = np.concatenate([s for meter in meters for s in meter.stretch])
    depth = np.concatenate([d for meter in meters for d in meter.depth])
    return {
        "ms": round(1e3 * float(np.median(times)) * 140.0 / c_us, 2),
        "ms_here": round(1e3 * float(np.median(times)), 2),
        "c_us": round(c_us),
        "F": round(float(np.median(times)) / f, 1),
        "stretch_p95": round(float(np.percentile(stretch, 95)), 4),
        "stretch_max": round(float(stretch.max()), 3),
        "depth_mm_p99": round(1e3 * float(np.percentile(depth, 99)), 2),
        "depth_mm_max": round(1e3 * float(depth.max()), 2),
        "rest_mm_s": round(1e3 * max(speeds[-10:]), 2),
        "settling_steps": max(simulation.health(g.name).settling_steps for g in garments),
        "resets": sum(simulation.health(g.name).resets for g in garments),
    }


def main() -> None:
    """Runs the settings."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--setting", nargs="+", default=["relaxation:3:3", "xpbd:20:10:1"])
    parser.add_argument("--outfit", default="tshirt_short_skirt")
    parser.add_argument("--stretch", type=float, default=2000.0, help="stiffness [N/m]")
    parser.add_argument("--shear", type=float, default=500.0, help="stiffness [N/m]")
    parser.add_argument("--ease", type=float, help="of the T-shirt [m]; default: the generator's")
    parser.add_argument("--seconds", type=float, default=3.0, help="of the walk")
    parser.add_argument("--stand", type=float, default=10.0, help="then stands still so long [s]")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    walk = Walk("mannequin", "walk", options.seconds)
    table = {}
    with tempfile.TemporaryDirectory() as folder:
        for setting in options.setting:
            table[setting] = figures = run(walk, setting, options, folder)
            if not options.json:
                met = [goal for goal, limit in GOALS.items() if figures[goal] < limit]
                print(f"{setting}: {figures}; met: {', '.join(met) or 'none'}", flush=True)
    if options.json:
        print(json.dumps(table))


if __name__ == "__main__":
    main()
