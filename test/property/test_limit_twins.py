"""Distance limits, backstops, and letting go of what is overstretched, against naive twins."""

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_limits

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.contact.sides import LET_GO, PASSING, UNDER, Sides
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.holds import backstop, distance_limit
from garment_sim_ros.sim.holds.letting_go import LettingGo
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.state import State

SEEDS = st.integers(0, 10**6)


def singles(rng, *shape, scale=1.0):
    return (scale * rng.normal(size=shape)).astype(np.float32)


def units(rng, n):
    direction = rng.normal(size=(n, 3))
    return (direction / np.linalg.norm(direction, axis=1, keepdims=True)).astype(np.float32)


@given(SEEDS, st.sampled_from([(0.0, 0.0), (0.0, 1e-3), (4e-3, 1e-3), (0.1, 0.02)]))
@settings(derandomize=True, deadline=None, max_examples=30)
def test_distance_limit(seed, times):
    """Some touch a shape, some do not; fast and slow ones; within and after steps."""
    left, dt = times
    rng = np.random.default_rng(seed)
    n = 40
    place, velocity = singles(rng, 2, n, 3)
    x = place - np.float32(left) * velocity + singles(rng, n, 3, scale=0.3)
    v = singles(rng, n, 3) * rng.choice([1e-2, 1.0, 30.0], (n, 1)).astype(np.float32)
    x_start = x - singles(rng, n, 3, scale=1e-2)
    limit = rng.uniform(0.2, 0.7, n).astype(np.float32)
    limit[:4] = 0.0, 0.0, np.inf, np.inf
    shape, normal = rng.integers(-1, 2, n).astype(np.int32), units(rng, n)

    exact = [a.astype(np.float64) for a in (x, v, x_start, normal, place, velocity, limit)]
    end_x, end_v, start, normals, places, velocities, limits = exact
    held = 0
    for p in range(n):
        end = naive_limits.distance_limit(
            *(end_x[p], end_v[p], start[p], normals[p] if shape[p] >= 0 else None),
            *(places[p] - left * velocities[p], velocities[p], limits[p], dt),
        )
        if end is not None:
            held += 1
            end_x[p], end_v[p] = end
    assert 5 < held < n - 1
    assert held == distance_limit.hold(
        *(x, v, x_start, shape, normal, place, velocity),
        *(np.float32(left), np.float32(dt), limit),
    )
    # Positions of some metres in float32, and velocities up to 100 m/s or made of their change.
    np.testing.assert_allclose(x, end_x, atol=2e-6)
    np.testing.assert_allclose(v, end_v, rtol=2e-6, atol=2e-5 + (2e-6 / dt if dt else 0.0))


@given(SEEDS, st.sampled_from([0.0, 4e-3, 0.1]))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_backstop(seed, left):
    """Frames that are turned each in its own way; one particle has no normal."""
    rng = np.random.default_rng(seed)
    n, frames = 60, 4
    T = singles(rng, frames, 3, 4)
    index = rng.integers(0, frames, (n, 2)).astype(np.int32)
    direction = singles(rng, n, 2, 3)
    direction[0] = 0.0
    normal = np.einsum("nkij,nkj->ni", T[index][..., :3].astype(np.float64), direction)
    normal[1:] /= np.linalg.norm(normal[1:], axis=1, keepdims=True)
    place, velocity = singles(rng, 2, n, 3)
    x = place - np.float32(left) * velocity + singles(rng, n, 3, scale=0.3)
    v = singles(rng, n, 3)
    distance = rng.uniform(0.0, 0.3, n).astype(np.float32)

    end_x, end_v = x.astype(np.float64), v.astype(np.float64)
    held = 0
    for p in range(1, n):
        at = place[p].astype(np.float64) - left * velocity[p].astype(np.float64)
        end = naive_limits.backstop(end_x[p], end_v[p], at, velocity[p], normal[p], distance[p])
        if end is not None:
            held += 1
            end_x[p], end_v[p] = end
    assert 5 < held < n - 5
    directions = np.concatenate([direction, np.zeros((n, 2, 1), np.float32)], axis=2)
    assert held == backstop.hold(
        x, v, place, velocity, np.float32(left), T, index, directions, distance
    )
    # Normals are sums of products of two frames; short ones lose a digit.
    np.testing.assert_allclose(x, end_x, atol=6e-6)
    np.testing.assert_allclose(v, end_v, atol=2e-5)


def scene(cloth, rng):
    """Overlapping spheres and tapered capsules of limb size, anyhow turned."""
    colliders = []
    for k in range(6):
        r0, r1, length = rng.uniform([0.04, 0.04, 0.0], [0.08, 0.08, 0.2])
        sphere, capsule = {"radius": r0}, {"radius0": r0, "radius1": r1, "length": length}
        kind, geometry = [("sphere", sphere), ("capsule", capsule)][k % 2]
        colliders.append(Collider(name=f"c{k}", kind=kind, bone=f"b{k}", geometry=geometry))
    colliders = cloth.colliders(*colliders)
    orientation = rng.normal(size=(7, 4))
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    poses = ColliderPoses(position=rng.uniform(-0.1, 0.1, (7, 3)), orientation=orientation)
    return colliders, poses


@given(SEEDS)
@settings(derandomize=True, deadline=None, max_examples=8)
def test_letting_go(cloth, seed):
    """Cloth that is stretched here and there, look after look.

    Some shapes are under it, some pass.
    """
    rng = np.random.default_rng(seed)
    colliders, poses = scene(cloth, rng)
    garment = cloth.garment(*cloth.grid(7, 7, 0.04), pins=range(7))
    model = build_model(
        *("cloth", garment.vertices, garment.triangles, garment.material),
        pins=garment.pins,
        pin_collider=np.zeros(7, np.int32),
        pin_position=garment.vertices[:7],
    )
    posed = ColliderState.of(colliders)
    posed = dataclasses.replace(posed, start=poses, end=poses)
    posed.pose()
    shapes = [
        (c, p, R)
        for c, p, R in zip(
            colliders.colliders, poses.position, matrix_from_quaternion(poses.orientation)
        )
        if c.kind != "frame"
    ]
    row = np.array([UNDER, PASSING, PASSING, UNDER, PASSING, PASSING])
    sides = Sides.of(np.zeros(model.free_count, np.int32), row[None])
    letting_go = LettingGo(model, sides)
    edges = model.springs.particles.reshape(-1, 2)[model.springs.bending :].astype(np.int32)
    # float32 as the kernel has it: on the brink rounding would decide.
    longest = 3.0 * model.springs.rest_length[model.springs.bending :].astype(np.float64)
    expected, counts = sides.side.copy(), []
    for spread in (0.08, 0.0, 0.04):
        stretched = rng.random((len(model), 1)) < 0.4
        x = model.rest + spread * stretched * rng.normal(size=(len(model), 3))
        state = State(x=x.astype(np.float32), v=np.zeros((len(model), 3), np.float32))
        letting_go.look(state, posed, 0.003)
        expected = naive_limits.let_go(
            state.x.astype(np.float64), edges, longest, shapes, expected, 0.003
        )
        np.testing.assert_array_equal(sides.side, expected)
        assert letting_go.count == (expected == LET_GO).any(axis=0).sum()
        counts.append(letting_go.count)
    # Once unstrained, those that are clear meet the shapes again, the others not yet.
    assert counts[0] > counts[1] > 0
    letting_go.forget()
    assert letting_go.count == 0
    assert (sides.side == row[:, None]).all()
