"""The recorder writes what was published, in a bag that others read."""

import contextlib
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import String

from garment_sim_ros.ros.recorder import Recorder, is_recorded

pytestmark = pytest.mark.ros
_BURST = 20


@pytest.fixture
def publisher():
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("publisher", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin():
        with contextlib.suppress(ExternalShutdownException):
            executor.spin()

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    yield node
    rclpy.shutdown(context=context)
    thread.join()
    # Else its latched topics are there until the garbage is collected.
    node.destroy_node()


def test_bag_holds_what_was_published(tmp_path, publisher):
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    text = publisher.create_publisher(String, "robot_description", latched)
    # As many as are sent at once: what the middleware drops, no recorder gets.
    joints = publisher.create_publisher(JointState, "joint_states", _BURST)
    points = publisher.create_publisher(PointCloud2, "garments/skirt/points", 10)
    other = publisher.create_publisher(String, "not_ours", 10)
    text.publish(String(data="<robot/>"))

    with Recorder(tmp_path / "bag") as recorder:
        limit = time.monotonic() + 60.0
        while time.monotonic() < limit and not all(
            p.get_subscription_count() for p in (joints, points)
        ):
            threading.Event().wait(0.01)
        for i in range(_BURST):
            message = JointState(name=["hip", "knee"], position=[0.1 * i, -0.2 * i])
            message.header.stamp.nanosec = i
            joints.publish(message)
        other.publish(String(data="no"))
        cloud = PointCloud2(width=2, data=np.arange(24, dtype=np.uint8).tobytes())
        points.publish(cloud)
        assert recorder.first_cloth.wait(20.0)
        while time.monotonic() < limit and (
            recorder.counts["/joint_states"] < _BURST or recorder.counts["/robot_description"] < 1
        ):
            threading.Event().wait(0.01)

    with AnyReader([tmp_path / "bag"]) as reader:
        got = {}
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            got.setdefault(connection.topic, []).append(message)
        assert set(got) == {"/joint_states", "/robot_description", "/garments/skirt/points"}
        for i, message in enumerate(got["/joint_states"]):
            assert message.header.stamp.nanosec == i
            assert message.name == ["hip", "knee"]
            assert message.position.tolist() == [0.1 * i, -0.2 * i]
        assert len(got["/joint_states"]) == _BURST
        assert got["/robot_description"][0].data == "<robot/>"
        assert got["/garments/skirt/points"][0].data.tolist() == list(range(24))
        connections = {c.topic: c for c in reader.connections}
        latched = connections["/robot_description"]
        assert latched.ext.offered_qos_profiles[0].durability.name == "TRANSIENT_LOCAL"
        assert latched.msgdef.data.strip().startswith("string data")


def test_only_an_avatars_topics_are_recorded():
    for topic in ("/a/joint_states", "/quality", "/a/garments/skirt/mesh", "/collider_poses"):
        assert is_recorded(topic)
    for topic in ("/rosout", "/parameter_events", "/clock", "/a/image"):
        assert not is_recorded(topic)


def test_failure_in_the_block_still_ends_the_threads(tmp_path):
    with pytest.raises(KeyboardInterrupt), Recorder(tmp_path / "bag"):
        raise KeyboardInterrupt
    assert not [t for t in threading.enumerate() if t.name in ("receive", "write")]


@pytest.mark.parametrize("room", [50_000, 3_000_000])
def test_a_full_disk_is_told_and_what_is_whole_can_be_read(tmp_path, publisher, room):
    """A file may have so many bytes; then the process is refused more, as by a full disk."""
    noise = np.random.default_rng(1).integers(0, 256, 100_000, np.uint8).tobytes()
    topic = "/garments/skirt/points"
    points = publisher.create_publisher(PointCloud2, topic, 10)
    timer = publisher.create_timer(0.01, lambda: points.publish(PointCloud2(data=noise)))
    words = [sys.executable, "-m", "soak.record", str(tmp_path / "bag"), str(room)]
    tests = Path(__file__).parents[1]
    done = subprocess.run(
        words, cwd=tests, capture_output=True, text=True, check=False, timeout=120
    )
    publisher.destroy_timer(timer)
    assert done.returncode == 2, done.stderr
    assert done.stderr == (
        f"error: {tmp_path / 'bag'}: File too large: what is whole of it stays and can be read; "
        "needed: room to write\n"
    )
    with AnyReader([tmp_path / "bag"]) as reader:
        count = sum(connection.topic == topic for connection, *_ in reader.messages())
    # A chunk of eleven messages takes 100,000 bytes: its noise is the same over and over.
    assert count % 11 == 0
    assert (count > 0) == (room > 100_000)
