"""Messages from node to node of one process."""

import pytest

pytest.importorskip("rclpy")

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from garment_sim_ros.ros.handover import Handover
from garment_sim_ros.ros.topics import COLLIDER_DESCRIPTION, COLLIDER_POSES, JOINT_STATES


@pytest.fixture
def handover():
    return Handover([COLLIDER_DESCRIPTION, COLLIDER_POSES])


def taken(reader):
    found = []
    while (message := reader.take()) is not None:
        found.append(message.data)
    return found


def test_messages_come_once_and_in_order(handover):
    readers = [handover.read(COLLIDER_POSES, depth=5, keep_all=False) for _ in "ab"]
    for data in (b"1", b"2", b"3"):
        handover.give(COLLIDER_POSES, data)
    for reader in readers:
        assert taken(reader) == [b"1", b"2", b"3"]
        assert taken(reader) == []


def test_the_newest_are_kept_or_all(handover):
    some = handover.read(COLLIDER_POSES, depth=2, keep_all=False)
    every = handover.read(COLLIDER_POSES, depth=2, keep_all=True)
    for data in (b"1", b"2", b"3"):
        handover.give(COLLIDER_POSES, data)
    assert taken(some) == [b"2", b"3"]
    assert taken(every) == [b"1", b"2", b"3"]


def test_who_comes_late_gets_what_is_latched_and_nothing_else(handover):
    handover.give(COLLIDER_POSES, b"gone")
    handover.give(COLLIDER_DESCRIPTION, String(data="old"))
    handover.give(COLLIDER_DESCRIPTION, String(data="new"))
    assert taken(handover.read(COLLIDER_POSES, depth=5, keep_all=False)) == []
    late = handover.read(COLLIDER_DESCRIPTION, depth=1, keep_all=False)
    assert taken(late) == [serialize_message(String(data="new"))]


def test_who_has_left_gets_nothing(handover):
    reader = handover.read(COLLIDER_POSES, depth=5, keep_all=False)
    handover.leave(COLLIDER_POSES, reader)
    handover.give(COLLIDER_POSES, b"1")
    assert taken(reader) == []


def test_all_publishers_are_of_one_process(handover):
    """The cloth asks whether poses and description have the same sender."""
    handover.give(COLLIDER_DESCRIPTION, String(data="text"))
    handover.give(COLLIDER_POSES, b"1")
    first = handover.read(COLLIDER_DESCRIPTION, depth=1, keep_all=False).take()
    poses = handover.read(COLLIDER_POSES, depth=1, keep_all=False)
    handover.give(COLLIDER_POSES, b"2")
    assert first.publisher == poses.take().publisher != b""
    assert JOINT_STATES not in handover
