"""What it costs that garments do not pass through themselves, and what it changes.

    python bench/self_collision.py [--clip walk] [--seconds 2] [--json]

A T-shirt and a short skirt on the mannequin, without and with `self_collision`, side by side:
medians of processor time of a frame of 1/60 s [ms], and edges that pass through triangles of the
same garment, in every third frame.
"""

import argparse
import dataclasses
import itertools
import json
import sys
import time
from pathlib import Path

import numpy as np

from garment_sim_ros.avatar import Avatar
from garment_sim_ros.sim.self_collision.garment import own_distance
from garment_sim_ros.sim.simulation import Simulation

sys.path.insert(0, str(Path(__file__).parents[1] / "test"))
from naive.naive_self_collision import crossings

FRAME = 1 / 60


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--clip", default="walk")
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--solver", default="xpbd")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    avatar = Avatar.load("mannequin")
    garments, colliders = avatar.dress().garments, avatar.colliders
    path = list(avatar.play(options.clip, 1 / FRAME, seconds=options.seconds))
    with_it = [
        dataclasses.replace(g, self_collision=own_distance(g.vertices, g.triangles, g.material))
        for g in garments
    ]
    scenes = {
        "without": Simulation(garments, colliders, solver=options.solver),
        "with": Simulation(with_it, colliders, solver=options.solver),
    }
    for simulation in scenes.values():
        simulation.reset(path[0])
    cost = {name: [] for name in scenes}
    crossed = {name: [] for name in scenes}
    for n, (start, end) in enumerate(itertools.pairwise(path)):
        for name, simulation in scenes.items():
            begin = time.thread_time()
            simulation.advance(start, end, FRAME)
            cost[name].append(time.thread_time() - begin)
            if n % 3 == 0:
                crossed[name].append(
                    sum(
                        len(crossings(simulation.positions(g), simulation[g].triangles))
                        for g in simulation.names
                    )
                )
    result = {
        name: {
            "frame_ms": round(1e3 * float(np.median(cost[name])), 2),
            "crossings_mean": round(float(np.mean(crossed[name])), 2),
            "crossings_most": max(crossed[name]),
        }
        for name in scenes
    }
    if options.json:
        print(json.dumps(result))
        return
    for name, row in result.items():
        print(f"{name}: " + ", ".join(f"{key} {value}" for key, value in row.items()))


if __name__ == "__main__":
    main()
