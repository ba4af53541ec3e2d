"""collider_node: how it starts, and what it takes for the body."""

import signal

import pytest

pytest.importorskip("rclpy")
from ros_input.collider import Feeder, nanoseconds, stamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.cli import main as cli
from garment_sim_ros.colliders.description import from_json, load_colliders
from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_POSES,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
)

pytestmark = pytest.mark.ros


def test_one_of_two_publishers_is_followed(start_node, make_probe, until):
    # A machine that is held up for a second is no reason to follow the other one here.
    namespace = "/collider_two"
    asked = {"method": "spheres", "delta": 0.01, "stale_after": 600.0}
    node = start_node("collider_node", namespace, **asked)
    probe, other = make_probe(namespace), make_probe(namespace)
    feeder = Feeder(probe, until)
    probe.publish(ROBOT_DESCRIPTION, String(data=feeder.urdf))
    feeder.until_answered()
    strays = set()

    def both():
        feeder.answer(feeder.send())
        names = list(feeder.names)
        strays.add(feeder.stamp + 1)
        stray = JointState(
            header=stamped(feeder.stamp + 1), name=names, position=[0.5] * len(names)
        )
        other.publish(JOINT_STATES, stray)
        status = probe.diagnostics(node)
        return status and "2 publishers of joint_states" in status.message

    until(both, "both publishers on /diagnostics")
    until(lambda: "2 publishers of joint_states" in node.output, "both in the log")
    feeder.answer(feeder.send())
    assert not strays & {nanoseconds(message) for message in feeder.found()}
    node.send(signal.SIGTERM)
    assert node.wait() == 0


def test_first_values_are_waited_for(start_node, make_probe, until):
    namespace = "/collider_partial"
    node = start_node("collider_node", namespace, method="spheres", delta=0.01)
    probe = make_probe(namespace)
    feeder = Feeder(probe, until)
    probe.publish(ROBOT_DESCRIPTION, String(data=feeder.urdf))
    half = len(feeder.names) // 2
    values = feeder.values()

    def waits():
        feeder.send(name=list(feeder.names[:half]), position=values[:half])
        status = probe.diagnostics(node)
        return status and "first value" in status.message

    until(waits, "it waits for the other half")
    until(lambda: probe.value(node, "rejected.name_missing") > 0, "what came is counted")
    assert not feeder.found()
    message = feeder.answer(feeder.send(name=list(feeder.names[half:]), position=values[half:]))
    description = probe.listen(COLLIDER_DESCRIPTION)
    until(lambda: probe.received(description), "the description")
    colliders = from_json(probe.received(description)[0].data)
    assert {c.kind for c in colliders.colliders} == {"sphere", "frame"}
    assert len(message.poses) == len(colliders)
    node.send(signal.SIGTERM)
    assert node.wait() == 0
    assert "Traceback" not in node.output


def test_the_urdf_can_be_the_body(start_node, make_probe, until, data_file):
    namespace = "/collider_urdf"
    text = data_file("urdf", "human_1m65.urdf").read_text()
    node = start_node("collider_node", namespace, body="")
    probe = make_probe(namespace)
    description, poses = probe.listen(COLLIDER_DESCRIPTION), probe.listen(COLLIDER_POSES)
    probe.publish(ROBOT_DESCRIPTION, String(data=text))
    until(lambda: probe.received(description), "the description")
    colliders = from_json(probe.received(description)[0].data)
    rig = parse_urdf(text)
    names = [n for n, m in zip(rig.dofs.names, rig.dofs.mimic_source) if m < 0]

    def posed():
        probe.publish(JOINT_STATES, JointState(name=names, position=[0.0] * len(names)))
        return probe.received(poses)

    until(posed, "poses")
    assert len(probe.received(poses)[0].poses) == len(colliders)
    node.send(signal.SIGINT)
    assert node.wait() == 0
    assert "Traceback" not in node.output


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"body": "no_such.glb"}, "no_such.glb: does not exist"),
        ({"delta": -0.01}, "delta: found -0.01"),
        ({"bone_names": "no_such.yaml"}, "no_such.yaml: "),
    ],
)
def test_unusable_parameters_end_it_with_one_line(start_node, parameters, words):
    node = start_node("collider_node", "/collider_bad", **parameters)
    assert node.wait() == 2
    lines = [line for line in node.output.splitlines() if line.strip()]
    assert lines[-1].startswith(f"error: {words}")
    assert "Traceback" not in node.output


def test_fits_what_the_command_fits(start_node, make_probe, until, tmp_path):
    probe = make_probe("/fit_test")
    description = probe.listen(COLLIDER_DESCRIPTION)
    options = {"body": "mannequin:vertices=1000", "method": "capsules", "delta": 0.006}
    start_node("collider_node", "/fit_test", cache=False, **options)
    out = tmp_path / "c.json"
    words = ["fit", options["body"], "--method", "capsule", "--delta", "0.006", "--out", str(out)]
    assert cli.main(words) == 0
    told = until(lambda: probe.received(description), "a description")
    assert from_json(told[0].data).revision == load_colliders(out).revision
