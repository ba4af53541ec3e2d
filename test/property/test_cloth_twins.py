"""Every compiled kernel of the solver against its naive float64 twin."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive
from scipy.spatial.transform import Rotation

from garment_sim_ros.contact.packed import Poses
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.geometry.transforms import transform_from
from garment_sim_ros.params import Material
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.motion import (
    move_pins,
    predict,
    shift,
    to_file_order,
    update_velocities,
)
from garment_sim_ros.sim.placement import blend
from garment_sim_ros.sim.solvers.relaxation.springs import correct_springs
from garment_sim_ros.sim.state import State
from garment_sim_ros.sim.strain import StrainMeter
from garment_sim_ros.sim.world.path import same_poses

SEEDS = st.integers(0, 10**6)


def singles(rng, *shape, scale=1.0):
    return (rng.normal(size=shape) * scale).astype(np.float32)


@given(SEEDS, st.integers(1, 4))
@settings(derandomize=True, deadline=None, max_examples=15)
def test_correct_springs(cloth, seed, sweeps):
    rng = np.random.default_rng(seed)
    vertices, triangles = cloth.grid(6, 7)
    vertices += rng.normal(0.0, 0.003, vertices.shape)
    pins = rng.choice(len(vertices), 3, replace=False)
    model = build_model(
        "c",
        vertices,
        triangles,
        Material(),
        pins=pins,
        pin_collider=np.zeros(3, int),
        pin_position=vertices[pins],
    )
    x = (vertices[model.vertex] + rng.normal(0.0, 0.005, vertices.shape)).astype(np.float32)
    springs = model.springs
    expected = naive.correct_springs(
        x, springs.particles.reshape(-1, 2), springs.rest_length, model.inverse_mass, sweeps
    )
    wide = np.zeros(4 * len(x), np.float32)
    arrays = (springs.particles, springs.rest_length, springs.share, springs.colour_start)
    correct_springs(x.reshape(-1), wide, *arrays, sweeps)
    assert np.abs(x - expected).max() < 1e-6


@given(SEEDS, st.floats(1e-4, 0.3), st.floats(0.0, 5.0), st.floats(0.0, 5.0))
@settings(derandomize=True, deadline=None, max_examples=30)
def test_predict(seed, dt, damping, drag):
    rng = np.random.default_rng(seed)
    x, v = singles(rng, 20, 3), singles(rng, 20, 3, scale=3.0)
    gravity, wind = rng.normal(size=3) * 10, rng.normal(size=3) * 5
    expected_x, expected_v = naive.predict(x, v, gravity, damping, drag, wind, dt)
    before = x.copy()
    x_start, x_predicted = np.empty_like(x), np.empty_like(x)
    keep = 1.0 / (1.0 + dt * (damping + drag))
    push = (keep * dt * (gravity + drag * wind)).astype(np.float32)
    predict(x, v, x_start, x_predicted, push, np.float32(keep), np.float32(dt))
    assert v == pytest.approx(expected_v, rel=1e-5, abs=1e-5)
    assert x == pytest.approx(expected_x, rel=1e-5, abs=1e-5)
    assert (x_start == before).all()
    assert (x_predicted == x).all()


@given(SEEDS, st.floats(1e-3, 0.1))
@settings(derandomize=True, deadline=None, max_examples=30)
def test_update_velocities(seed, dt):
    rng = np.random.default_rng(seed)
    n, m = 30, 4
    x_start, v = singles(rng, n, 3), singles(rng, n, 3)
    x_predicted = x_start + np.float32(dt) * v
    x = x_predicted + singles(rng, n, 3, scale=0.01)
    shape = rng.integers(-1, m, n).astype(np.int32)
    normal = singles(rng, n, 3)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    carry = singles(rng, m, 3, 4, scale=0.02)
    expected = naive.update_velocities(
        x, v, x_start, x_predicted, shape, normal, carry, float(np.float32(dt))
    )
    motion = np.zeros(2)
    update_velocities(x, v, x_start, x_predicted, shape, normal, carry, np.float32(dt), motion)
    assert v == pytest.approx(expected, rel=1e-4, abs=2e-3)
    speed = (v.astype(np.float64) ** 2).sum(axis=1)
    assert motion == pytest.approx([speed.sum(), speed.max()], rel=1e-5)


@given(SEEDS)
@settings(derandomize=True, deadline=None, max_examples=30)
def test_carry_pins(seed):
    rng = np.random.default_rng(seed)
    local, position = rng.normal(size=(6, 3)), rng.normal(size=(3, 3)) * 50
    orientation = rng.normal(size=(3, 4))
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    collider = rng.integers(0, 3, 6).astype(np.int32)
    origin = position.mean(axis=0)
    x = singles(rng, 6, 3)
    before, v = x.copy(), np.zeros_like(x)
    step = rng.normal(size=(6, 3)) * 0.01
    local -= step
    place = local.copy()
    move_pins(x, v, collider, place, step, position, orientation, origin, np.float32(0.5))
    local += step
    assert place == pytest.approx(local, abs=1e-15)
    expected = naive.move_pins(local, position[collider], orientation[collider]) - origin
    assert x == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert v == pytest.approx((x - before) / 0.5, rel=1e-6)


def test_file_order_and_shift():
    rng = np.random.default_rng(0)
    x, vertex = singles(rng, 9, 3), rng.permutation(9).astype(np.int32)
    origin = np.array([10.0, -20.0, 30.0])
    world = np.zeros((9, 3), np.float32)
    to_file_order(x, vertex, origin, world)
    assert world[vertex] == pytest.approx(x + origin, rel=1e-7)
    moved = x.copy()
    shift(moved, np.array([0.25, -0.5, 1.0], np.float32))
    assert moved == pytest.approx(x + np.array([0.25, -0.5, 1.0]), abs=1e-6)


def test_blend_of_frames_is_the_weighted_sum_over_each_vertex(cloth):
    rng = np.random.default_rng(5)
    x, triangles = cloth.grid(4, 5)
    index = rng.integers(0, 3, (len(x), 4)).astype(np.int32)
    weight = rng.dirichlet(np.ones(4), len(x))
    rest, now = (
        transform_from(rng.normal(size=(3, 3)), Rotation.random(3, rng).as_quat())
        for _ in range(2)
    )
    garment = dataclasses.replace(
        cloth.garment(x, triangles),
        frames=("a", "b", "c"),
        T_world_frame_rest=rest,
        frame_index=index,
        frame_weight=weight,
    )
    expected = np.zeros_like(x)
    for v, position in enumerate(x):
        for frame, share in zip(index[v], weight[v]):
            carried = now[frame] @ np.linalg.inv(rest[frame]) @ np.append(position, 1.0)
            expected[v] += share * carried[:3]
    np.testing.assert_allclose(blend(garment, now), expected, atol=1e-12)
    # Linear: displacements out of the difference of transforms.
    moved = blend(garment, now) - blend(garment, rest)
    np.testing.assert_allclose(blend(garment, now - rest), moved, atol=1e-12)


@given(SEEDS, st.sampled_from([0.02, 0.3, 2.0]))
@settings(derandomize=True, deadline=None, max_examples=10)
def test_strain_of_edges(cloth, seed, amount):
    """Its 95th percentile to a thousandth, and beyond 1 the largest in its place."""
    rng = np.random.default_rng(seed)
    x, triangles = cloth.grid(9, 8)
    model = build_model("cloth", x, triangles, Material(), pins=np.array([0, 7]))
    state = State.at(model, x, np.zeros(3))
    state.x[:] = (1.0 + amount * rng.random()) * state.x + singles(
        rng, *x.shape, scale=amount / 99
    )
    found = StrainMeter(model).read(state)
    rest, now = (
        np.array([np.linalg.norm(at[a] - at[b]) for a, b in mesh_topology(triangles).edges])
        for at in (x, state.x[np.argsort(model.vertex)].astype(np.float64))
    )
    free = np.array([{a, b} != {0, 7} for a, b in mesh_topology(triangles).edges.tolist()])
    strain = np.sort((now / rest - 1.0)[free])
    assert found.largest == pytest.approx(strain[-1], abs=1e-6)
    exact = max(strain[len(strain) - 1 - int(0.05 * len(strain))], 0.0)
    if exact < 0.999:
        assert exact - 1e-6 <= found.p95 <= exact + 1e-3 + 1e-6
    elif exact > 1.0:
        assert found.p95 == pytest.approx(found.largest)


def test_poses_are_the_same_if_every_number_is():
    rng = np.random.default_rng(0)
    poses = rng.normal(size=(4, 3)), rng.normal(size=(4, 4))
    assert same_poses(Poses(*poses), Poses(*(a.copy() for a in poses)))
    for which, array in enumerate(poses):
        for at in np.ndindex(array.shape):
            other = [a.copy() for a in poses]
            other[which][at] = np.nextafter(array[at], np.inf)
            assert not same_poses(Poses(*poses), Poses(*other))
