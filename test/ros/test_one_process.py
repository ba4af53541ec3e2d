"""Avatars whose nodes share one process: the same for everybody else."""

import dataclasses
import json
import re
import shlex
import signal
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from ros_input.cloth import stamp_of
from ros_input.one_process import LIMIT, wearing
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.ros.one_process import OneProcess
from garment_sim_ros.ros.serialize import Joints
from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_POSES,
    DIAGNOSTICS,
    GARMENT_POINTS,
    JOINT_STATES,
    QUALITY,
    ROBOT_DESCRIPTION,
)

pytestmark = pytest.mark.ros

SECOND = 10**9


def follow(probe, until, namespace, frames):
    """Send a walk, each pose when the cloth of the one before has come; what came."""
    clip = load_clip("walk")
    sampler, joints = ClipSampler(clip, "carry"), Joints(clip.rig.dofs.names, "world")
    poses = probe.listen(COLLIDER_POSES, raw=True)
    points = probe.listen(GARMENT_POINTS, "skirt", raw=True)
    collider = SimpleNamespace(full_name=f"{namespace}/collider_node")
    probe.publish(ROBOT_DESCRIPTION, String(data=urdf_from_clip(clip, "world")))
    until(
        lambda: (
            probe.diagnostics(collider)
            and "waits for joint_states" in probe.diagnostics(collider).message
        ),
        "a skeleton",
    )
    until(lambda: probe.is_matched(poses) and probe.is_matched(points), "garments")
    for i in range(frames):
        data = joints.fill(SECOND + i * SECOND // 30, sampler.sample(1.0 + i / 30.0))
        probe.publish(JOINT_STATES, data)
        until(lambda i=i: len(probe.received(points)) > i, f"frame {i}")
    return probe.received(poses), probe.received(points)


def test_a_subscriber_gets_the_same_bytes_as_from_the_nodes_apart(
    start_node, make_probe, until, command, outfit
):
    # The first pose, too, comes to all who ask for it.
    words = ["--clip", "", "--outfit", outfit, "--set", "cloth_node.step_on=poses"]
    words += ["--set", "collider_node.lossless=true"]
    words += ["--set", "collider_node.wait_for_subscribers=1"]
    one = command(*words, "--namespace", "one_process", apart=True)
    apart = "/three_processes"
    waits = {"lossless": True, "wait_for_subscribers": 2}
    start_node("collider_node", apart, outfit=outfit, **waits)
    start_node("cloth_node", apart, outfit=outfit, step_on="poses")
    found = [follow(make_probe(name), until, name, frames=40) for name in ("/one_process", apart)]
    for of_one, of_three in zip(*found):
        assert len(of_one) == 40
        assert [bytes(m) for m in of_one] == [bytes(m) for m in of_three]
    moved = np.diff([np.frombuffer(bytes(m)[-4000:], np.float32) for m in found[0][1]], axis=0)
    assert np.abs(moved).max() > 1e-3
    one.send(signal.SIGTERM)
    assert one.wait()[0] == 130


def test_everything_of_the_nodes_is_there_for_others(command, make_probe, until, outfit):
    namespace = "/all_of_one"
    # Else joint states are best effort: on a busy machine one may have no pose.
    every = ("--set", "collider_node.lossless=true")
    process = command("--outfit", outfit, "--namespace", namespace, *every, "--json")
    probe = make_probe(namespace)
    topics = [JOINT_STATES, COLLIDER_POSES, QUALITY]
    names = [probe.listen(topic, raw=True) for topic in topics]
    names.append(probe.listen(GARMENT_POINTS, "skirt", raw=True))
    # What comes while a publisher does not yet know its reader is not sent again.
    until(lambda: all(len(probe.received(name)) > 10 for name in names), "all topics")
    begin = stamp_of(probe.received(names[0])[-1])
    until(lambda: all(len(probe.received(name)) > 40 for name in names), "all topics")

    # A pose for each joint state, with its stamp; the cloth is not ahead of them.
    joints, poses, _, points = ([stamp_of(m) for m in probe.received(n)] for n in names)
    assert len([s for s in poses if s >= begin]) > 10
    assert [s for s in poses if begin <= s <= joints[-1]] == [
        s for s in joints if begin <= s <= poses[-1]
    ]
    until(lambda: stamp_of(probe.received(names[1])[-1]) >= points[-1], "a pose")

    # Services and parameters.
    assert probe.call(SetBool, "mocap_player/pause", SetBool.Request(data=True)).success
    assert probe.call(Trigger, "cloth_node/reset", Trigger.Request()).success
    for node in ("mocap_player", "collider_node", "cloth_node"):
        status = SimpleNamespace(full_name=f"{namespace}/{node}")
        until(lambda s=status: probe.diagnostics(s), f"diagnostics of {node}")

    # Lifecycle: the cloth is told the colliders again, which were described before.
    for number in (
        Transition.TRANSITION_DEACTIVATE,
        Transition.TRANSITION_CLEANUP,
        Transition.TRANSITION_CONFIGURE,
        Transition.TRANSITION_ACTIVATE,
    ):
        request = ChangeState.Request(transition=Transition(id=number))
        assert probe.call(ChangeState, "cloth_node/change_state", request).success
    probe.next(names[3], 5)
    process.send(signal.SIGINT)
    code, printed = process.wait()
    assert code == 130
    assert json.loads(printed)["avatars"][namespace]["frames"] > 0
    assert "Traceback" not in process.said


def test_a_process_that_stood_still_keeps_its_garments(command, make_probe, until, outfit):
    """Nothing was sent meanwhile: it is no new time, in which they would be put on again."""
    namespace = "/stood_still"
    process = command("--outfit", outfit, "--namespace", namespace)
    probe = make_probe(namespace)
    points = probe.listen(GARMENT_POINTS, "skirt", raw=True)
    until(lambda: len(probe.received(points)) > 20, "cloth")
    cloth = SimpleNamespace(full_name=f"{namespace}/cloth_node")

    def counted():
        before = probe.diagnostics(cloth)
        until(lambda: probe.diagnostics(cloth) is not before, "diagnostics")
        return {k: probe.value(cloth, k) for k in ("resets", "time_jumps", "skipped_s")}

    def warnings_of(node, topic):
        of_all = (status for message in probe.received(topic) for status in message.status)
        return [s.message for s in of_all if s.name == node.full_name and s.level != s.OK]

    before = counted()
    told = probe.listen(DIAGNOSTICS)
    for _ in range(2):
        process.send(signal.SIGSTOP)
        stood = time.monotonic()
        until(lambda since=stood: time.monotonic() > since + 1.6, "some time to pass")
        process.send(signal.SIGCONT)
        probe.next(points, 30)
    after = counted()
    until(lambda: any("passed over" in text for text in warnings_of(cloth, told)), "a warning")
    until(lambda: "too slow" in process.said, "a line in the log")
    assert after["skipped_s"] > before["skipped_s"]
    assert (after["resets"], after["time_jumps"]) == (before["resets"], before["time_jumps"])


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--avatars", "0"), "--avatars: found 0; allowed: 1 to 100"),
        (("--seconds", "nan"), "--seconds: found nan; allowed: above 0, to 1e9"),
        (("--namespace", "a b"), "--namespace: found '/a b'; allowed: names of letters"),
        (("--body", "no.glb"), "--body no.glb: does not exist; allowed: a file"),
        (("--outfit", "no_such"), "no_such"),
        (("--set", "cloth_node.rate=0"), "--set cloth_node.rate: "),
    ],
)
def test_bad_input_is_one_line(command, words, told):
    process = command(*words)
    code, printed = process.wait()
    assert (code, printed) == (2, "")
    last = process.said.splitlines()[-1]
    assert last.startswith("error: ")
    assert told in last
    assert "Traceback" not in process.said


def test_the_description_that_is_handed_over_is_published(outfit, make_probe, until):
    with OneProcess() as process:
        process.add("/told", {"collider_node": {}, "cloth_node": {"outfit": outfit}})
        probe = make_probe("/told")
        text = probe.listen(COLLIDER_DESCRIPTION)
        until(lambda: probe.received(text), "the description")
        assert json.loads(probe.received(text)[0].data)["version"] == 1


def test_who_is_not_heard_is_told(outfit, make_probe, until):
    """Another publisher of what is handed over: on /diagnostics, as where nodes are apart."""
    probe = make_probe("/handed")
    with OneProcess() as process:
        process.add("/handed", wearing(outfit))
        until(lambda: process.is_dressed, "a dressed avatar", limit=LIMIT)

        def told(name):
            status = probe.diagnostics(SimpleNamespace(full_name=f"/handed/{name}"))
            return status and status.message

        until(lambda: told("collider_node"), "diagnostics")
        assert "publishers of" not in told("collider_node")
        for name, topic in (("collider_node", JOINT_STATES), ("cloth_node", COLLIDER_POSES)):
            probe.node.create_publisher(topic.type, topic.name, topic.profile())
            words = f"2 publishers of {topic.name}: that of this process is followed"
            until(lambda name=name, words=words: words in told(name), f"{name} to tell")
        process.check()


def test_bodies_are_dressed_when_they_come_and_undressed_when_they_go(
    command, make_probe, until, outfit
):
    """Others publish their joint states and their skeletons, where REP-155 has them."""
    bodies = ["/humans/bodies/anna", "/humans/bodies/bob"]
    process = command("--humans", "--outfit", outfit, "--json")
    clip = load_clip("walk")
    sampler, joints = ClipSampler(clip, "carry"), Joints(clip.rig.dofs.names, "world")
    probe = make_probe("/humans_probe")
    nodes = probe.node.get_node_names_and_namespaces

    def publishers(body):
        make = probe.node.create_publisher
        topics = (ROBOT_DESCRIPTION, JOINT_STATES)
        return [make(t.type, f"{body}/{t.name}", t.profile()) for t in topics]

    walking = {body: publishers(body) for body in bodies}
    for description, _ in walking.values():
        description.publish(String(data=urdf_from_clip(clip, "world")))
    points = [f"{body}/garments/skirt/points" for body in bodies]
    for topic in points:
        probe.listen(dataclasses.replace(GARMENT_POINTS, name=topic), raw=True)

    def walk():
        now = time.time_ns()
        data = joints.fill(now, sampler.sample(now / SECOND % 5.0))
        for _, states in walking.values():
            states.publish(data)
        time.sleep(0.02)

    def walk_until(condition, what):
        until(lambda: walk() or condition(), what)

    walk_until(lambda: all(len(probe.received(t)) > 5 for t in points), "cloth of both")
    for publisher in walking.pop(bodies[0]):
        probe.destroy(publisher)
    walk_until(lambda: not any(ns == bodies[0] for _, ns in nodes()), "the first to be gone")
    came = len(probe.received(points[1]))
    walk_until(lambda: len(probe.received(points[1])) > came + 10, "the other to go on")
    process.send(signal.SIGINT)
    code, printed = process.wait()
    assert code == 130
    assert list(json.loads(printed)["avatars"]) == [bodies[1]]
    assert "Traceback" not in process.said


PAGE = Path(__file__).parents[2] / "docs" / "many_avatars.md"
COMMANDS = re.findall(r"^garment-sim run ([^#\n]*)", PAGE.read_text(), re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("words", COMMANDS)
def test_commands_of_the_page_run(command, words):
    process = command(*shlex.split(words))
    code, printed = process.wait()
    assert code == 0, process.said
    assert "% of a core in" in printed or json.loads(printed)["processor_percent"] > 0.0
