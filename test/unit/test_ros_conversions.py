"""Reading serialized messages: right, in both byte orders, and never trusting them."""

import contextlib
import struct

import numpy as np
import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseArray
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from garment_sim_ros.errors import MessageError
from garment_sim_ros.ros.conversions import JointStates, poses_from, text_from

STAMP = 12 * 10**9 + 345
HEADER = Header(stamp=Time(sec=12, nanosec=345), frame_id="world")


def joints(**changes):
    fields = {"header": HEADER, "name": ["a", "knee", "c"], "position": [1.0, -2.0, 3.5]}
    return serialize_message(JointState(**{**fields, **changes}))


def pose_array(count=3, **first):
    message = PoseArray(header=HEADER, poses=[Pose() for _ in range(count)])
    for i, pose in enumerate(message.poses):
        pose.position.x, pose.position.y = float(i), 0.5
    for key, value in first.items():
        group, _, axis = key.partition("_")
        setattr(getattr(message.poses[0], group), axis, value)
    return serialize_message(message)


def test_joint_state():
    found = JointStates().read(joints())
    assert found.stamp == STAMP
    assert found.names == ("a", "knee", "c")
    assert found.values.tolist() == [1.0, -2.0, 3.5]


def test_names_may_change_from_message_to_message():
    reader = JointStates()
    for names in (["a", "b"], ["a", "b"], ["a", "bc"], ["b"], [], ["a", "b"]):
        found = reader.read(joints(name=names, position=[0.5] * len(names)))
        assert found.names == tuple(names)
        assert len(found.values) == len(names)


def test_counts_are_limited():
    many = 60_000
    with pytest.raises(MessageError, match=r"too_many: 60000 names; allowed: up to 4096"):
        JointStates().read(joints(name=["n"] * many, position=[0.0] * many))
    with pytest.raises(MessageError, match=r"too_many: 5000 poses; allowed: up to 4096"):
        poses_from(pose_array(5000))
    with pytest.raises(MessageError, match=r"too_many: 2001 bytes of text; allowed"):
        JointStates().read(joints(name=["n" * 2000, "b", "c"]))
    with pytest.raises(MessageError, match=r"too_many: 101 bytes of text; allowed"):
        text_from(serialize_message(String(data="x" * 100)), 50)


def test_a_rejected_message_leaves_no_names():
    reader = JointStates()
    reader.read(joints())
    with pytest.raises(MessageError):
        reader.read(joints(name=["a", "b", "n" * 2000]))
    assert reader.read(joints()).names == ("a", "knee", "c")


def test_velocities_and_efforts_are_of_no_interest():
    found = JointStates().read(joints(velocity=[1.0, 2.0, 3.0], effort=[float("nan")]))
    assert found.values.tolist() == [1.0, -2.0, 3.5]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"position": [1.0]}, "length_mismatch"),
        ({"position": []}, "length_mismatch"),
        ({"name": []}, "length_mismatch"),
        ({"position": [1.0, float("nan"), 2.0]}, "not_finite"),
        ({"position": [1.0, float("inf"), 2.0]}, "not_finite"),
        ({"position": [1.0, 1e300, 2.0]}, "out_of_range"),
        ({"header": Header(stamp=Time(sec=-1))}, "stamp_invalid"),
        ({"header": Header(stamp=Time(nanosec=10**9))}, "stamp_invalid"),
    ],
)
def test_unusable_joint_states(changes, reason):
    reader = JointStates()
    reader.read(joints())
    with pytest.raises(MessageError) as error:
        reader.read(joints(**changes))
    assert error.value.reason == reason
    assert reader.read(joints()).names == ("a", "knee", "c")


def test_poses():
    found = poses_from(pose_array())
    assert (found.stamp, found.frame_id) == (STAMP, "world")
    assert found.poses.position.tolist() == [[0.0, 0.5, 0.0], [1.0, 0.5, 0.0], [2.0, 0.5, 0.0]]
    assert found.poses.orientation.tolist() == [[0.0, 0.0, 0.0, 1.0]] * 3
    assert len(poses_from(pose_array(0)).poses.position) == 0


def test_orientations_are_normalized():
    found = poses_from(pose_array(orientation_w=1.005)).poses.orientation
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-15)


@pytest.mark.parametrize(
    ("first", "reason"),
    [
        ({"position_x": float("nan")}, "not_finite"),
        ({"position_z": float("-inf")}, "not_finite"),
        ({"orientation_x": float("nan")}, "not_finite"),
        ({"position_y": 1e7}, "out_of_range"),
        ({"orientation_w": 0.0}, "orientation_not_unit"),
        ({"orientation_y": 1.0}, "orientation_not_unit"),
    ],
)
def test_unusable_poses(first, reason):
    with pytest.raises(MessageError) as error:
        poses_from(pose_array(**first))
    assert error.value.reason == reason


def test_big_endian_senders():
    data = struct.pack(">iI", 12, 345) + struct.pack(">I", 1) + b"\0" + b"\0" * 3
    data += struct.pack(">I", 1) + b"\0" * 4
    data = data[:16] + struct.pack(">I", 1) + b"\0" * 4 + struct.pack(">7d", 1, 2, 3, 0, 0, 0, 1)
    found = poses_from(b"\0\0\0\0" + data)
    assert found.stamp == STAMP
    assert found.poses.position.tolist() == [[1.0, 2.0, 3.0]]


def test_text():
    assert text_from(serialize_message(String(data="größe <a/>"))) == "größe <a/>"
    with pytest.raises(MessageError, match="UTF-8"):
        text_from(b"\0\1\0\0" + struct.pack("<I", 3) + b"\xff\xfe\0")


READERS = (
    (poses_from, pose_array()),
    (JointStates().read, joints()),
    (text_from, serialize_message(String(data="some text"))),
)


@pytest.mark.parametrize(("read", "data"), READERS, ids=["poses", "joints", "text"])
def test_every_truncation_is_malformed(read, data):
    for size in range(len(data) - 24):
        with pytest.raises(MessageError) as caught:
            read(data[:size])
        assert caught.value.reason == "malformed"


@settings(derandomize=True, deadline=None, max_examples=300)
@given(
    which=st.integers(0, len(READERS) - 1),
    changes=st.lists(st.tuples(st.integers(0, 4096), st.integers(0, 255)), max_size=8),
    tail=st.binary(max_size=40),
)
def test_damaged_bytes_are_read_or_rejected(which, changes, tail):
    read, data = READERS[which]
    damaged = bytearray(data + tail)
    for at, value in changes:
        damaged[at % len(damaged)] = value
    with contextlib.suppress(MessageError):
        read(bytes(damaged))


@pytest.mark.parametrize("read", [poses_from, JointStates().read])
def test_huge_counts_take_no_memory(read):
    for count in (2**31, 2**32 - 1, 10**6):
        data = b"\0\1\0\0" + struct.pack("<iI", 1, 0) + struct.pack("<I", 1) + b"\0" * 4
        with pytest.raises(MessageError):
            read(data + struct.pack("<I", count) + b"\0" * 200)
