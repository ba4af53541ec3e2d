"""How far cloth may be from where it would be as skin."""

import dataclasses
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.holds.skin_places import follow
from garment_sim_ros.sim.holds.skinned import pose_frames
from garment_sim_ros.sim.placement import blend
from garment_sim_ros.sim.simulation import Simulation

WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))
STEP = 1 / 180


def sheet(cloth, limit, pins=()):
    vertices, triangles = cloth.grid(6, 6)
    garment = cloth.garment(vertices, triangles, pins)
    limits = {"max_distance": np.full(len(vertices), limit)}
    return dataclasses.replace(garment, skin_limits=limits)


def at(position):
    poses = ColliderPoses.identity(1)
    poses.position[0] = position
    return poses


def test_a_falling_sheet_is_caught_at_its_distance(cloth):
    garment = sheet(cloth, 0.05)
    simulation = Simulation((garment,), cloth.colliders(), solver="relaxation", solver_step=STEP)
    still = at([0.0, 0.0, 0.0])
    simulation.state("cloth").v[:] = 0.0
    heights = []
    for _ in range(90):
        simulation.advance(still, still)
        heights.append(simulation.positions("cloth")[:, 2].copy())
    fallen = garment.vertices[:, 2] - np.array(heights)
    assert fallen.max() <= 0.05 + 1e-6
    # Free fall until then, at rest afterwards.
    n = np.arange(1, 91)
    free = 9.81 * STEP**2 * n * (n + 1) / 2
    assert fallen[free < 0.045].max(axis=1) == pytest.approx(free[free < 0.045], rel=1e-4)
    assert fallen[-1] == pytest.approx(0.05, abs=1e-6)
    assert np.abs(simulation.state("cloth").v).max() < 9.81 * STEP * 1.01


@pytest.mark.parametrize("solver", ["relaxation", "xpbd"])
def test_a_sheet_is_dragged_along_by_a_body_that_leaves(cloth, solver):
    simulation = Simulation(
        (sheet(cloth, 0.03),),
        cloth.colliders(),
        environment=WEIGHTLESS,
        solver=solver,
        solver_step=STEP,
    )
    path = [at([3.0 * n * STEP, 0.0, 0.0]) for n in range(181)]
    simulation.reset(path[0])
    for start, end in pairwise(path):
        simulation.advance(start, end)
    lag = path[-1].position[0, 0] - simulation.positions("cloth")[:, 0].mean()
    # Taken along with the body's velocity and not kicked beyond it.
    # Within the distance nothing acts: what little speed is left in it goes on.
    assert lag == pytest.approx(0.03, abs=3e-4)
    assert simulation.state("cloth").v[:, 0] == pytest.approx(3.0, abs=0.01)


def test_a_change_of_the_local_origin_leaves_no_trace(cloth):
    """The body goes 12 m in steps of 5 cm, so that the origin follows several times."""
    simulation = Simulation(
        (sheet(cloth, 0.03),), cloth.colliders(), environment=WEIGHTLESS, solver_step=STEP
    )
    simulation.reset(at([0.0, 0.0, 0.0]))
    for n in range(240):
        simulation.advance(at([0.05 * n, 0.0, 0.0]), at([0.05 * (n + 1), 0.0, 0.0]))
        if n > 2:
            assert simulation.state("cloth").v[:, 0] == pytest.approx(9.0, abs=0.05)


def test_within_the_distance_nothing_acts(cloth):
    pins = range(6)
    plain = cloth.garment(*cloth.grid(6, 6), pins)
    found = []
    for garment in (plain, sheet(cloth, 10.0, pins)):
        simulation = Simulation((garment,), cloth.colliders(), solver_step=STEP)
        path = [at([0.1 * np.sin(0.1 * n), 0.0, 0.0]) for n in range(60)]
        simulation.reset(path[0])
        for start, end in pairwise(path):
            simulation.advance(start, end)
        found.append(simulation.positions("cloth").copy())
    assert (found[0] == found[1]).all()


def test_places_as_skin_agree_with_their_naive_twin():
    random = np.random.default_rng(9)
    n, frames, step = 40, 5, 0.01
    position, orientation = random.normal(size=(7, 3)), random.normal(size=(7, 4))
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    origin = random.normal(size=3)
    collider = np.array([3, 0, 6, 1, 2], np.int32)
    local = random.normal(size=(n, 3, 3))
    weight = random.dirichlet([1.0, 1.0, 1.0], n)
    weight[::4] = [1.0, 0.0, 0.0]
    index = random.integers(0, frames, (n, 3)).astype(np.int32)
    R, t = matrix_from_quaternion(orientation)[collider], position[collider] - origin
    carried = np.einsum("nkij,nkj->nki", R[index], local) + t[index]
    expected = np.einsum("nk,nki->ni", weight, carried)
    before = expected + 0.01 * random.normal(size=(n, 3))
    before[:5] = np.nan
    expected_velocity = np.nan_to_num((expected - before) / step)

    weighted = np.concatenate([weight[..., None] * local, weight[..., None]], axis=2)
    T, place = np.zeros((frames, 3, 4), np.float32), before.astype(np.float32)
    velocity = np.zeros_like(place)
    pose_frames(position, orientation, origin, collider, T)
    follow(T, index, weighted.astype(np.float32), place, velocity, np.float32(step))
    np.testing.assert_allclose(place, expected, atol=2e-6)
    # A difference of places over 10 ms.
    np.testing.assert_allclose(velocity, expected_velocity, atol=4e-4)


def test_the_middle_is_where_the_garment_would_be_put_on(cloth):
    """The same rule as `blend`, which places garments."""
    garment = sheet(cloth, 1e-6)
    simulation = Simulation((garment,), cloth.colliders(), solver_step=STEP)
    poses = at([0.4, -0.2, 1.0])
    poses.orientation[0] = [0.0, np.sin(0.3), 0.0, np.cos(0.3)]
    simulation.reset(poses)
    simulation.advance(poses, poses)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = matrix_from_quaternion(poses.orientation[0]), poses.position[0]
    expected = blend(SimpleNamespace(**vars(garment)), T[None])
    assert simulation.positions("cloth") == pytest.approx(expected, abs=3e-6)
