"""The same input gives the same bits, in one process and across processes."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from garment_sim_ros.geometry.shapes import Collider, ColliderPoses
from garment_sim_ros.sim.simulation import Simulation

SOLVERS = ("relaxation", "xpbd")
SCRIPT = """
import importlib.util
spec = importlib.util.spec_from_file_location("conftest_of_tests", {conftest!r})
tests = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tests)
spec = importlib.util.spec_from_file_location("repeats", {this!r})
repeats = importlib.util.module_from_spec(spec)
spec.loader.exec_module(repeats)
for solver in repeats.SOLVERS:
    print(repeats.digest(tests.Cloth, solver))
"""


def digest(cloth, solver):
    """Hash of all positions of a cloth that is dragged over two colliders for a second."""
    vertices, triangles = cloth.grid(20, 20)
    garment = cloth.garment(vertices, triangles, pins=range(20), friction=0.3, damping=0.5)
    simulation = Simulation(
        (garment,),
        cloth.colliders(
            Collider(name="a", kind="sphere", bone="bone", geometry={"radius": 0.1}),
            Collider(
                name="b",
                kind="capsule",
                bone="bone",
                geometry={"radius0": 0.08, "radius1": 0.04, "length": 0.3},
            ),
        ),
        solver=solver,
    )
    hashed = hashlib.sha256()
    start = ColliderPoses.identity(3)
    start.position[1:, 2] = -0.15
    simulation.reset(start)
    for k in range(60):
        end = start.copy()
        end.position[:, 0] = 0.03 * k
        end.orientation[2, 0] = np.sin(0.02 * k)
        end.orientation[2, 3] = np.cos(0.02 * k)
        simulation.advance(start, end, 1 / 60)
        hashed.update(simulation.positions("cloth").tobytes())
        hashed.update(simulation.normals("cloth").tobytes())
        start = end
    return hashed.hexdigest()


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_same_bits_twice_in_one_process(cloth, solver):
    assert digest(cloth, solver) == digest(cloth, solver)


def test_the_same_bits_in_another_process(cloth):
    """Also where this one has compiled the kernels, which the other one loads."""
    here = [digest(cloth, solver) for solver in SOLVERS]
    script = SCRIPT.format(conftest=str(Path(__file__).parents[1] / "conftest.py"), this=__file__)
    command = [sys.executable, "-c", script]
    run = subprocess.run(command, capture_output=True, text=True, env=os.environ, check=True)
    assert run.stdout.split() == here
