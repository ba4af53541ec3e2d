"""cloth_node: how it starts and ends, and the same messages in two processes."""

import signal
import subprocess
import sys

import numpy as np
import psutil
import pytest

pytest.importorskip("rclpy")
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from ros_input.cloth import GARMENTS, SECOND, points_of, stamp_of
from ros_input.nursery import started

from garment_sim_ros.ros.topics import COLLIDER_DESCRIPTION, COLLIDER_POSES, GARMENT_POINTS

pytestmark = pytest.mark.ros


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
def test_help_and_version_end_with_0(nursery, name):
    for begin, word, said in (
        (started, "--help", "rate"),
        (nursery.start, "--version", "garment_sim_ros 0."),
        (nursery.start, "-h", name),
    ):
        process = begin(f"garment_sim_ros.ros.{name}", [word], errors=True)
        assert said in process.stdout.read()
        assert not process.stderr.read()
        assert process.wait(120) == 0


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
        asked = {"outfit": outfit, "step_on": "poses", "normals": True}
        node = start_node("cloth_node", namespace, apart=True, **asked)
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
        step, time = SECOND // 180, None
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
