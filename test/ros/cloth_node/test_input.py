"""cloth_node: input that is slow, fast, damaged, missing, doubled or another."""

import struct

import pytest

pytest.importorskip("rclpy")
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Pose, PoseArray
from rclpy.serialization import serialize_message
from ros_input.cloth import NAMESPACE, SECOND, Avatar, Feeder, points_of, resets, stamp_of
from std_msgs.msg import Header, String

from garment_sim_ros.ros.topics import COLLIDER_DESCRIPTION, COLLIDER_POSES

pytestmark = pytest.mark.ros


@pytest.mark.parametrize("rate", [10, 1000])
def test_slow_and_fast_input(running, probe, node, until, reach, rate):
    running.start(SECOND // rate)
    until(
        lambda: abs(probe.value(node, "input_period_ms") * rate - 1000.0) < 1.0,
        "the node knows the input's period",
    )

    def moves_evenly():
        stamps = [stamp_of(m) for m in probe.next("garments/shirt/points", 60)]
        assert max(stamps) <= running.stamp
        return len(set(stamps)) > 30

    until(moves_evenly, "the cloth moves with most frames, not with every message")
    reach()


def test_input_that_stops_and_comes_back(running, probe, node, reach, until):
    for pause in (SECOND // 2, 100 * SECOND):
        running.stop()
        until(
            lambda: len(set(map(stamp_of, probe.received("garments/shirt/points")[-5:]))) == 1,
            "the cloth stands still",
        )
        until(
            lambda: probe.diagnostics(node).level == DiagnosticStatus.STALE,
            "the missing input on /diagnostics",
        )
        assert "no usable collider_poses for" in probe.diagnostics(node).message
        assert probe.value(node, "input_age_s") > 1.0

        def a_second():
            status = probe.diagnostics(node)
            until(lambda: probe.diagnostics(node) is not status, "the next second")

        until(lambda: probe.silent_while("garments/shirt/points", a_second), "no more frames")
        running.stamp += pause
        running.start()
        reach()
        until(lambda: probe.diagnostics(node).level == DiagnosticStatus.OK, "all is well again")


def poses_message(feeder, *, count=None, **first):
    poses = [Pose() for _ in range(count or len(feeder.avatar.colliders))]
    for key, value in first.items():
        group, _, axis = key.partition("_")
        setattr(getattr(poses[0], group), axis, value)
    return poses


def with_header(feeder, poses, *, stamp=None, frame_id="world"):
    # The feeder's timer sends meanwhile; the stamps of its next messages are after these.
    stamp = feeder.stamp + 1 if stamp is None else stamp
    header = Header(stamp=Time(sec=stamp // SECOND, nanosec=stamp % SECOND), frame_id=frame_id)
    return serialize_message(PoseArray(header=header, poses=poses))


def damaged(feeder):
    data = bytearray(with_header(feeder, poses_message(feeder)))
    struct.pack_into("<I", data, 24, 2**32 - 1)  # the number of poses
    return bytes(data)


REJECTED = {
    "not_finite": lambda f: with_header(f, poses_message(f, position_x=float("nan"))),
    "orientation_not_unit": lambda f: with_header(f, poses_message(f, orientation_w=0.2)),
    "out_of_range": lambda f: with_header(f, poses_message(f, position_z=-1e8)),
    "pose_count": lambda f: with_header(f, poses_message(f, count=3)),
    "frame_id": lambda f: with_header(f, poses_message(f), frame_id="map"),
    "stamp_backwards": lambda f: with_header(f, poses_message(f), stamp=f.stamp - SECOND // 10),
    "stamp_jump": lambda f: with_header(f, poses_message(f), stamp=f.stamp + 1000 * SECOND),
    "malformed": damaged,
    "too_many": lambda f: with_header(f, poses_message(f, count=5000)),
}


@pytest.mark.parametrize("reason", sorted(REJECTED))
def test_unusable_poses_are_counted_and_the_cloth_goes_on(
    running, probe, node, until, reach, reason
):
    before = probe.value(node, f"rejected.{reason}")
    resets_before = resets(probe)
    probe.publish(COLLIDER_POSES, REJECTED[reason](running))
    until(
        lambda: (
            probe.value(node, f"rejected.{reason}") == before + 1
            and reason in probe.diagnostics(node).message
            and probe.diagnostics(node).level == b"\x01"
        ),
        f"{reason} is counted and told as a warning",
    )
    reach()
    assert resets(probe) == resets_before


def test_one_of_two_publishers_is_followed(running, probe, node, until, reach, make_probe, avatar):
    before = resets(probe)
    other = Feeder(make_probe(NAMESPACE), avatar)
    other.origin[:] = 3.0, 0.0, 0.0
    other.stamp = running.stamp
    other.probe.publish(COLLIDER_POSES, avatar.message(other.stamp, avatar.rest))
    other.start()

    def told():
        status = probe.diagnostics(node)
        return status.message if "2 publishers of collider_poses" in status.message else ""

    message = until(told, "both publishers on /diagnostics")
    assert f"{NAMESPACE}/probe" in message
    assert "is followed" in message
    assert probe.diagnostics(node).level == DiagnosticStatus.WARN
    until(lambda: "2 publishers of collider_poses" in node.output, "both in the log")
    for _ in range(3):
        reach()
    assert resets(probe) == before
    running.stop()

    def taken_over():
        return points_of(probe.next("garments/shirt/points")[0])[:, 0].mean() > 2.0

    until(taken_over, "the cloth follows the other publisher")
    taken_over_at = resets(probe)
    assert taken_over_at > before
    other.stop()
    running.stamp = other.stamp
    running.start()
    until(lambda: resets(probe) > taken_over_at, "the cloth follows the first again")
    reach()


def test_a_body_that_jumps_takes_its_clothes_along(running, probe, reach):
    before = resets(probe)
    running.origin[:] = 5.0, -3.0, 0.0
    reach()
    assert resets(probe) == before + 1


def test_a_time_that_begins_again_is_followed(running, reach):
    running.stamp = 10 * SECOND
    reach()


def test_unusable_descriptions_are_counted_and_the_cloth_goes_on(
    running, probe, node, until, reach, avatar
):
    text = avatar.description.data
    for bad in ("", "[1]", text[:1000], text.replace("0.002", "0.003"), text.replace("hips", "h")):
        before = probe.value(node, "rejected.collider_description")
        probe.publish(COLLIDER_DESCRIPTION, String(data=bad))
        until(
            lambda b=before: probe.value(node, "rejected.collider_description") > b,
            f"{bad[:20]!r} is rejected",
        )
    reach()


def test_another_description_while_running(running, probe, node, until, reach, avatar):
    other = Avatar(delta=0.004)
    assert other.colliders.revision != avatar.colliders.revision
    made = node.output.count("models stretch")
    before = len(probe.received("garments/shirt/points"))
    probe.publish(COLLIDER_DESCRIPTION, other.description)
    running.avatar = other
    until(lambda: node.output.count("models stretch") == made + 1, "garments for other colliders")
    assert len(probe.received("garments/shirt/points")) > before
    reach()
    probe.publish(COLLIDER_DESCRIPTION, avatar.description)
    running.avatar = avatar
    until(lambda: node.output.count("models stretch") == made + 2, "the first garments again")
    reach()
