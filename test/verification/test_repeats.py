"""The same input gives the same bits, in one process and across processes."""

import dataclasses
import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
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
for solver in {solvers!r}:
    print(getattr(repeats, {digest!r})(tests.Cloth, solver))
"""
CORNERS = 0.1 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


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
    return hashed_motion(simulation, 60)


def digest_of_layers(cloth, solver):
    """The same of two sheets, one over the other, over a hull."""
    vertices, triangles = cloth.grid(12, 12)
    over = cloth.garment(
        vertices + np.array([0.0, 0.0, 0.01]), triangles, pins=range(12), name="over", friction=0.3
    )
    simulation = Simulation(
        (
            cloth.garment(vertices, triangles, pins=range(12), friction=0.3),
            dataclasses.replace(over, layer=1),
        ),
        cloth.colliders(
            Collider(name="a", kind="sphere", bone="bone", geometry={"radius": 0.1}),
            Collider(
                name="b", kind="hull", bone="bone", geometry={"vertices": CORNERS, "faces": FACES}
            ),
        ),
        solver=solver,
    )
    return hashed_motion(simulation, 30)


def hashed_motion(simulation, frames):
    start = ColliderPoses.identity(3)
    start.position[1:, 2] = -0.15
    simulation.reset(start)
    hashed = hashlib.sha256()
    for k in range(frames):
        end = start.copy()
        end.position[:, 0] = 0.03 * k
        end.orientation[2, 0] = np.sin(0.02 * k)
        end.orientation[2, 3] = np.cos(0.02 * k)
        simulation.advance(start, end, 1 / 60)
        for name in simulation.names:
            hashed.update(simulation.positions(name).tobytes())
            hashed.update(simulation.normals(name).tobytes())
        start = end
    return hashed.hexdigest()


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_same_bits_twice_in_one_process(cloth, solver):
    assert digest(cloth, solver) == digest(cloth, solver)


def digests_elsewhere(solvers, name="digest", **environment):
    """Those of another process."""
    conftest = str(Path(__file__).parents[1] / "conftest.py")
    script = SCRIPT.format(conftest=conftest, this=__file__, solvers=solvers, digest=name)
    command = [sys.executable, "-c", script]
    environment = {**os.environ, **environment}
    run = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    return run.stdout.split()


def test_the_same_bits_in_another_process(cloth):
    """Also where this one has compiled the kernels, which the other one loads."""
    assert digests_elsewhere(SOLVERS) == [digest(cloth, solver) for solver in SOLVERS]


@pytest.mark.slow
def test_the_run_that_compiles_has_the_bits_of_those_that_load(tmp_path):
    every = (*SOLVERS, "implicit")
    first, second, third = (
        digests_elsewhere(every, "digest_of_layers", NUMBA_CACHE_DIR=str(tmp_path))
        for _ in range(3)
    )
    assert first == second == third
