"""Cloth at rest on a slope for a minute, and sliding down it."""

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.simulation import Simulation

G = 9.81
SLOPE = 0.3
"""Tangent of the angle."""
CORNERS = np.array([[x, y, z] for x in (-20.0, 20.0) for y in (-20.0, 20.0) for z in (-1.0, 0.0)])
FACES = [
    *([0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5]),
    *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
]


def on_a_slope(cloth, solver, friction, seconds):
    """Mean way along the slope [m], and how far the way of single particles differs from it."""
    lean = np.arctan(SLOPE)
    vertices, triangles = cloth.grid(6, 6)
    slab = Collider(
        name="slab",
        kind="hull",
        bone="bone",
        geometry={"vertices": CORNERS.tolist(), "faces": FACES},
    )
    simulation = Simulation(
        (cloth.garment(vertices + np.array([0.0, 0.0, 0.002]), triangles, friction=friction),),
        cloth.colliders(slab),
        environment=Environment(gravity=(G * np.sin(lean), 0.0, -G * np.cos(lean))),
        solver=solver,
    )
    still = ColliderPoses.identity(2)
    for _ in range(round(seconds * 60)):
        simulation.advance(still, still, 1 / 60)
    way = simulation.positions("cloth")[:, 0] - vertices[:, 0]
    return float(way.mean()), float(np.abs(way - way.mean()).max())


@pytest.mark.parametrize("solver", ["relaxation", "xpbd"])
@pytest.mark.parametrize("seconds", [1.0, pytest.param(60.0, marks=pytest.mark.slow)])
def test_cloth_below_the_friction_angle_stays(cloth, solver, seconds):
    way, spread = on_a_slope(cloth, solver, SLOPE + 0.02, seconds)
    assert abs(way) < 1e-4
    assert spread < 1e-4


@pytest.mark.parametrize("solver", ["relaxation", "xpbd"])
def test_cloth_above_the_friction_angle_slides_as_a_block(cloth, solver):
    way, spread = on_a_slope(cloth, solver, 0.2, 1.0)
    lean = np.arctan(SLOPE)
    assert way == pytest.approx(0.5 * G * (np.sin(lean) - 0.2 * np.cos(lean)), rel=0.03)
    assert spread < 1e-3
