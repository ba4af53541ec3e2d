"""What is compiled, or loaded from the cache, after `Compiler` said that nothing is left.

    python compiled_late.py '{"outfit": {...}, "solver": "xpbd", "settings": {...}, ...}'

Dresses the mannequin as the node does and lets it go through what a node meets: poses that move,
that jump, cloth that breaks. Prints a JSON list of kernels.
"""

import dataclasses
import json
import sys

import numpy as np
from numba.core.dispatcher import Dispatcher

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders import bare_skin
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.garment.outfit import make_outfit
from garment_sim_ros.garment.outfit_file import outfit_from
from garment_sim_ros.params import Environment
from garment_sim_ros.recording import worn_watch
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.ros.compiler import Compiler, expected_scene
from garment_sim_ros.sim.auto.levels import LEVELS
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.sim.warm_up import Scene

SECOND = 10**9
late: list[str] = []


def _watch() -> None:
    """Every new signature of a kernel comes by here, compiled or from the cache."""
    compile_ = Dispatcher.compile

    def watched(self, signature):
        before = len(self.overloads)
        result = compile_(self, signature)
        if len(self.overloads) > before:
            late.append(f"{self.py_func.__module__}.{self.py_func.__name__}")
        return result

    Dispatcher.compile = watched


def main(asked) -> None:
    solver = asked.get("solver", "xpbd")
    parameters = Parameters(
        environment=Environment(**asked.get("environment", {})),
        settings=SOLVERS[solver].settings(**asked.get("settings", {})),
    )
    body = load_body("mannequin")
    file = outfit_from({"version": 1, **asked["outfit"]})
    colliders = fit_colliders(body, file.colliders)
    if asked.get("bare"):
        whole = np.ones(len(body.skin.triangles), np.bool_)
        skin = bare_skin.patch(body, colliders, whole)
        colliders = dataclasses.replace(colliders, colliders=(*colliders.colliders, skin))
    compiler = Compiler(solver)
    compiler.compile(expected_scene(file), parameters)
    outfit = make_outfit(file, body, colliders=colliders)
    simulation = Simulation(outfit.garments, colliders, solver=solver, detail=asked.get("detail"))
    compiler.compile(Scene.of(colliders, outfit.garments), parameters)
    simulation.parameters = parameters
    stepper = ClothStepper(
        simulation,
        step=1 / 180,
        delay=0.0,
        catch_up=0.05,
        teleport_speed=30.0,
        teleport_turn_rate=105.0,
        on_teleport="keep",
        longest_lag=0.4,
        time_jump=1.0,
        on_time_jump="reset",
    )
    rest = ColliderPoser(colliders, body).poses(rest_transforms(body.rig)).copy()
    worn_watch.warm_up()
    watch = worn_watch.WornWatch(colliders, body, outfit.garments)
    _watch()
    x = 0.0
    # Walks, runs late, jumps.
    stamps = [k * SECOND // 60 for k in range(12)] + [SECOND // 2, SECOND // 2 + SECOND // 60]
    for stamp in stamps:
        x += 50.0 if stamp == stamps[-1] else 0.02
        poses = ColliderPoses(
            position=rest.position + np.array([x, 0.0, 0.0]), orientation=rest.orientation
        )
        stepper.add(stamp, poses, stamp)
        stepper.advance(stamp)
        shown = {name: simulation.positions(name) for name in simulation.names}
        watch.look(stepper.poses, shown)
        watch.wait()
        for name in simulation.names:
            simulation.normals(name)
    if asked.get("auto"):
        for level in LEVELS:
            simulation.parameters = dataclasses.replace(
                parameters, settings=level.settings(parameters.settings)
            )
            for _ in range(4):
                stamp += SECOND // 60
                stepper.add(stamp, poses, stamp)
                stepper.advance(stamp)
    for share in (1, None):
        for name in simulation.names:
            simulation.state(name).x[:share] = np.nan
        simulation.advance(poses, poses)
    print(json.dumps(late))


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
