"""How far cloth may get behind where it would be as skin."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.geometry.shapes import ColliderPoses
from garment_sim_ros.sim.backstop import hold
from garment_sim_ros.sim.simulation import Simulation


def at(z):
    poses = ColliderPoses.identity(1)
    poses.position[:, 2] = z
    return poses


def test_a_falling_sheet_stops_there_and_goes_the_other_way_freely(cloth):
    """Its normal is up: falling is backwards, and each vertex has a distance of its own."""
    vertices, triangles = cloth.grid(6, 6)
    distance = np.where(vertices[:, 0] < 0.0, 0.02, np.inf)
    sheet = dataclasses.replace(cloth.garment(vertices, triangles), backstop=distance)
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


def test_agrees_with_the_naive_twin():
    random = np.random.default_rng(4)
    n, frames = 60, 4
    T = random.normal(size=(frames, 3, 4))
    index = random.integers(0, frames, (n, 2)).astype(np.int32)
    direction = random.normal(size=(n, 2, 3))
    normal = np.einsum("nkij,nkj->ni", T[index][..., :3], direction)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    place, velocity = random.normal(size=(2, n, 3))
    x = (place + 0.3 * random.normal(size=(n, 3))).astype(np.float32)
    v = random.normal(size=(n, 3)).astype(np.float32)
    distance = random.uniform(0.0, 0.3, n)

    expected_x, expected_v, held = x.astype(float), v.astype(float), 0
    for p in range(n):
        short = (place[p] - expected_x[p]) @ normal[p] - distance[p]
        if short > 0.0:
            held += 1
            expected_x[p] += short * normal[p]
            expected_v[p] -= min((expected_v[p] - velocity[p]) @ normal[p], 0.0) * normal[p]
    assert 5 < held < n - 5

    place, velocity, T, direction, distance = (
        a.astype(np.float32) for a in (place, velocity, T, direction, distance)
    )
    directions = np.concatenate([direction, np.zeros((n, 2, 1), np.float32)], axis=2)
    assert hold(x, v, place, velocity, T, index, directions, distance) == held
    np.testing.assert_allclose(x, expected_x, atol=4e-6)
    np.testing.assert_allclose(v, expected_v, atol=1e-5)
