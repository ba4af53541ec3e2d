"""The collider node as a process, fed by hand."""

import signal
import struct

import numpy as np
import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import serialize_message
from ros_input.collider import NAMESPACE, STEP, as_array, nanoseconds, stamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from garment_sim_ros.colliders.description import from_json
from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_MARKERS,
    COLLIDER_POSES,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
    ROOT_POSE,
)

pytestmark = pytest.mark.ros


def test_description_reaches_late_joiners(feeder, make_probe, until):
    late = make_probe(NAMESPACE)
    name = late.listen(COLLIDER_DESCRIPTION)
    until(lambda: late.received(name), "the description")
    colliders = from_json(late.received(name)[0].data)
    assert colliders.frame_id == "world"
    assert colliders.thickness == 0.002
    kinds = {c.kind for c in colliders.colliders}
    assert {"hull", "frame"} <= kinds <= {"hull", "sphere", "frame"}


def test_quality_of_service(feeder):
    for topic, latched in ((COLLIDER_DESCRIPTION, True), (COLLIDER_POSES, False)):
        (info,) = feeder.probe.publishers_of(topic.name)
        assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        expected = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        assert info.qos_profile.durability == expected


def test_poses_are_those_of_the_retargeted_body(feeder, expected_poses):
    for _ in range(3):
        stamp = feeder.send()
        message = feeder.answer(stamp)
        assert message.header.frame_id == "world"
        found = as_array(message)
        expected = expected_poses(feeder.clip.values[feeder.sample])
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_root_pose_and_markers(feeder, until):
    root, markers = feeder.probe.listen(ROOT_POSE), feeder.probe.listen(COLLIDER_MARKERS)

    def both():
        feeder.send(advance=20 * STEP)
        return feeder.probe.received(root) and feeder.probe.received(markers)

    until(both, "root pose and markers")
    pose = feeder.probe.received(root)[-1]
    assert pose.header.frame_id == "world"
    assert 0.7 < pose.pose.position.z < 1.2
    colliders = from_json(feeder.probe.received("collider_description")[0].data)
    shapes = [c for c in colliders.colliders if c.kind != "frame"]
    found = feeder.probe.received(markers)[-1].markers
    assert len(found) == len(shapes)
    assert len({(m.ns, m.id) for m in found}) == len(found)
    poses = as_array(feeder.answer(nanoseconds(found[0])))
    for marker in found:
        assert marker.header.frame_id == "world"
        assert [marker.pose.position.x, marker.pose.position.z] == list(poses[marker.id, [0, 2]])
        assert len(marker.points) % 3 == 0


def test_names_may_come_in_any_order(feeder, expected_poses):
    values = feeder.values()
    order = np.random.default_rng(0).permutation(len(values))
    stamp = feeder.send(name=[feeder.names[i] for i in order], position=[values[i] for i in order])
    np.testing.assert_allclose(as_array(feeder.answer(stamp)), expected_poses(values), atol=1e-9)


def test_a_part_of_the_names_changes_only_those(feeder, expected_poses):
    values = feeder.values()
    feeder.answer(feeder.send(position=values))
    values[5] += 0.3
    stamp = feeder.send(name=[feeder.names[5]], position=[values[5]])
    np.testing.assert_allclose(as_array(feeder.answer(stamp)), expected_poses(values), atol=1e-9)


def test_unknown_names_are_told_and_the_others_used(feeder, node, expected_poses, until):
    before = feeder.probe.value(node, "rejected.name_unknown")
    values = feeder.values()
    stamp = feeder.send(name=[*feeder.names, "tail_joint"], position=[*values, 0.5])
    np.testing.assert_allclose(as_array(feeder.answer(stamp)), expected_poses(values), atol=1e-9)
    until(
        lambda: feeder.probe.value(node, "rejected.name_unknown") > before,
        "the unknown name on /diagnostics",
    )


def damaged():
    data = bytearray(serialize_message(JointState(name=["a"], position=[0.0])))
    struct.pack_into("<I", data, 20, 2**31)  # the number of names
    return bytes(data)


REJECTED = {
    "name_duplicated": lambda f: {"name": [f.names[0], f.names[0]], "position": [0.0, 0.1]},
    "name_unknown": lambda f: {"name": ["tail_joint"], "position": [0.0]},
    "length_mismatch": lambda f: {"position": f.values()[:-1]},
    "not_finite": lambda f: {"position": [float("nan"), *f.values()[1:]]},
    "out_of_range": lambda f: {"position": [1e300, *f.values()[1:]]},
    "stamp_backwards": lambda f: {"header": stamped(f.stamp - 5 * STEP)},
    "stamp_jump": lambda f: {"header": stamped(f.stamp + 100 * 10**9)},
    "stamp_invalid": lambda f: {"header": Header(stamp=Time(sec=-5))},
    "too_many": lambda f: {
        "name": [*(f"joint_{i}" for i in range(9_999)), "joint_7"],
        "position": [0.0] * 10_000,
    },
}


@pytest.mark.parametrize("reason", sorted(REJECTED))
def test_unusable_joint_states_are_counted_and_change_nothing(
    feeder, node, expected_poses, until, reason
):
    before = feeder.probe.value(node, f"rejected.{reason}")
    count = len(feeder.found())

    # Best effort: one may get lost.
    def counted():
        feeder.send(advance=0, **REJECTED[reason](feeder))
        return feeder.probe.value(node, f"rejected.{reason}") > before

    until(counted, reason)
    assert reason in feeder.probe.diagnostics(node).message
    assert len(feeder.found()) == count
    values = feeder.values()
    message = feeder.answer(feeder.send(position=values))
    np.testing.assert_allclose(as_array(message), expected_poses(values), atol=1e-9)


def test_damaged_bytes_are_counted(feeder, node, until):
    def counted():
        feeder.probe.publish(JOINT_STATES, damaged())
        return feeder.probe.value(node, "rejected.malformed")

    until(counted, "malformed")
    feeder.answer(feeder.send())


def test_unusable_descriptions_are_counted_and_the_old_one_stays(feeder, node, until):
    mimics = "".join(
        f"<link name='l{i}'/>"
        f"<joint name='j{i}' type='revolute'><parent link='l{i}'/><child link='l{i + 1}'/>"
        f"<mimic joint='j{(i + 1) % 4000}'/></joint>"
        for i in range(4000)
    )
    circle = f"<robot name='r'>{mimics}<link name='l4000'/></robot>"
    bomb = '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><robot name="&b;"/>'
    for text in (
        "",
        circle,
        "no xml",
        bomb,
        "<robot name='r'/>",
        feeder.urdf[: len(feeder.urdf) // 2],
    ):
        before = feeder.probe.value(node, "rejected.robot_description")
        feeder.probe.publish(ROBOT_DESCRIPTION, String(data=text))
        until(
            lambda b=before: feeder.probe.value(node, "rejected.robot_description") > b,
            f"{text[:20]!r} is rejected",
        )
    feeder.answer(feeder.send())


def test_a_long_chain_of_mimic_joints_is_read(feeder, node, until):
    """Such a skeleton cannot be mapped; that is found out beside what the node does."""
    mimics = "".join(
        f"<link name='l{i}'/>"
        f"<joint name='j{i}' type='revolute'><parent link='l{i}'/><child link='l{i + 1}'/>"
        + (f"<mimic joint='j{i - 1}'/>" if i else "")
        + "</joint>"
        for i in range(4000)
    )
    text = f"<robot name='r'>{mimics}<link name='l4000'/></robot>"
    before = feeder.probe.value(node, "rejected.robot_description")
    feeder.probe.publish(ROBOT_DESCRIPTION, String(data=text))
    until(
        lambda: feeder.probe.value(node, "rejected.robot_description") > before,
        "the long chain is rejected",
    )
    feeder.answer(feeder.send())


def test_missing_joint_states_are_told(feeder, node, until):
    def level():
        return feeder.probe.diagnostics(node).level

    until(lambda: level() == DiagnosticStatus.STALE, "the missing input on /diagnostics")
    assert "no usable joint_states for" in feeder.probe.diagnostics(node).message

    def well():
        feeder.send()
        return level() == DiagnosticStatus.OK

    until(well, "all is well again")


def test_a_time_that_begins_again_is_followed(feeder):
    feeder.stamp = 5 * 10**9
    feeder.send()  # the first one might be a stray
    feeder.answer(feeder.send())
    feeder.stamp += 3600 * 10**9
    feeder.send()
    feeder.answer(feeder.send())


def test_joint_states_without_a_stamp_are_of_now(feeder):
    before = feeder.probe.node.get_clock().now().nanoseconds
    count = len(feeder.found())
    for _ in range(2):
        feeder.probe.publish(
            JOINT_STATES, JointState(name=list(feeder.names), position=feeder.values())
        )
    feeder.until(lambda: len(feeder.found()) > count, "poses")
    assert nanoseconds(feeder.found()[-1]) >= before


def test_clean_end(node, feeder):
    feeder.send()
    node.send(signal.SIGINT)
    assert node.wait() == 0
    assert "Traceback" not in node.output
