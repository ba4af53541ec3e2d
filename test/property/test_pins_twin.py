"""Pins give way as their twin does."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_pins

from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.sim.holds.pin_edges import PinEdges
from garment_sim_ros.sim.holds.pins import Followed, Given, give_way


def quaternions(rng, count):
    q = rng.normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def some_shapes(rng, count):
    """Spheres and tapered capsules of limb size within a cube of 0.4 m."""
    colliders = []
    for k in range(count):
        r0, r1 = rng.uniform(0.03, 0.12, 2)
        geometry = {"radius": r0}
        if k % 2:
            geometry = {"radius0": r0, "radius1": r1, "length": rng.uniform(0.0, 0.4)}
        kind = "capsule" if k % 2 else "sphere"
        colliders.append(Collider(name=f"c{k}", kind=kind, bone="b", geometry=geometry))
    poses = ColliderPoses(
        position=rng.uniform(-0.2, 0.2, (count, 3)), orientation=quaternions(rng, count)
    )
    return ColliderSet(colliders=tuple(colliders)), poses


@given(st.integers(0, 10**6), st.integers(1, 4), st.booleans())
@settings(derandomize=True, deadline=None, max_examples=25)
def test_pins_give_way_as_the_twin_does(seed, count, is_band):
    rng = np.random.default_rng(seed)
    colliders, poses = some_shapes(rng, count)
    shapes, origin = pack(colliders), rng.normal(size=3)
    posed = PosedShapes.room_for(shapes)
    pose(shapes, poses, poses, origin, posed)
    n = 20
    position, orientation = rng.normal(size=(3, 3)) * 0.1, quaternions(rng, 3)
    collider = rng.integers(0, 3, n).astype(np.int32)
    home = rng.uniform(-0.2, 0.2, (n, 3))
    if is_band:
        collider[:], angle = 0, 2 * np.pi * np.arange(n) / n
        home = np.stack([0.15 * np.cos(angle), 0.15 * np.sin(angle), 0.0 * angle], axis=1)
    place = home + rng.normal(size=(n, 3)) * 0.02 * (rng.random((n, 1)) < 0.5)
    least = rng.uniform(-0.04, -0.01, (count, n)).astype(np.float32)
    least[rng.random((count, n)) < 0.2] = -np.inf
    ends = np.stack([np.arange(n), np.roll(np.arange(n), -1)], axis=1).astype(np.int32)
    length = np.linalg.norm(home[ends[:, 0]] - home[ends[:, 1]], axis=1)
    edges = PinEdges(ends if is_band else ends[:0], length if is_band else length[:0])
    pins = Given(
        *(collider, home, place, np.zeros((n, 3)), least, edges),
        *(np.zeros((n, 3)), np.zeros(n), np.zeros((count, 3), np.float32)),
    )
    rotation = matrix_from_quaternion(poses.orientation)
    expected = naive_pins.give_way(
        *(place, home, position[collider], orientation[collider]),
        *(list(zip(colliders.colliders, poses.position, rotation)), least, 0.01),
        edges=[(*pair, length) for pair, length in zip(edges.pins, edges.length)],
    )
    give_way(pins, Followed(position, orientation, origin), shapes, posed, 0.01, 0.25)
    # At the end of some ways two shapes are as deep as each other, by rounding.
    close = np.abs(place + 4.0 * pins.step - expected).max(axis=1) < 1e-4
    assert close.mean() > 0.94
    free = least == -np.inf
    free = free.all(axis=0) & (not is_band) & (np.linalg.norm(home - place, axis=1) < 0.01)
    assert (place + 4.0 * pins.step)[free] == pytest.approx(home[free], abs=1e-12)
