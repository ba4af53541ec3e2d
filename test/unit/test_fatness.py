"""Union measures against shapes whose numbers are known."""

import numpy as np
import pytest
import trimesh

from garment_sim_ros.colliders.report.fatness import Union, fatness
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet


def two_balls(radius, apart):
    colliders = ColliderSet(
        colliders=(
            Collider(name="a", kind="sphere", bone="a", geometry={"radius": radius}),
            Collider(name="frame_a", kind="frame", bone="a"),
            Collider(name="b", kind="sphere", bone="b", geometry={"radius": radius}),
        )
    )
    poses = ColliderPoses.identity(3)
    poses.position[2, 0] = apart
    return colliders, poses


def test_distance_is_the_least_of_all_shapes():
    colliders, poses = two_balls(0.1, 0.15)
    points = np.random.default_rng(0).uniform(-0.3, 0.4, (2000, 3))
    expected = np.minimum(
        np.linalg.norm(points, axis=1), np.linalg.norm(points - [0.15, 0, 0], axis=1)
    )
    union = Union(colliders, poses)
    np.testing.assert_allclose(union.distance(points), expected - 0.1, atol=1e-6)
    alone = np.linalg.norm(points, axis=1) - 0.1
    np.testing.assert_allclose(union.distance(points, but=1), alone, atol=1e-6)


def test_samples_are_on_the_union_and_volume_is_counted_once():
    colliders, poses = two_balls(0.1, 0.15)
    union = Union(colliders, poses)
    points, on = union.samples()
    assert np.abs(union.distance(points)).max() < 2e-3
    centre = np.array([[0.0, 0, 0], [np.nan, 0, 0], [0.15, 0, 0]])[on]  # 1 is a frame
    np.testing.assert_allclose(np.linalg.norm(points - centre, axis=1), 0.1, atol=2e-3)
    cap = np.pi * 0.025**2 * (3 * 0.1 - 0.025) / 3
    volume = 2 * (4 / 3 * np.pi * 0.1**3 - cap)
    counted = union.volume(np.array([-0.2, -0.2, -0.2]), np.array([0.4, 0.2, 0.2]))
    assert counted == pytest.approx(volume, rel=0.01)


def test_a_ball_around_a_ball_is_fat_by_the_gap():
    colliders, poses = two_balls(0.12, 0.0)
    skin = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    figures = fatness(colliders, poses, skin.vertices, skin.faces.astype(np.int32))
    assert figures["collider_to_skin_mm_mean"] == pytest.approx(20.0, abs=1.0)
    assert figures["volume_excess"] == pytest.approx(1.2**3 - 1.0, rel=0.03)
    # Both are the same ball: neither is inside the other.
    for shape in figures["shapes"].values():
        assert shape["to_skin_mm_mean"] == pytest.approx(20.0, abs=1.0)
        assert 20.0 < shape["to_skin_mm_max"] < 21.0
