"""What wind costs: a step of a T-shirt and a short skirt on the standing mannequin.

    python bench/wind.py [--rounds 200] [--json]

Without wind, with a steady one on triangles, and with gusts of 24 and 96 waves, in turns; medians
of processor time [ms]. In the last column of each row what the wind itself takes.
"""

import argparse
import json
import time

import numpy as np

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.world.wind_field import wind_field
from garment_sim_ros.sim.world.wind_on_cloth import WindOnCloth

STEADY = {"wind": (3.0, 1.0, 0.0), "wind_drag": 1.2, "wind_lift": 0.4}
WINDS = {
    "none": {},
    "steady": STEADY,
    "gusts, 24 waves": STEADY | {"gust": 1.5},
    "gusts, 96 waves": STEADY | {"gust": 1.5, "gust_waves": 96},
}


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    body = load_body("mannequin")
    colliders = fit_colliders(body)
    poses = ColliderPoser(colliders, body).poses(rest_transforms(body.rig))
    garments = load_outfit(DEFAULT_OUTFIT, body, colliders=colliders).garments
    scenes = {}
    for name, wind in WINDS.items():
        environment = Environment(**wind)
        simulation = Simulation(garments, colliders, environment=environment, solver="relaxation")
        simulation.reset(poses)
        simulation.advance(poses, poses)
        field = wind_field(environment)
        winds = [
            (WindOnCloth(simulation.model(g.name)), simulation.state(g.name).copy())
            for g in garments
            if field.drag or field.lift
        ]
        scenes[name] = simulation, field, winds
    step = {name: [] for name in scenes}
    alone = {name: [] for name in scenes}
    for _ in range(options.rounds):
        for name, (simulation, field, winds) in scenes.items():
            begin = time.thread_time()
            simulation.advance(poses, poses)
            step[name].append(time.thread_time() - begin)
            begin = time.thread_time()
            for wind, state in winds:
                wind.blow(field, state, simulation.origin, simulation.time, simulation.solver_step)
            alone[name].append(time.thread_time() - begin)
    result = {
        "particles": sum(len(g.vertices) for g in garments),
        "triangles": sum(len(g.triangles) for g in garments),
        "step_ms": {name: round(1e3 * float(np.median(t)), 4) for name, t in step.items()},
        "wind_ms": {name: round(1e3 * float(np.median(t)), 4) for name, t in alone.items()},
    }
    if options.json:
        print(json.dumps(result))
        return
    print(f"{result['particles']} particles, {result['triangles']} triangles")
    for name, ms in result["step_ms"].items():
        print(f"{name}: {ms:.3f} ms a step, {result['wind_ms'][name]:.3f} ms of it the wind")


if __name__ == "__main__":
    main()
