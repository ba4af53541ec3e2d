"""Templates give the bytes of normally built messages, whatever they are filled with."""

import numpy as np
import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, Quaternion
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.ros.cdr import encode
from garment_sim_ros.ros.diagnostics_bytes import diagnostics
from garment_sim_ros.ros.serialize import (
    Joints,
    PointCloud,
    PosedMarkers,
    Poses,
    RootFrame,
    StampedPose,
    TriangleMarker,
)

STAMPS = (0, 1_700_000_000_123_456_789, 999_999_999, (2**31 - 1) * 10**9)


def header(stamp, frame_id="world"):
    return Header(
        stamp=Time(sec=stamp // 10**9, nanosec=stamp % 10**9),
        frame_id=frame_id,
    )


def point(x):
    return Point(x=float(x[0]), y=float(x[1]), z=float(x[2]))


def pose(position, orientation):
    return Pose(
        position=point(position),
        orientation=Quaternion(**dict(zip("xyzw", map(float, orientation)))),
    )


def random_poses(count, seed=0):
    random = np.random.default_rng(seed)
    orientation = random.normal(size=(count, 4))
    return ColliderPoses(
        position=random.normal(size=(count, 3)),
        orientation=orientation / np.linalg.norm(orientation, axis=1, keepdims=True),
    )


def assert_same(data, message):
    """The bytes are those of the message, and read back as it."""
    assert isinstance(data, bytes)
    assert deserialize_message(data, type(message)) == message
    # The middleware reserves a few bytes too many where an array is empty.
    reserved = serialize_message(message)
    expected = reserved[: len(data)]
    assert len(data) <= len(reserved) <= len(data) + 16
    # The middleware leaves gaps between numbers as they were in memory; here they are zero.
    gaps = np.frombuffer(encode(message), np.uint8) != np.frombuffer(
        encode(message, b"\xff"), np.uint8
    )
    found, expected = (np.frombuffer(b, np.uint8) for b in (data, expected))
    assert (found[~gaps] == expected[~gaps]).all()
    assert not found[gaps].any()


@pytest.mark.parametrize("frame_id", ["", "world", "avatar_7/odom"])
@pytest.mark.parametrize("normals", [False, True])
@pytest.mark.parametrize("count", [0, 1, 5])
def test_point_cloud(count, normals, frame_id):
    random = np.random.default_rng(count)
    template = PointCloud(count, frame_id, normals=normals)
    names = ["x", "y", "z", "normal_x", "normal_y", "normal_z"][: 6 if normals else 3]
    for stamp in STAMPS:
        x, n = random.normal(size=(2, count, 3)).astype(np.float32)
        message = PointCloud2(header=header(stamp, frame_id), height=1, width=count)
        message.fields = [
            PointField(name=name, offset=4 * i, datatype=7, count=1)
            for i, name in enumerate(names)
        ]
        message.point_step = 4 * len(names)
        message.row_step = message.point_step * count
        message.data = (np.concatenate([x, n], axis=1) if normals else x).tobytes()
        message.is_dense = True
        assert_same(template.fill(stamp, x, n if normals else None), message)


@pytest.mark.parametrize("namespace", ["tshirt", "s", "short_skirt_2"])
def test_triangle_marker(namespace):
    random = np.random.default_rng(1)
    triangles = np.array([[0, 1, 2], [2, 1, 3], [3, 0, 2]], np.int32)
    colour = (0.25, 0.5, 0.75, 1.0)
    template = TriangleMarker(triangles, "world", namespace, colour)
    for stamp in STAMPS:
        x = random.normal(size=(4, 3)).astype(np.float32)
        message = Marker(header=header(stamp), ns=namespace, type=Marker.TRIANGLE_LIST)
        message.pose.orientation.w = 1.0
        message.scale.x = message.scale.y = message.scale.z = 1.0
        message.color = ColorRGBA(r=0.25, g=0.5, b=0.75, a=1.0)
        message.points = [point(x[v]) for v in triangles.ravel()]
        assert_same(template.fill(stamp, x), message)


@pytest.mark.parametrize("count", [0, 1, 50])
def test_pose_array(count):
    template = Poses(count, "world")
    for i, stamp in enumerate(STAMPS):
        poses = random_poses(count, i)
        message = PoseArray(
            header=header(stamp), poses=list(map(pose, poses.position, poses.orientation))
        )
        assert_same(template.fill(stamp, poses), message)


def test_stamped_pose():
    template = StampedPose("world")
    for i, stamp in enumerate(STAMPS):
        p = random_poses(1, i)
        message = PoseStamped(header=header(stamp), pose=pose(p.position[0], p.orientation[0]))
        assert_same(template.fill(stamp, p.position[0], p.orientation[0]), message)


@pytest.mark.parametrize("child", ["hips", "ann/hips", "größe"])
def test_root_frame(child):
    template, types = RootFrame("world", child), get_typestore(Stores.ROS2_JAZZY)
    for i, stamp in enumerate(STAMPS):
        p = random_poses(1, i)
        data = template.fill(stamp, p.position[0], p.orientation[0])
        (found,) = types.deserialize_cdr(data, "tf2_msgs/msg/TFMessage").transforms
        assert (found.header.frame_id, found.child_frame_id) == ("world", child)
        assert found.header.stamp.sec * 10**9 + found.header.stamp.nanosec == stamp
        t, q = found.transform.translation, found.transform.rotation
        assert (t.x, t.y, t.z) == tuple(p.position[0])
        assert (q.x, q.y, q.z, q.w) == tuple(p.orientation[0])


@pytest.mark.parametrize("names", [(), ("a",), ("hip_Xrotation", "knie_links", "größe")])
def test_joint_state(names):
    template = Joints(names, "world")
    for i, stamp in enumerate(STAMPS):
        values = np.random.default_rng(i).normal(size=len(names))
        message = JointState(header=header(stamp), name=list(names), position=values.tolist())
        assert_same(template.fill(stamp, values), message)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_diagnostics(count):
    message = DiagnosticArray(header=header(STAMPS[1], ""))
    for i in range(count):
        values = [KeyValue(key="größe"[: i + k], value=f"{k}" * k) for k in range(2 * i)]
        message.status.append(DiagnosticStatus(level=bytes([i]), name="n" * i, values=values))
    assert_same(diagnostics(message), message)


def test_posed_markers():
    index = np.array([2, 0], np.int32)

    def markers():
        ball = Marker(type=Marker.SPHERE, ns="ball")
        mesh = Marker(type=Marker.TRIANGLE_LIST, ns="a mesh", id=1)
        mesh.points = [Point(x=1.0), Point(y=2.0), Point(z=3.0)]
        return [ball, mesh]

    template = PosedMarkers(markers(), index)
    for i, stamp in enumerate(STAMPS):
        poses = random_poses(3, i)
        message = MarkerArray(markers=markers())
        for marker, k in zip(message.markers, index):
            marker.header = header(stamp, "")
            marker.pose = pose(poses.position[k], poses.orientation[k])
        assert_same(template.fill(stamp, poses), message)
