"""Cloth on sampled signed distances, by both solvers and over a joint."""

import numpy as np
import pytest

from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.sim.simulation import Simulation

THICKNESS = 0.002
CELL = 0.01


def block(name, half):
    """A box with half extents `half`, its faces between samples."""
    half = np.asarray(half)
    count = (2 * np.ceil(half / CELL + 2.0) + 2).astype(int)
    at = CELL * (np.indices(count).reshape(3, -1).T - 0.5 * (count - 1))
    over = np.abs(at) - half
    distance = np.linalg.norm(np.maximum(over, 0.0), axis=1) + np.minimum(over.max(axis=1), 0.0)
    grid = DistanceGrid.sampled(CELL, distance.reshape(count))
    return Collider(name=name, kind="sdf", bone="bone", geometry=grid.geometry())


def poses_at(*positions):
    poses = ColliderPoses.identity(len(positions) + 1)
    poses.position[1:] = positions
    return poses


@pytest.mark.parametrize("solver", ["relaxation", pytest.param("xpbd", marks=pytest.mark.slow)])
def test_cloth_rests_at_the_thickness_and_rides_along(cloth, solver):
    """On two blocks side by side: as on one, over the seam, too."""
    vertices, triangles = cloth.grid(9, 9)
    garment = cloth.garment(
        vertices + np.array([0.0, 0.0, 0.105]), triangles, friction=0.8, damping=1.0
    )
    half = (0.1, 0.15, 0.093)
    simulation = Simulation(
        (garment,), cloth.colliders(block("a", half), block("b", half)), solver=solver
    )
    still = poses_at([-0.09, 0.0, 0.0], [0.09, 0.0, 0.0])
    simulation.reset(still)
    for _ in range(60):
        simulation.advance(still, still, 1 / 60)
        assert simulation.positions("cloth")[:, 2].min() > 0.093 + THICKNESS - 1e-5
    x = simulation.positions("cloth").copy()
    # A sample is rounded to 3 um.
    np.testing.assert_allclose(x[:, 2], 0.093 + THICKNESS, atol=2e-5)
    assert simulation.health("cloth").contacts == len(x)
    # They carry it along, at 1.2 m/s^2; friction in sub-steps lets it slip by one percent.
    start = still
    for k in range(30):
        end = ColliderPoses(position=start.position.copy(), orientation=start.orientation)
        end.position[:, 0] += 0.02 / 60 * (k + 1)
        simulation.advance(start, end, 1 / 60)
        start = end
    moved = simulation.positions("cloth")[:, 0] - x[:, 0]
    np.testing.assert_allclose(moved, start.position[1, 0] + 0.09, atol=0.02 * 0.155)
