"""Markers of colliders, above all of those that change with the pose."""

import numpy as np
import pytest

pytest.importorskip("rclpy")

from rclpy.serialization import deserialize_message
from visualization_msgs.msg import Marker, MarkerArray

from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.ros.markers import ColliderMarkers


def decoded(data):
    return deserialize_message(data, MarkerArray).markers


def knee(points, weights):
    """Two bones, and the ellipsoid around skin that both share."""
    return ColliderSet(
        colliders=(
            Collider(name="frame_thigh", kind="frame", bone="thigh"),
            Collider(name="frame_shin", kind="frame", bone="shin"),
            Collider(name="ball", kind="sphere", bone="thigh", geometry={"radius": 0.1}),
            Collider(
                name="knee",
                kind="ellipsoid",
                bone="thigh",
                geometry={
                    "radii": [0.1, 0.06, 0.05],
                    "frames": [0, 1],
                    "points": [points.tolist(), points.tolist()],
                    "weights": weights.tolist(),
                    "inflation": 0.003,
                },
            ),
        )
    )


@pytest.mark.parametrize("bend", [0.0, 0.7, 2.0])
def test_an_ellipsoid_that_is_fitted_again_is_shown_around_its_points(bend):
    random = np.random.default_rng(5)
    points = random.normal(size=(18, 3)) * [0.06, 0.03, 0.03]
    share = random.uniform(0.1, 0.9, 18)
    markers = ColliderMarkers(knee(points, np.array([share, 1.0 - share])))
    poses = ColliderPoses.identity(4)
    poses.position[:] = [0.3, -0.2, 1.0]
    poses.orientation[1] = [0.0, np.sin(bend / 2), 0.0, np.cos(bend / 2)]
    ball, shown = decoded(markers.fill(7 * 10**9, poses))

    assert (ball.scale.x, ball.scale.y, ball.scale.z) == (0.2, 0.2, 0.2)
    assert shown.type == Marker.SPHERE
    q, p = shown.pose.orientation, shown.pose.position
    R = matrix_from_quaternion(np.array([q.x, q.y, q.z, q.w]))
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-6)
    radii = 0.5 * np.array([shown.scale.x, shown.scale.y, shown.scale.z]) - 0.003
    turned = points @ matrix_from_quaternion(poses.orientation[1]).T
    skin = poses.position[0] + share[:, None] * points + (1.0 - share)[:, None] * turned
    inside = np.linalg.norm((skin - [p.x, p.y, p.z]) @ R / radii, axis=1)
    # All in it, and some on it.
    assert inside.max() <= 1.0 + 1e-4
    assert (inside > 0.95).sum() >= 4


def test_a_set_without_shapes_has_nothing_to_show():
    frame = ColliderSet(colliders=(Collider(name="f", kind="frame", bone="b"),))
    assert ColliderMarkers(frame).fill(0, ColliderPoses.identity(1)) is None
