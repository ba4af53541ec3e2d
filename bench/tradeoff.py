"""What speed costs: colliders and solver settings on one walk, measured against the true skin.

    python bench/tradeoff.py [--seconds 4] [--body FILE] [--clip FILE] [--only TEXT] [--json]

A T-shirt and a short skirt of 1,503 and 1,687 vertices, cotton jersey, 60 frames a second. Cost is
processor time per frame of one thread, poses and contacts included, also as a multiple of F: three
plain C sweeps over the springs of both garments, timed before and after each run. Penetration
(particles, edge midpoints, triangle centres), gap and stretch are taken 10 times a second, after
the first second; rest is the RMS speed after 2 s of standing still.
"""

import argparse
import itertools
import json
import tempfile
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from drape import Unit

from garment_sim_ros.avatar import Avatar
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.params import ColliderOptions, RelaxationSettings, XpbdSettings
from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh
from garment_sim_ros.sim.simulation import Simulation

FRAME = 1 / 60
EVERY = 6


@dataclass
class Setting:
    """One row of the table."""

    colliders: str
    solver: str
    settings: Any
    steps: int
    """Calls of the solver in a frame."""

    @property
    def name(self) -> str:
        """As the table shows it."""
        if self.solver == "relaxation":
            how = f"{self.steps} steps of {self.settings.sweeps} sweeps"
        else:
            how = f"{round(FRAME / self.settings.sub_step)} sub-steps"
            how += ", coarse" * self.settings.coarse
        return f"{self.colliders}, {self.solver}, {how}"


SETTINGS = [
    *(Setting(c, "relaxation", RelaxationSettings(), 3) for c in ("spheres", "capsules")),
    *(Setting(c, "relaxation", RelaxationSettings(), 3) for c in ("ellipsoids", "sdf", "hulls")),
    *(
        Setting("hulls", "relaxation", RelaxationSettings(sweeps=sweeps), steps)
        for steps, sweeps in ((2, 3), (3, 1), (3, 10), (6, 3), (12, 3))
    ),
    *(
        Setting("hulls", "xpbd", XpbdSettings(sub_step=FRAME / n, coarse=coarse), 1)
        for n, coarse in ((8, False), (8, True), (20, False), (20, True), (40, False))
    ),
]


class Walk:
    """A body on its way, and the skin that it has there."""

    def __init__(self, body: str, clip: str, seconds: float) -> None:
        self.body = load_body(body)
        avatar = Avatar(self.body, ColliderSet(colliders=()))
        self.joints = list(avatar.joints(clip, 1 / FRAME, seconds=seconds))
        self.skins = {n: avatar.skin(self.joints[n]) for n in range(60, len(self.joints), EVERY)}

    def poses(self, colliders: ColliderSet) -> list[Any]:
        """Poses of colliders in every frame."""
        return list(map(Avatar(self.body, colliders).poses, self.joints))


def run(walk: Walk, setting: Setting, folder: str) -> dict[str, float]:
    """Walks once, stands, and gives the figures."""
    colliders = fit_colliders(walk.body, ColliderOptions(method=setting.colliders))
    garments = load_outfit("tshirt_short_skirt", walk.body, colliders=colliders).garments
    path = walk.poses(colliders)
    simulation = Simulation(
        garments,
        colliders,
        solver=setting.solver,
        settings=setting.settings,
        solver_step=FRAME / setting.steps,
    )
    units = [Unit(simulation, folder, garment.name) for garment in garments]
    simulation.reset(path[0])
    meter = ClothMeter(
        walk.body.skin.vertices,
        walk.body.skin.triangles,
        {g.name: GarmentMesh.of(g) for g in garments},
    )
    f = sum(unit.measure() for unit in units)
    times = []
    for frame, (start, end) in enumerate(itertools.pairwise(path), start=1):
        begin = time.thread_time()
        simulation.advance(start, end, FRAME)
        times.append(time.thread_time() - begin)
        if frame in walk.skins:
            x = {name: simulation.positions(name).astype(float) for name in simulation.names}
            meter.add(walk.skins[frame], x)
    f = 0.5 * (f + sum(unit.measure() for unit in units))
    for _ in range(120):
        simulation.advance(path[-1], path[-1], FRAME)
    figures = meter.result()
    health = [simulation.health(g.name) for g in garments]
    return {
        "cost_ms": round(1e3 * float(np.median(times)), 2),
        "cost_ms_p95": round(1e3 * float(np.percentile(times, 95)), 2),
        "cost_F": round(float(np.median(times)) / f, 1),
        "penetration_mm_p99": figures["penetration_mm_p99"],
        "penetration_mm_max": figures["penetration_mm_max"],
        "gap_mm_median": figures["gap_mm_median"],
        "strain_p95": figures["strain_p95"],
        "strain_max": figures["strain_max"],
        "rest_mm_s": round(1e3 * max(h.rms_speed for h in health), 1),
        "resets": sum(h.resets for h in health),
    }


def main() -> None:
    """Runs every setting."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--body", default="mannequin")
    parser.add_argument("--clip", default="walk")
    parser.add_argument("--only", default="", help="settings whose name holds this text")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    walk = Walk(options.body, options.clip, options.seconds)
    table = {}
    with tempfile.TemporaryDirectory() as folder:
        for setting in SETTINGS:
            if options.only in setting.name:
                table[setting.name] = figures = run(walk, setting, folder)
                if not options.json:
                    print(f"{setting.name}: " + ", ".join(f"{k} {v}" for k, v in figures.items()))
    if options.json:
        print(json.dumps(table))


if __name__ == "__main__":
    main()
