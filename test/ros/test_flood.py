"""An avatar whose topics are flooded with hostile messages beside the good ones."""

import struct
import time

import numpy as np
import pytest

pytest.importorskip("rclpy")

import signal

from rclpy.serialization import serialize_message
from ros_input.hostile import PERIOD, SECOND, Sender, hostile_messages
from std_msgs.msg import String

from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.ros.serialize import Joints
from garment_sim_ros.ros.topics import GARMENT_POINTS, JOINT_STATES, ROBOT_DESCRIPTION

pytestmark = [pytest.mark.ros, pytest.mark.slow]

NAMESPACE = "/flood"
FRAMES_PER_SECOND = 60
OUTFIT = """
version: 1
garments:
  - {name: skirt, generator: short_skirt, options: {vertices: 500}}
"""


@pytest.fixture(scope="module")
def nodes(start_node, tmp_path_factory):
    outfit = tmp_path_factory.mktemp("outfit") / "outfit.yaml"
    outfit.write_text(OUTFIT)
    return (
        start_node("collider_node", NAMESPACE),
        start_node("cloth_node", NAMESPACE, outfit=str(outfit), rate=float(FRAMES_PER_SECOND)),
    )


@pytest.fixture(scope="module")
def probe(nodes, make_probe, until):
    """Has sent a skeleton and joint states, until there is cloth."""
    probe = make_probe(NAMESPACE)
    clip = load_clip("walk")
    message = Joints(clip.rig.dofs.names, "world")
    sampler = ClipSampler(clip, "loop")
    stamp = 1000 * SECOND

    def send(_=0):
        nonlocal stamp
        stamp += PERIOD
        values = sampler.sample((stamp - 1000 * SECOND) / SECOND)
        probe.publish(JOINT_STATES, message.fill(stamp, values))

    points = probe.listen(GARMENT_POINTS, "skirt", raw=True)
    probe.publish(ROBOT_DESCRIPTION, String(data=urdf_from_clip(clip)))
    send()  # the publisher is made here, and has found its reader
    sender = Sender(send)
    sender.start()
    until(lambda: probe.received(points), "cloth")
    probe.stamp = lambda: stamp
    probe.clip = clip
    yield probe
    sender.end()


@pytest.fixture(scope="module")
def flood(probe, make_probe):
    """Another process's hostile messages, 1000 a second."""
    other = make_probe(NAMESPACE)
    for topic, message in hostile_messages(probe.stamp(), probe.clip):
        other.publish(topic, message)

    def send(number):
        if number % 100 == 0:
            kinds[:] = [
                (topic, message if isinstance(message, bytes) else serialize_message(message))
                for topic, message in hostile_messages(probe.stamp(), probe.clip)
            ]
        other.publish(*kinds[number % len(kinds)])

    kinds = []
    sender = Sender(send)
    sender.start()
    yield sender
    sender.end()


def test_the_cloth_keeps_its_rate(flood, probe, nodes, until):
    name = "garments/skirt/points"
    wanted = 3 * FRAMES_PER_SECOND

    def at_full_rate():
        began, sent, first = time.monotonic(), flood.sent, probe.stamp()
        frames = probe.next(name, wanted)
        took = time.monotonic() - began
        stamps = np.array([struct.unpack_from("<iI", f, 4) for f in frames]) @ [SECOND, 1]
        print(
            f"{wanted / took:.1f} frames/s, {len(set(stamps.tolist())) / took:.1f} of them moved, "
            f"{(flood.sent - sent) / took:.0f} hostile and "
            f"{(probe.stamp() - first) / PERIOD / took:.0f} good messages/s"
        )
        return len(set(stamps.tolist())) > 0.95 * FRAMES_PER_SECOND * took

    until(at_full_rate, "60 moved frames a second under the flood")
    for node in nodes:
        assert node.is_running
        assert "Traceback" not in node.output


def test_what_is_rejected_is_counted(flood, probe, nodes, until):
    colliders, cloth = nodes
    for node, reasons in (
        (colliders, ("robot_description", "other_publisher")),
        (cloth, ("other_publisher",)),
    ):
        for reason in reasons:
            until(
                lambda n=node, r=reason: probe.value(n, f"rejected.{r}") > 0,
                f"{reason} of {node.name}",
            )
    until(
        lambda: "2 publishers of joint_states" in probe.diagnostics(colliders).message,
        "the conflict on /diagnostics",
    )


def test_they_end_when_they_are_told_to(flood, nodes):
    for node, number in zip(nodes, (signal.SIGTERM, signal.SIGINT)):
        node.send(number)
    for node in nodes:
        assert node.wait() == 0
        assert "Traceback" not in node.output
