"""Messages read from their bytes, against the general reader's own bytes."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from garment_sim_ros.recording.message_bytes import read_diagnostics, read_poses

STORE = get_typestore(Stores.ROS2_JAZZY)
STAMPS = [(0, 0), (1795660770, 859733296), (-1, 999_999_999), (2**31 - 1, 1)]


def header(stamp, frame):
    time = STORE.types["builtin_interfaces/msg/Time"](*stamp)
    return STORE.types["std_msgs/msg/Header"](time, frame)


def written(message, little):
    return bytes(STORE.serialize_cdr(message, message.__msgtype__, little_endian=little))


def poses_message(stamp, frame, rows):
    kinds = STORE.types
    point, turn = kinds["geometry_msgs/msg/Point"], kinds["geometry_msgs/msg/Quaternion"]
    pose = kinds["geometry_msgs/msg/Pose"]
    poses = [pose(point(*row[:3]), turn(*row[3:])) for row in rows.tolist()]
    return kinds["geometry_msgs/msg/PoseArray"](header(stamp, frame), poses)


def diagnostics_message(stamp, frame, status):
    kinds = STORE.types
    pair, one = (
        kinds["diagnostic_msgs/msg/KeyValue"],
        kinds["diagnostic_msgs/msg/DiagnosticStatus"],
    )
    made = [
        one(0, name, "fine", "größe", [pair(key, value) for key, value in items])
        for name, items in status
    ]
    return kinds["diagnostic_msgs/msg/DiagnosticArray"](header(stamp, frame), made)


@pytest.mark.parametrize("little", [True, False])
@pytest.mark.parametrize("stamp", STAMPS)
@pytest.mark.parametrize("frame", ["", "world", "größe_1"])
@pytest.mark.parametrize("count", [0, 1, 40])
def test_poses(little, stamp, frame, count):
    rows = np.random.default_rng(count).normal(size=(count, 7))
    found = read_poses(written(poses_message(stamp, frame, rows), little))
    assert found.stamp == stamp[0] * 10**9 + stamp[1]
    assert found.poses.shape == (count, 7)
    assert found.poses.dtype == np.float64
    assert np.array_equal(found.poses, rows)


STATUS = [
    ("skirt", [("strain_p95", "0.031"), ("layer", "0"), ("solver", "xpbd")]),
    ("", []),
    ("jäckchen", [("", "")]),
]


@pytest.mark.parametrize("little", [True, False])
@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_diagnostics(little, count):
    message = diagnostics_message(STAMPS[1], "world", STATUS[:count])
    found = read_diagnostics(written(message, little))
    assert found == (STAMPS[1][0] * 10**9 + STAMPS[1][1], STATUS[:count])


@pytest.mark.parametrize("little", [True, False])
def test_what_ends_early_is_refused(little):
    rows = np.arange(14.0).reshape(2, 7)
    for read, message in (
        (read_poses, poses_message(STAMPS[1], "world", rows)),
        (read_diagnostics, diagnostics_message(STAMPS[1], "world", STATUS[:2])),
    ):
        data = written(message, little)
        for end in range(len(data)):
            with pytest.raises(ValueError):  # noqa: PT011
                read(data[:end])


def test_a_count_beyond_the_end_is_refused():
    data = bytearray(written(poses_message(STAMPS[0], "world", np.zeros((1, 7))), True))
    place = data.index(b"\x01\0\0\0", 20)
    data[place : place + 4] = b"\xff\xff\xff\xff"
    with pytest.raises(ValueError, match="buffer"):
        read_poses(bytes(data))
