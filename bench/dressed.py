"""A T-shirt and a short skirt on a walking body: cost and stretch by solver.

    python bench/dressed.py [--seconds 4] [--sub-steps 4 8 20] [--json]

The mannequin walks at 60 frames a second; garments of 1,503 and 1,687 vertices,
cotton jersey. Cost is processor time per frame of one thread, all contacts included. Stretch is
the excess length of mesh edges, speed the RMS after 2 s of standing still.
"""

import argparse
import itertools
import json
import time

import numpy as np

from garment_sim_ros.body.loaders import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import sample
from garment_sim_ros.params import RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation

FRAME = 1 / 60


def main() -> None:
    """Walks once with each setting."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--sub-steps", type=int, nargs="+", default=[4, 8, 20], help="of xpbd")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()

    body = load_body("mannequin")
    colliders = fit_colliders(body)
    garments = load_outfit("tshirt_short_skirt", body, colliders=colliders).garments
    clip = load_clip("walk")
    retargeter = Retargeter(clip.rig, body)
    poser = ColliderPoser(colliders, body)
    path = [
        poser.poses(retargeter.world_joints(sample(clip, n * FRAME))).copy()
        for n in range(round(options.seconds / FRAME) + 1)
    ]
    runs = {"relaxation, 3 steps": ("relaxation", RelaxationSettings(), FRAME / 3)}
    for n in options.sub_steps:
        runs[f"xpbd, {n} sub-steps"] = ("xpbd", XpbdSettings(sub_step=FRAME / n), FRAME)
    figures = {}
    for name, (solver, settings, step) in runs.items():
        simulation = Simulation(
            garments, colliders, solver=solver, settings=settings, solver_step=step
        )
        simulation.reset(path[0])
        times, strain = [], []
        for start, end in itertools.pairwise(path):
            begin = time.thread_time()
            simulation.advance(start, end, FRAME)
            times.append(time.thread_time() - begin)
            for garment in garments:
                edges = mesh_topology(garment.triangles).edges
                x = simulation.positions(garment.name)
                length = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)
                rest = garment.vertices
                strain.append(
                    length / np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1) - 1.0
                )
        for _ in range(120):
            simulation.advance(path[-1], path[-1], FRAME)
        health = [simulation.health(g.name) for g in garments]
        all_strain = np.concatenate(strain)
        figures[name] = {
            "cost_ms": round(1e3 * float(np.median(times)), 2),
            "cost_ms_p95": round(1e3 * float(np.percentile(times, 95)), 2),
            "stretch_p95_percent": round(100 * float(np.percentile(all_strain, 95)), 2),
            "stretch_max_percent": round(100 * float(all_strain.max()), 1),
            "rest_speed_mm_s": round(1e3 * max(h.rms_speed for h in health), 2),
            "resets": sum(h.resets for h in health),
        }
        if not options.json:
            print(f"{name}: " + ", ".join(f"{k} {v}" for k, v in figures[name].items()))
    if options.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
