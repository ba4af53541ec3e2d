"""The three nodes together, in a simulated time that the player makes."""

import signal

import pytest

pytest.importorskip("rclpy")

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2

from garment_sim_ros.ros.topics import CLOCK, COLLIDER_POSES, GARMENT_POINTS

pytestmark = pytest.mark.ros

NAMESPACE = "/avatar_test"
SECOND = 10**9
OUTFIT = """
version: 1
garments:
  - {name: skirt, generator: short_skirt, options: {vertices: 500}}
"""


def nanoseconds(stamp):
    return stamp.sec * SECOND + stamp.nanosec


def test_a_walk_in_simulated_time(start_node, make_probe, until, tmp_path):
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(OUTFIT)
    nodes = [
        start_node("mocap_player", NAMESPACE, publish_clock=True),
        start_node("collider_node", NAMESPACE, use_sim_time=True),
        start_node("cloth_node", NAMESPACE, use_sim_time=True, outfit=str(outfit)),
    ]
    probe = make_probe(NAMESPACE)
    clock = probe.listen(CLOCK)
    poses = probe.listen(COLLIDER_POSES)
    points = probe.listen(GARMENT_POINTS, "skirt", raw=True)
    probe.next(points)
    stamps = [
        nanoseconds(deserialize_message(data, PointCloud2).header.stamp)
        for data in probe.next(points, 60)
    ]
    assert 0 < stamps[0] < stamps[-1] < 300 * SECOND
    assert stamps == sorted(stamps)
    # What tells the time, and the poses, may reach this reader later than the cloth does.
    until(lambda: nanoseconds(probe.received(clock)[-1].clock) >= stamps[-1], "that time")
    until(lambda: nanoseconds(probe.received(poses)[-1].header.stamp) >= stamps[-1], "a pose")
    assert nanoseconds(probe.received(clock)[-1].clock) < 300 * SECOND
    for number, node in zip((signal.SIGINT, signal.SIGTERM, signal.SIGINT), nodes):
        node.send(number)
    for node in nodes:
        assert node.wait() == 0
        assert "Traceback" not in node.output


def test_each_node_can_be_cleaned_up_and_set_up_again(start_node, make_probe, until, tmp_path):
    namespace = "/avatar_by_hand"
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(OUTFIT)
    options = {"collider_node": {"method": "capsules"}, "cloth_node": {"outfit": str(outfit)}}
    names = ("cloth_node", "collider_node", "mocap_player")
    nodes = [
        start_node(name, namespace, autostart=False, **options.get(name, {})) for name in names
    ]
    probe = make_probe(namespace)
    points = probe.listen(GARMENT_POINTS, "skirt", raw=True)

    def change(name, *transitions):
        for transition in transitions:
            request = ChangeState.Request(transition=Transition(id=transition))
            assert probe.call(ChangeState, f"{name}/change_state", request).success

    up = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE
    down = Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP
    for name in names:
        change(name, *up)
    probe.next(points, 5)
    for name in names:
        change(name, *down, *up)
        probe.next(points, 5)
    change("cloth_node", *down)

    def state():
        return probe.call(GetState, "cloth_node/get_state", GetState.Request())

    until(lambda: probe.silent_while(points, state), "no more frames")
    configure = Transition.TRANSITION_CONFIGURE  # configured, it is silent
    assert probe.silent_while(points, lambda: change("cloth_node", configure))
    for node in nodes:
        node.send(signal.SIGTERM)
        assert node.wait() == 0
        assert "Traceback" not in node.output
