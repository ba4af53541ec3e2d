"""A limb at 10 m/s, a third of a metre in a frame of 30 Hz, carries a curtain along."""

import numpy as np
import pytest
import trimesh

from garment_sim_ros.geometry.shapes import Collider, ColliderPoses
from garment_sim_ros.sim.simulation import Simulation

RADIUS, LENGTH, SPEED, STEP = 0.03, 0.8, 10.0, 1 / 180
ACROSS = np.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""Turns z to y."""


def limb(kind):
    if kind == "capsule":
        geometry = {"radius0": RADIUS, "radius1": RADIUS, "length": LENGTH}
    elif kind == "sphere":
        geometry = {"radius": RADIUS}
    elif kind == "ellipsoid":
        geometry = {"radii": [RADIUS, RADIUS, 3.0]}
    else:
        mesh = trimesh.creation.cylinder(radius=RADIUS, height=LENGTH, sections=12)
        geometry = {"vertices": mesh.vertices.tolist(), "faces": mesh.faces.tolist()}
    return Collider(name="limb", kind=kind, bone="bone", geometry=geometry)


def poses(kind, x):
    result = ColliderPoses.identity(2)
    result.position[1] = [x, -LENGTH / 2 if kind == "capsule" else 0.0, 0.0]
    result.orientation[1] = ACROSS
    return result


def layers_ahead(x, triangles, at, y):
    """How often the cloth is met on the way forward from the limb's axis at y."""
    a, b, c = (x[triangles[:, k]] for k in range(3))

    def turn(p, q):
        return (q[:, 1] - p[:, 1]) * -p[:, 2] - (q[:, 2] - p[:, 2]) * (y - p[:, 1])

    sign = np.stack([turn(a, b), turn(b, c), turn(c, a)])
    hit = (sign > 0.0).all(axis=0) | (sign < 0.0).all(axis=0)
    share = sign[:, hit] / sign[:, hit].sum(axis=0)
    met = share[1] * a[hit, 0] + share[2] * b[hit, 0] + share[0] * c[hit, 0]
    return int((met > at).sum())


@pytest.mark.parametrize(
    ("kind", "solver", "step"),
    [
        ("capsule", "relaxation", STEP),
        pytest.param("sphere", "relaxation", STEP, marks=pytest.mark.slow),
        pytest.param("hull", "relaxation", STEP, marks=pytest.mark.slow),
        pytest.param("ellipsoid", "relaxation", STEP, marks=pytest.mark.slow),
        ("capsule", "xpbd", STEP),
        pytest.param("capsule", "implicit", STEP, marks=pytest.mark.slow),
        pytest.param("capsule", "implicit", 3 * STEP, marks=pytest.mark.slow),
        pytest.param("sphere", "implicit", STEP, marks=pytest.mark.slow),
    ],
)
def test_a_fast_limb_does_not_pass_through_a_curtain(cloth, kind, solver, step):
    """It meets the curtain and takes it along: there is cloth in front of it, never behind."""
    vertices, triangles = cloth.grid(24, 16, 0.025)
    hung = np.stack([0.0 * vertices[:, 0], vertices[:, 1], -vertices[:, 0]], axis=1)
    simulation = Simulation(
        (cloth.garment(hung, triangles, pins=range(16), friction=0.3),),
        cloth.colliders(limb(kind)),
        solver=solver,
        solver_step=step,
    )
    at = -0.2
    across = (0.0013,) if kind == "sphere" else (-0.1013, 0.0013, 0.1013)
    for _ in range(round(0.05 / step)):
        simulation.advance(poses(kind, at), poses(kind, at + SPEED * step), step)
        at += SPEED * step
        x = simulation.positions("cloth")
        assert all(layers_ahead(x, triangles, at, y) % 2 == 1 for y in across)
    assert at > 0.29
    assert simulation.health("cloth").resets == 0
