"""The player as a process: what it publishes, how it is steered, how it ends."""

import signal

import numpy as np
import pytest

pytest.importorskip("rclpy")

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger

from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.ros.topics import CLOCK, JOINT_STATES, ROBOT_DESCRIPTION

pytestmark = pytest.mark.ros

NAMESPACE = "/player_test"
RATE = 50.0
PERIOD = 20_000_000


def nanoseconds(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


@pytest.fixture(scope="module")
def player(start_node):
    return start_node("mocap_player", NAMESPACE, clip="walk:path=straight", rate=RATE)


@pytest.fixture(scope="module")
def probe(make_probe, player):
    probe = make_probe(NAMESPACE)
    probe.next(probe.listen(JOINT_STATES))
    return probe


def number(name, value):
    kind = ParameterType.PARAMETER_DOUBLE
    return Parameter(name=name, value=ParameterValue(type=kind, double_value=value))


def set_parameter(probe, parameter):
    request = SetParameters.Request(parameters=[parameter])
    return probe.call(SetParameters, "mocap_player/set_parameters", request).results[0]


def test_joint_states_are_evenly_stamped(probe):
    messages = probe.next("joint_states", 50)
    steps = np.diff([nanoseconds(m.header.stamp) for m in messages])
    # A frame that the machine was too late for is left out; none comes in between.
    assert (np.round(steps / PERIOD) >= 1).all()
    assert np.abs(steps - PERIOD * np.round(steps / PERIOD)).max() < PERIOD / 20
    for message in messages:
        assert message.header.frame_id == "world"
        assert len(message.name) == len(message.position) == len(set(message.name))
        assert len(message.velocity) == len(message.effort) == 0
        assert np.isfinite(message.position).all()


def test_the_body_walks_as_fast_as_the_clip(probe):
    messages = probe.next("joint_states", 60)
    clip = load_clip("walk:path=straight")
    x = [list(m.position) for m in messages]
    stamps = 1e-9 * np.array([nanoseconds(m.header.stamp) for m in messages])
    forward = [i for i, n in enumerate(messages[0].name) if n.endswith("position")]
    moved = np.linalg.norm(np.array(x)[-1, forward] - np.array(x)[0, forward])
    travel = clip.values[-1] - clip.values[0]
    speed = np.linalg.norm(travel[clip.rig.dofs.kind == 1]) / clip.duration
    assert moved / (stamps[-1] - stamps[0]) == pytest.approx(speed, rel=0.1)


def test_a_stall_is_a_longer_step(probe, player, until):
    """A process that is stopped for a while is where its stamps say that it is."""
    forward = [
        i for i, n in enumerate(probe.received("joint_states")[0].name) if n.endswith("position")
    ]
    start = len(probe.received("joint_states"))
    for _ in range(3):
        probe.next("joint_states", 10)
        player.send(signal.SIGSTOP)
        stamp = probe.node.get_clock().now().nanoseconds
        until(
            lambda s=stamp: probe.node.get_clock().now().nanoseconds > s + 300_000_000,
            "the player is late",
        )
        player.send(signal.SIGCONT)
        probe.next("joint_states", 10)
    messages = probe.received("joint_states")[start:]
    stamps = 1e-9 * np.array([nanoseconds(m.header.stamp) for m in messages])
    place = np.array([list(m.position) for m in messages])[:, forward]
    assert np.diff(stamps).max() > 0.25
    speed = np.linalg.norm(np.diff(place, axis=0), axis=1) / np.diff(stamps)
    # The walk's hips move at 1.3 m/s and sway.
    assert speed.min() > 0.5
    assert speed.max() < 2.5


def test_description_reaches_late_joiners_and_names_the_joints(make_probe, probe, until):
    late = make_probe(NAMESPACE)
    name = late.listen(ROBOT_DESCRIPTION)
    until(lambda: late.received(name), "the description")
    text = late.received(name)
    rig = parse_urdf(text[0].data)
    assert sorted(rig.dofs.names) == sorted(probe.received("joint_states")[0].name)


def test_quality_of_service(probe):
    (joints,) = probe.publishers_of("joint_states")
    assert joints.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    assert joints.qos_profile.durability == DurabilityPolicy.VOLATILE
    (description,) = probe.publishers_of("robot_description")
    assert description.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    assert description.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_pausing_holds_the_body_not_the_time(probe):
    assert probe.call(SetBool, "mocap_player/pause", SetBool.Request(data=True)).success
    held = probe.next("joint_states", 5)
    assert all(m.position == held[0].position for m in held)
    assert nanoseconds(held[-1].header.stamp) > nanoseconds(held[0].header.stamp)
    assert probe.call(SetBool, "mocap_player/pause", SetBool.Request(data=False)).success
    moving = probe.next("joint_states", 5)
    assert moving[-1].position != moving[0].position


def test_reset_begins_the_clip_again(probe):
    first = load_clip("walk:path=straight").values[0]
    assert probe.call(Trigger, "mocap_player/reset", Trigger.Request()).success
    after = probe.next("joint_states", 10)
    nearest = min(np.abs(np.array(m.position) - first).max() for m in after)
    assert nearest < 0.2


def test_parameters_are_described_and_checked(probe):
    names = ["speed", "rate", "clip"]
    request = DescribeParameters.Request(names=names)
    found = probe.call(DescribeParameters, "mocap_player/describe_parameters", request)
    speed, rate, clip = found.descriptors
    assert speed.floating_point_range[0].from_value == 0.0
    assert not speed.read_only
    assert rate.read_only
    assert clip.read_only
    assert all(d.description for d in found.descriptors)
    assert set_parameter(probe, number("speed", 0.0)).successful
    still = probe.next("joint_states", 4)[1:]
    assert all(m.position == still[0].position for m in still)
    refused = set_parameter(probe, number("speed", -1.0))
    assert not refused.successful
    assert not set_parameter(probe, number("rate", 10.0)).successful
    assert set_parameter(probe, number("speed", 1.0)).successful


def test_diagnostics_tell_that_it_plays(probe, player, until):
    until(
        lambda: probe.diagnostics(player) and probe.diagnostics(player).message == "active",
        "diagnostics of the player",
    )
    until(lambda: probe.value(player, "messages") > 0, "a count of messages")


def test_subscribers_are_waited_for(start_node, make_probe, until):
    namespace = "/player_waits"
    node = start_node("mocap_player", namespace, rate=RATE, wait_for_subscribers=1)
    probe = make_probe(namespace)
    until(
        lambda: (
            probe.diagnostics(node)
            and probe.diagnostics(node).message == "waits for 1 subscribers"
        ),
        "it waits",
    )
    assert probe.value(node, "messages") == 0.0
    joints = probe.listen(JOINT_STATES)
    first = probe.next(joints)[0]
    clip = load_clip("walk")
    assert list(first.position) == pytest.approx(clip.values[0].tolist(), abs=1e-12)
    until(lambda: probe.diagnostics(node).message == "active", "it plays")


def test_lifecycle_by_hand(start_node, make_probe, until):
    namespace = "/player_by_hand"
    start_node("mocap_player", namespace, autostart=False, rate=RATE)
    probe = make_probe(namespace)
    joints = probe.listen(JOINT_STATES)

    def change(transition):
        request = ChangeState.Request(transition=Transition(id=transition))
        return probe.call(ChangeState, "mocap_player/change_state", request).success

    def state():
        return probe.call(GetState, "mocap_player/get_state", GetState.Request()).current_state

    assert state().label == "unconfigured"
    assert change(Transition.TRANSITION_CONFIGURE)
    assert not probe.received(joints)
    assert change(Transition.TRANSITION_ACTIVATE)
    probe.next(joints, 3)
    assert change(Transition.TRANSITION_DEACTIVATE)
    assert change(Transition.TRANSITION_CLEANUP)
    assert state().label == "unconfigured"
    until(lambda: probe.silent_while(joints, state), "no more frames")
    assert probe.silent_while(joints, lambda: change(Transition.TRANSITION_CONFIGURE))
    assert change(Transition.TRANSITION_ACTIVATE)
    probe.next(joints, 3)
    assert change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert state().label == "finalized"


def test_a_clock_does_not_follow_itself(start_node, make_probe, until):
    namespace = "/player_clock_live"
    start_node("mocap_player", namespace, publish_clock=True, rate=RATE)
    probe = make_probe(namespace)
    probe.next(probe.listen(JOINT_STATES), 3)
    true = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=True)
    refused = set_parameter(probe, Parameter(name="use_sim_time", value=true))
    assert not refused.successful
    assert refused.reason == "use_sim_time: found true; allowed: false with publish_clock"
    probe.next("joint_states", 10)


def test_its_own_clock(start_node, make_probe):
    namespace = "/player_clock"
    player = start_node("mocap_player", namespace, publish_clock=True, rate=RATE)
    probe = make_probe(namespace)
    clock, joints = probe.listen(CLOCK), probe.listen(JOINT_STATES)
    times = [nanoseconds(m.clock) for m in probe.next(clock, 20)]
    assert (np.array(times) % PERIOD == 0).all()
    assert (np.diff(times) > 0).all()
    stamps = {nanoseconds(m.header.stamp) for m in probe.next(joints, 20)}
    assert all(stamp % PERIOD == 0 for stamp in stamps)
    player.send(signal.SIGTERM)
    assert player.wait() == 0, player.output


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"clip": "no_such.bvh"}, "no_such.bvh: does not exist"),
        ({"clip": "walk:speed=fast"}, "walk:speed: found 'fast'"),
        ({"rate": "fast"}, "rate: found 'fast'"),
        ({"rate": -1.0}, "rate: found -1.0"),
        ({"loop": 3}, "loop: found 3"),
        ({"publish_clock": True, "use_sim_time": True}, "use_sim_time: found true"),
    ],
)
def test_unusable_parameters_end_it_with_one_line(start_node, parameters, words):
    player = start_node("mocap_player", "/player_bad", **parameters)
    assert player.wait() == 2
    lines = [line for line in player.output.splitlines() if line.strip()]
    assert lines[-1].startswith(f"error: {words}")
    assert sum("error: " in line for line in lines) == 1
    assert "Traceback" not in player.output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_clean_end(start_node, make_probe, number):
    namespace = f"/player_end_{number.name.lower()}"
    player = start_node("mocap_player", namespace, rate=RATE)
    probe = make_probe(namespace)
    probe.next(probe.listen(JOINT_STATES), 3)
    player.send(number)
    assert player.wait() == 0, player.output
    assert "Traceback" not in player.output
    assert "rror" not in player.output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_clean_end_before_it_plays(start_node, until, number):
    player = start_node("mocap_player", "/player_early")
    until(lambda: "Built-in walk" in player.output, "the first line of the log")
    player.send(number)
    assert player.wait() == 0, player.output
    assert "Traceback" not in player.output
