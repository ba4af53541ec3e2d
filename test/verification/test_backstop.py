"""How far cloth may get behind where it would be as skin."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.sim.simulation import Simulation


def at(z):
    poses = ColliderPoses.identity(1)
    poses.position[:, 2] = z
    return poses


def test_a_falling_sheet_stops_there_and_goes_the_other_way_freely(cloth):
    """Its normal is up: falling is backwards, and each vertex has a distance of its own."""
    vertices, triangles = cloth.grid(6, 6)
    distance = np.where(vertices[:, 0] < 0.0, 0.02, np.inf)
    sheet = dataclasses.replace(
        cloth.garment(vertices, triangles), skin_limits={"backstop": distance}
    )
    simulation = Simulation((sheet,), cloth.colliders())
    for _ in range(60):
        simulation.advance(at(0.0), at(0.0))
    height = simulation.positions("cloth")[:, 2]
    stopped = vertices[:, 0] < 0.0
    assert height[stopped].min() >= -0.02 - 1e-6
    assert height[~stopped].max() < -0.03
    assert 0 < simulation.health("cloth").held <= stopped.sum()
    # A body that goes up takes it along, with its velocity, over changes of the local origin.
    for k in range(240):
        simulation.advance(at(0.02 * k), at(0.02 * (k + 1)))
        v = simulation.state("cloth").v[:, 2]
        assert v.max() < 2.0 * 3.6  # the rest swings
    lowest = simulation.positions("cloth")[stopped, 2].min()
    assert lowest >= 240 * 0.02 - 0.02 - 1e-5
    # A body that goes down leaves it behind: what is in front is free.
    before = simulation.positions("cloth")[:, 2].copy()
    simulation.advance(at(4.8), at(4.5))
    assert simulation.positions("cloth")[:, 2] == pytest.approx(before, abs=0.05)
