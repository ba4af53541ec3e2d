"""How far cloth may get behind where it would be as skin."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.geometry.shapes import ColliderPoses
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.sim.backstop import hold
from garment_sim_ros.sim.kernels.skinned import pose_frames
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
    simulation.advance(at(4.8), at(4.0))
    assert simulation.positions("cloth")[:, 2] == pytest.approx(before, abs=0.05)


def test_agrees_with_the_naive_twin():
    random = np.random.default_rng(4)
    n, frames, h = 60, 4, 0.01
    position, orientation = random.normal(size=(6, 3)), random.normal(size=(6, 4))
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    origin = random.normal(size=3)
    collider = np.array([3, 0, 5, 1], np.int32)
    index = random.integers(0, frames, (n, 2)).astype(np.int32)
    weight = random.dirichlet([1.0, 1.0], n)
    local, direction = random.normal(size=(2, n, 2, 3))
    R, t = matrix_from_quaternion(orientation)[collider], position[collider] - origin
    place = np.einsum("nk,nki->ni", weight, np.einsum("nkij,nkj->nki", R[index], local) + t[index])
    normal = np.einsum("nk,nkij,nkj->ni", weight, R[index], direction)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    x = (place + 0.3 * random.normal(size=(n, 3))).astype(np.float32)
    v = random.normal(size=(n, 3)).astype(np.float32)
    before = place + 0.01 * random.normal(size=(n, 3))
    before[:7] = np.nan
    distance = random.uniform(0.0, 0.3, n)

    expected_x, expected_v, held = x.astype(float), v.astype(float), 0
    for p in range(n):
        short = (place[p] - expected_x[p]) @ normal[p] - distance[p]
        if short > 0.0:
            held += 1
            expected_x[p] += short * normal[p]
            own = np.zeros(3) if np.isnan(before[p, 0]) else (place[p] - before[p]) / h
            expected_v[p] -= min((expected_v[p] - own) @ normal[p], 0.0) * normal[p]
    assert 5 < held < n - 5

    T = np.zeros((frames, 3, 4), np.float32)
    pose_frames(position, orientation, origin, collider, T)
    places = np.concatenate([weight[..., None] * local, weight[..., None]], axis=2)
    normals = np.concatenate([weight[..., None] * direction, np.zeros((n, 2, 1))], axis=2)
    rows = [a.astype(np.float32) for a in (places, normals, distance, before)]
    assert hold(x, v, T, index, *rows, np.float32(h)) == held
    np.testing.assert_allclose(x, expected_x, atol=4e-6)
    np.testing.assert_allclose(v, expected_v, atol=4e-4)  # a difference of places over 10 ms
    np.testing.assert_allclose(rows[3], place, atol=4e-6)
