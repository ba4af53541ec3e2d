"""The cloth node as a process, fed by hand."""

import signal
import struct
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Pose, PoseArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import Marker

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.capsules.capsules import fit_capsules
from garment_sim_ros.colliders.description import to_json
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.ros.interfaces import (
    CLOCK,
    COLLIDER_DESCRIPTION,
    COLLIDER_POSES,
    GARMENT_MESH,
    GARMENT_POINTS,
    GARMENT_TOPOLOGY,
    QUALITY,
)
from garment_sim_ros.ros.serialize import Poses

pytestmark = pytest.mark.ros

NAMESPACE = "/cloth_test"
SECOND = 10**9
RATE = 60.0
INPUT_PERIOD = SECOND // 100
GARMENTS = ("skirt", "shirt")
OUTFIT = """
version: 1
garments:
  - {name: skirt, generator: short_skirt, options: {vertices: 500}}
  - {name: shirt, generator: tshirt, options: {vertices: 500}}
"""


def stamp_of(data):
    """Stamp [ns] of a serialized message that begins with a header."""
    seconds, rest = struct.unpack_from("<iI", data, 4)
    return seconds * SECOND + rest


def points_of(data):
    """Positions in a serialized PointCloud2, shape [v, 3]."""
    message = deserialize_message(data, PointCloud2)
    return np.frombuffer(bytes(message.data), np.float32).reshape(message.width, -1)


class Avatar:
    """A mannequin's colliders, swaying."""

    def __init__(self, delta=0.0):
        self.body = load_body("mannequin")
        self.colliders = fit_capsules(self.body, delta=delta)
        self.description = String(data=to_json(self.colliders))
        poser = ColliderPoser(self.colliders, self.body)
        self.rest = poser.poses(rest_transforms(self.body.rig)).copy()
        self._message = Poses(len(self.colliders), "world")

    def at(self, seconds):
        """Poses at a time: 0.2 m to and fro in 2 s."""
        shift = np.array([0.2 * np.sin(np.pi * seconds), 0.0, 0.0])
        return ColliderPoses(
            position=self.rest.position + shift, orientation=self.rest.orientation
        )

    def message(self, stamp, poses):
        return self._message.fill(stamp, poses)


class Feeder:
    """Sends poses at a fixed rate, with a timer of the probe's node, whatever the test does."""

    def __init__(self, probe, avatar):
        self.probe = probe
        self.avatar = avatar
        self.stamp = 1000 * SECOND
        self.origin = np.zeros(3)
        self._timer = None

    def start(self, period=INPUT_PERIOD):
        self.stop()
        self._period = period
        self._due = time.monotonic_ns() + period
        self._timer = self.probe.node.create_timer(1e-9 * max(period, INPUT_PERIOD), self._send)

    def stop(self):
        if self._timer is not None:
            self.probe.node.destroy_timer(self._timer)
            self._timer = None

    def _send(self):
        """All that is due: stamps follow the time even where the timer does not."""
        while self._due <= time.monotonic_ns():
            self._due += self._period
            self.stamp += self._period
            poses = self.avatar.at(1e-9 * self.stamp)
            poses.position += self.origin
            self.probe.publish(COLLIDER_POSES, self.avatar.message(self.stamp, poses))


@pytest.fixture(scope="module")
def outfit(tmp_path_factory):
    path = tmp_path_factory.mktemp("outfit") / "outfit.yaml"
    path.write_text(OUTFIT)
    return str(path)


@pytest.fixture(scope="module")
def avatar():
    return Avatar()


@pytest.fixture(scope="module")
def node(start_node, outfit):
    return start_node("cloth_node", NAMESPACE, outfit=outfit, rate=RATE)


@pytest.fixture(scope="module")
def probe(node, make_probe, avatar, until):
    probe = make_probe(NAMESPACE)
    until(
        lambda: (
            probe.diagnostics(node) and "waits for collider_d" in probe.diagnostics(node).message
        ),
        "the node waits for colliders",
    )
    for name in GARMENTS:
        # Serialized: thousands of points as objects, at 60 Hz, would take all of a core.
        probe.listen(GARMENT_POINTS, name, raw=True)
        probe.listen(GARMENT_MESH, name, raw=True)
    probe.listen(QUALITY)
    probe.publish(COLLIDER_DESCRIPTION, avatar.description)
    # The publisher is made here: it waits for its reader, which the feeder's timer must not.
    probe.publish(COLLIDER_POSES, avatar.message(999 * SECOND, avatar.at(999.0)))
    return probe


@pytest.fixture(scope="module")
def feeder(probe, avatar):
    feeder = Feeder(probe, avatar)
    yield feeder
    feeder.stop()


@pytest.fixture
def running(feeder, reach):
    """Input that runs, and cloth that follows it; both rest while other nodes are tested."""
    feeder.start()
    reach()
    yield feeder
    feeder.stop()


@pytest.fixture
def reach(feeder, probe, until):
    """Waits until the cloth is where the input is now; the shirt's points there."""

    def reach():
        now = feeder.stamp
        found = probe.received("garments/shirt/points")

        def recent():
            return found and now < stamp_of(found[-1]) <= feeder.stamp

        until(recent, "the cloth follows the input")
        points = points_of(found[-1])
        assert np.isfinite(points).all()
        sway = 0.2 * np.sin(np.pi * 1e-9 * stamp_of(found[-1]))
        middle = feeder.origin[0] + sway, feeder.origin[1]
        assert np.abs(points[:, :2].mean(axis=0) - middle).max() < 0.2
        assert 0.8 < points[:, 2].mean() < 1.6
        return points

    return reach


def test_topology_reaches_late_joiners_and_fits_the_points(running, probe, make_probe, until):
    late = make_probe(NAMESPACE)
    for name in GARMENTS:
        topology = late.listen(GARMENT_TOPOLOGY, name)
        until(lambda t=topology: late.received(t), f"topology of the {name}")
        mesh = late.received(topology)[-1]
        triangles = np.array([t.vertex_indices for t in mesh.triangles])
        data = probe.next(f"garments/{name}/points")[0]
        cloud = deserialize_message(data, PointCloud2)
        assert len(mesh.vertices) == cloud.width
        assert triangles.max() == cloud.width - 1
        assert (cloud.header.frame_id, cloud.height, cloud.point_step) == ("world", 1, 12)
        assert [f.name for f in cloud.fields] == ["x", "y", "z"]
        drawn = probe.received(f"garments/{name}/mesh")
        same = until(
            lambda d=data, ms=drawn: [m for m in ms if stamp_of(m) == stamp_of(d)],
            "the marker of that frame",
        )
        marker = deserialize_message(same[0], Marker)
        corners = np.array([[p.x, p.y, p.z] for p in marker.points])
        assert (corners == points_of(data)[triangles.ravel()]).all()
        assert (marker.ns, marker.type, marker.action) == (name, marker.TRIANGLE_LIST, marker.ADD)
        assert marker.header.frame_id == "world"


def test_quality_of_service(running, probe):
    topics = {
        "garments/skirt/points": DurabilityPolicy.VOLATILE,
        "garments/skirt/mesh": DurabilityPolicy.VOLATILE,
        "garments/skirt/topology": DurabilityPolicy.TRANSIENT_LOCAL,
        "quality": DurabilityPolicy.VOLATILE,
    }
    for name, durability in topics.items():
        (info,) = probe.publishers_of(name)
        assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        assert info.qos_profile.durability == durability


def test_stamps_are_whole_steps_and_never_beyond_the_input(running, probe):
    step = round(SECOND / 180)
    stamps = [stamp_of(m) for m in probe.next("garments/shirt/points", 60)]
    assert max(stamps) <= running.stamp
    steps = np.diff(stamps)
    assert (steps >= 0).all()
    assert (steps % step == 0).all()
    assert stamps[-1] > stamps[0]


def test_quality_has_one_status_per_garment_and_frame(running, probe):
    message = probe.next("quality")[0]
    assert [s.name for s in message.status] == list(GARMENTS)
    for status in message.status:
        values = {v.key: float(v.value) for v in status.values}
        assert values.keys() >= {"step_ms", "strain_p95", "strain_max", "contacts", "resets"}
        assert all(np.isfinite(v) for v in values.values())
        assert values["step_ms"] >= 0.0
        assert values["strain_max"] >= values["strain_p95"] - 1e-3
        for measure in ("pierced", "inside", "inside_p99", "inside_median"):
            assert 0.0 <= values[measure] <= 1.0
    stamps = {stamp_of(m) for m in probe.received("garments/skirt/points")}
    assert message.header.stamp.sec * SECOND + message.header.stamp.nanosec in stamps


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
            lambda: len(set(map(stamp_of, probe.next("garments/shirt/points", 5)))) == 1,
            "the cloth stands still",
        )
        until(
            lambda: probe.diagnostics(node).level == DiagnosticStatus.STALE,
            "the missing input on /diagnostics",
        )
        assert "no usable collider_poses for" in probe.diagnostics(node).message
        assert probe.value(node, "input_age_s") > 1.0
        count = len(probe.received("garments/shirt/points"))
        status = probe.diagnostics(node)
        until(lambda s=status: probe.diagnostics(node) is not s, "the next second")
        assert len(probe.received("garments/shirt/points")) == count
        running.stamp += pause
        running.start()
        reach()
        until(lambda: probe.diagnostics(node).level == DiagnosticStatus.OK, "all is well again")


def resets(probe):
    """Times the garments were put on again, as of the next frame."""
    status = probe.next("quality")[0].status[0]
    return next(int(v.value) for v in status.values if v.key == "resets")


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


def test_reset(running, probe, reach):
    before = resets(probe)
    assert probe.call(Trigger, "cloth_node/reset", Trigger.Request()).success
    reach()
    assert resets(probe) == before + 1


def test_pause(running, probe, reach):
    assert probe.call(SetBool, "cloth_node/pause", SetBool.Request(data=True)).success
    held = probe.next("garments/skirt/points", 10)[1:]
    assert all(m == held[0] for m in held)
    assert probe.call(SetBool, "cloth_node/pause", SetBool.Request(data=False)).success
    reach()


def set_parameter(probe, name, **value):
    parameter = Parameter(name=name, value=ParameterValue(**value))
    request = SetParameters.Request(parameters=[parameter])
    return probe.call(SetParameters, "cloth_node/set_parameters", request).results[0]


def test_delay_can_be_set_and_holds(running, probe, until):
    double = ParameterType.PARAMETER_DOUBLE
    assert set_parameter(probe, "delay", type=double, double_value=0.3).successful

    def behind():
        before = running.stamp
        message = probe.next("garments/shirt/points")[0]
        return stamp_of(message) < before - 0.25 * SECOND

    until(behind, "the cloth is 0.3 s behind")
    for _ in range(20):
        message = probe.next("garments/shirt/points")[0]
        assert stamp_of(message) <= running.stamp - 0.25 * SECOND
    assert not set_parameter(probe, "delay", type=double, double_value=-7.0).successful
    assert not set_parameter(probe, "rate", type=double, double_value=10.0).successful
    assert set_parameter(probe, "delay", type=double, double_value=-1.0).successful


def test_gravity_can_be_turned(running, probe, until):
    array = ParameterType.PARAMETER_DOUBLE_ARRAY

    def sideways():
        return points_of(probe.next("garments/skirt/points")[0])[:, 1].mean()

    hanging = sideways()
    turned = set_parameter(probe, "gravity", type=array, double_array_value=[0.0, 20.0, 0.0])
    assert turned.successful
    until(lambda: sideways() > hanging + 0.01, "the skirt swings to the left")
    bad = set_parameter(probe, "gravity", type=array, double_array_value=[0.0, float("nan"), 1.0])
    assert not bad.successful
    back = set_parameter(probe, "gravity", type=array, double_array_value=[0.0, 0.0, -9.81])
    assert back.successful
    until(lambda: sideways() < hanging + 0.005, "the skirt swings back")


def test_a_contact_that_the_colliders_do_not_allow_is_refused(
    start_node, make_probe, outfit, avatar, until
):
    namespace = "/cloth_refuses"
    node = start_node("cloth_node", namespace, outfit=outfit, solver="relaxation")
    probe = make_probe(namespace)
    until(lambda: probe.diagnostics(node), "the node runs")
    probe.publish(COLLIDER_DESCRIPTION, avatar.description)
    until(lambda: "relaxation, steps of" in node.output, "the garments are made")
    text = ParameterType.PARAMETER_STRING
    refused = set_parameter(probe, "contact", type=text, string_value="earliest")
    assert not refused.successful
    assert "contact: found 'earliest' with capsule colliders" in refused.reason
    before = probe.diagnostics(node)
    until(lambda: probe.diagnostics(node) is not before, "that it goes on")
    node.send(signal.SIGTERM)
    assert node.wait() == 0


def test_colliders_that_the_contact_does_not_allow_are_rejected(
    start_node, make_probe, outfit, avatar, until
):
    namespace = "/cloth_earliest"
    asked = {"solver": "relaxation", "contact": "earliest"}
    node = start_node("cloth_node", namespace, outfit=outfit, **asked)
    probe = make_probe(namespace)
    probe.publish(COLLIDER_DESCRIPTION, avatar.description)
    until(lambda: probe.value(node, "rejected.collider_description"), "the rejection")
    until(lambda: "with capsule colliders" in node.output, "the reason in the log")
    before = probe.diagnostics(node)
    until(lambda: probe.diagnostics(node) is not before, "that it goes on")
    node.send(signal.SIGTERM)
    assert node.wait() == 0


def test_simulated_time_can_be_set_while_it_runs(running, probe, node, until, reach):
    boolean = ParameterType.PARAMETER_BOOL
    assert set_parameter(probe, "use_sim_time", type=boolean, bool_value=True).successful
    until(lambda: probe.diagnostics(node).message == "waits for /clock", "the missing clock")
    clock = 50 * SECOND

    def tick():
        nonlocal clock
        clock += INPUT_PERIOD
        now = Time(sec=clock // SECOND, nanosec=clock % SECOND)
        probe.publish(CLOCK, Clock(clock=now))

    timer = probe.node.create_timer(1e-9 * INPUT_PERIOD, tick)
    for _ in range(3):
        reach()
    until(lambda: probe.diagnostics(node).message == "simulates", "all is well")
    probe.node.destroy_timer(timer)
    assert set_parameter(probe, "use_sim_time", type=boolean, bool_value=False).successful
    reach()


def test_wind_of_all_kinds_can_be_set_in_any_spelling(running, probe, node, until):
    text, whole = ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_INTEGER
    wholes = ParameterType.PARAMETER_INTEGER_ARRAY

    def sideways():
        return points_of(probe.next("garments/skirt/points")[0])[:, 1].mean()

    def is_set(name, **value):
        result = set_parameter(probe, name, **value)
        assert result.successful, result.reason

    hanging = sideways()
    told = node.output.count("gust: found 1.0, which does nothing")
    is_set("gust", type=whole, integer_value=1)
    until(
        lambda: node.output.count("gust: found 1.0, which does nothing") == told + 1,
        "the node says that nothing comes of gusts alone",
    )
    is_set("wind", type=wholes, integer_array_value=[0, 6, 0])
    is_set("wind", type=text, string_value="[0, 6.5, 0]")
    is_set("wind_drag", type=text, string_value="12e-1")
    is_set("wind_lift", type=whole, integer_value=0)
    is_set("gust_seed", type=ParameterType.PARAMETER_DOUBLE, double_value=7.0)
    until(lambda: sideways() > hanging + 0.005, "the skirt is blown to the left")
    for name, value, words in (
        (
            "wind",
            {"type": wholes, "integer_array_value": [0, 6]},
            "wind: found [0, 6]; allowed: 3",
        ),
        ("wind_drag", {"type": text, "string_value": "much"}, "wind_drag: found 'much'; allowed"),
        ("gust_longest", {"type": text, "string_value": "0.1"}, "gust_longest: found 0.1 m; allo"),
        ("wnid_drag", {"type": whole, "integer_value": 1}, "perhaps wind_drag"),
        ("rate", {"type": whole, "integer_value": 30}, "rate: is read-only while the node runs"),
    ):
        refused = set_parameter(probe, name, **value)
        assert not refused.successful
        assert words in refused.reason
    is_set("wind", type=wholes, integer_array_value=[0, 0, 0])
    is_set("wind_drag", type=whole, integer_value=0)
    is_set("gust", type=whole, integer_value=0)
    until(lambda: sideways() < hanging + 0.005, "the skirt swings back")


def transition(probe, node, number):
    request = ChangeState.Request(transition=Transition(id=number))
    assert probe.call(ChangeState, f"{node.name}/change_state", request).success, node.output


def rounds_of(node, probe, avatar, count):
    """Threads and memory [MiB] after each round of configuring and cleaning up while dressing."""
    process = psutil.Process(node.pid)
    found = []
    for number in range(count):
        transition(probe, node, Transition.TRANSITION_CONFIGURE)
        transition(probe, node, Transition.TRANSITION_ACTIVATE)
        if number == 0:
            probe.publish(COLLIDER_DESCRIPTION, avatar.description)
        transition(probe, node, Transition.TRANSITION_DEACTIVATE)
        transition(probe, node, Transition.TRANSITION_CLEANUP)
        found.append((process.num_threads(), process.memory_info().rss / 2**20))
    return found


def test_rounds_that_are_quicker_than_the_garments_are_made_pile_nothing_up(
    start_node, make_probe, avatar
):
    namespace = "/cloth_rounds"
    node = start_node("cloth_node", namespace, autostart=False)
    threads = [t for t, _ in rounds_of(node, make_probe(namespace), avatar, 8)]
    # One that makes garments may be at work at any time, never two.
    assert max(threads[2:]) <= min(threads) + 1


@pytest.mark.slow
def test_memory_and_threads_are_flat_after_the_second_round(start_node, make_probe, avatar):
    namespace = "/cloth_many_rounds"
    node = start_node("cloth_node", namespace, autostart=False)
    found = rounds_of(node, make_probe(namespace), avatar, 24)
    threads, memory = zip(*found)
    assert max(threads[2:]) <= min(threads) + 1
    assert max(memory[-5:]) < max(memory[2:7]) + 12.0


@pytest.mark.parametrize("name", ["cloth_node", "collider_node", "mocap_player"])
def test_help_and_version_end_with_0(name):
    for words, said in (
        (["--help"], "rate"),
        (["--version"], "garment_sim_ros 0."),
        (["-h"], name),
    ):
        command = [sys.executable, "-m", f"garment_sim_ros.ros.{name}", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
        assert done.returncode == 0
        assert said in done.stdout
        assert not done.stderr


def test_names_that_are_none_are_warned_about_and_mixed_numbers_taken(start_node, tmp_path, until):
    """`rcl` itself refuses a list of whole and other numbers."""
    file = tmp_path / "p.yaml"
    file.write_text(
        "/**:\n  ros__parameters:\n    gravity: [0, 0, -9.81]\n    stepon: poses\n"
        "    sweeps: 3\n    clip: walk\n    gust: 1\n"
    )
    command = [sys.executable, "-m", "garment_sim_ros.ros.cloth_node", "--ros-args"]
    command += ["--params-file", str(file), "-p", "wind:=[1, 2.5, 0]", "-p", "body:=none.glb"]
    done = subprocess.run(
        [*command, "-p", "outfits:=x"], capture_output=True, text=True, check=False, timeout=180
    )
    assert done.returncode == 2
    for words in (
        "stepon: is no parameter of cloth_node and does nothing, perhaps step_on",
        "outfits: is no parameter of cloth_node and does nothing, perhaps outfit",
        "sweeps: does nothing with the solver xpbd; it acts with solver relaxation",
        "clip: does nothing here; it is a parameter of mocap_player",
        "gust: found 1.0, which does nothing; it acts with wind_drag or wind_lift above 0",
    ):
        assert done.stderr.count(words) + done.stdout.count(words) == 1
    assert "none.glb: does not exist" in done.stderr


def test_the_same_messages_give_the_same_bytes(start_node, make_probe, outfit, avatar, until):
    """With `step_on` poses: uneven stamps, a jump, a stray message; every frame, every byte."""
    runs = []
    for number in (1, 2):
        namespace = f"/cloth_same_{number}"
        node = start_node("cloth_node", namespace, outfit=outfit, step_on="poses", normals=True)
        probe = make_probe(namespace)
        names = [probe.listen(GARMENT_POINTS, name, raw=True) for name in GARMENTS]
        runs.append((node, probe, names))
    random = np.random.default_rng(0)
    steps = random.integers(1_000_000, 40_000_000, size=40)
    stamps = (100 * SECOND + np.cumsum(steps)).tolist()
    frames = []
    for node, probe, names in runs:
        until(lambda p=probe, n=node: p.diagnostics(n), "the node runs")
        probe.publish(COLLIDER_DESCRIPTION, avatar.description)
        # Where a message leaves the simulated time, by the rule of whole steps.
        step, time = round(SECOND / 180), None
        for i, stamp in enumerate(stamps):
            poses = avatar.at(1e-9 * stamp)
            poses.position[:, 0] += 3.0 * (i >= 20)
            probe.publish(COLLIDER_POSES, avatar.message(stamp, poses))
            if i == 10:
                probe.publish(COLLIDER_POSES, avatar.message(stamp - 5, poses))
            is_reset = i in (0, 20)
            moves = is_reset or stamp - time >= step
            time = stamp if is_reset else time + (stamp - time) // step * step
            if moves:
                until(
                    lambda t=time, p=probe, ns=names: all(
                        p.received(n) and stamp_of(p.received(n)[-1]) == t for n in ns
                    ),
                    f"the frame of message {i}",
                )
        assert [stamp_of(b) for b in probe.received(names[0])] == sorted(
            {stamp_of(b) for b in probe.received(names[0])}
        )
        frames.append([probe.received(n) for n in names])
        node.send(signal.SIGINT)
        assert node.wait() == 0
    assert len(frames[0][0]) > 20
    assert frames[0] == frames[1]
    normals = points_of(frames[0][0][-1])[:, 3:]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"outfit": "no_such.yaml"}, "no_such.yaml: "),
        ({"body": ""}, "body: found nothing"),
        ({"body": "no_such.glb"}, "no_such.glb: does not exist"),
        ({"solver": "magic"}, "solver: found 'magic'"),
        ({"step_on": "wishes"}, "step_on: found 'wishes'"),
        ({"gravity": [0.0, -9.81]}, "gravity: found"),
        ({"gust_longest": 0.1}, "gust_longest: found 0.1"),
        ({"gravity": "[0, 0, east]"}, "gravity: found '[0, 0, east]'; allowed: 3 numbers"),
    ],
)
def test_unusable_parameters_end_it_with_one_line(start_node, parameters, words):
    node = start_node("cloth_node", "/cloth_bad", **parameters)
    assert node.wait() == 2
    lines = [line for line in node.output.splitlines() if line.strip()]
    assert lines[-1].startswith(f"error: {words}")
    assert "Traceback" not in node.output


def test_clean_end(running, node):
    node.send(signal.SIGTERM)
    assert node.wait() == 0
    assert "Traceback" not in node.output
