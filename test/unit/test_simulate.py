"""Recordings that are simulated without nodes: the same bytes, and nothing left half-written."""

import json
import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

pytest.importorskip("sensor_msgs")
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from garment_sim_ros.cli.main import main
from garment_sim_ros.mocap.bag_file import opened_bag
from garment_sim_ros.presets import preset_values
from garment_sim_ros.recording.bags import read_recording
from garment_sim_ros.ros.offline import work
from garment_sim_ros.ros.offline.hashes import MessageHash

STORE = get_typestore(Stores.ROS2_JAZZY)
OUTFIT = """
version: 1
garments: [{name: skirt, generator: short_skirt, options: {vertices: 300}}]
"""
CLIP = ("--clip", "walk", "--seconds", "2.2", "--rate", "20")


@pytest.fixture(scope="module")
def outfit(tmp_path_factory):
    path = tmp_path_factory.mktemp("outfit") / "outfit.yaml"
    path.write_text(OUTFIT)
    return str(path)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, outfit):
    """A recording, never changed."""
    out = tmp_path_factory.mktemp("recorded") / "walk"
    assert main(["simulate", *CLIP, "--outfit", outfit, "--out", str(out)]) == 0
    return out


def messages(path):
    """All messages of a recording: topic, type, time, bytes."""
    with opened_bag(path) as bag:
        return [(c.topic, c.msgtype, t, d) for c, t, d in bag.messages(bag.connections)]


def on(path, ending):
    return [(time, data) for topic, _, time, data in messages(path) if topic.endswith(ending)]


def write(path, content, plugin="MCAP", compressed=""):
    """A recording of messages as `messages` gives them."""
    writer = Writer(path, version=9, storage_plugin=StoragePlugin[plugin])
    if compressed:
        writer.set_compression(CompressionMode[compressed], CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, kind, arrival, data in content:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], arrival, data)
    return path


def files(path):
    return {p.name: p.read_bytes() for p in path.iterdir()}


def refused(capsys, *words):
    """The one line of a run that must not work."""
    assert main(["simulate", *map(str, words)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    return lines[0]


def test_another_process_writes_the_same_bytes(recorded, outfit, tmp_path):
    out = tmp_path / "elsewhere"
    command = [sys.executable, "-m", "garment_sim_ros.cli.main", "simulate", *CLIP]
    done = subprocess.run(
        [*command, "--outfit", outfit, "--out", str(out), "--json"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert files(out) == files(recorded)
    told = json.loads(done.stdout.splitlines()[-1])["recordings"][0]
    assert told["frames"] == 45
    assert [p.name for p in tmp_path.iterdir()] == ["elsewhere"]


def test_it_holds_inputs_garments_and_a_hash_per_second(recorded):
    topics = {}
    for topic, kind, _, _ in messages(recorded):
        topics.setdefault(topic, [kind, 0])[1] += 1
    assert topics == {
        "/robot_description": ["std_msgs/msg/String", 1],
        "/joint_states": ["sensor_msgs/msg/JointState", 45],
        "/collider_description": ["std_msgs/msg/String", 1],
        "/collider_poses": ["geometry_msgs/msg/PoseArray", 45],
        "/root_pose": ["geometry_msgs/msg/PoseStamped", 45],
        "/garments/skirt/topology": ["shape_msgs/msg/Mesh", 1],
        "/garments/skirt/points": ["sensor_msgs/msg/PointCloud2", 45],
        "/quality": ["diagnostic_msgs/msg/DiagnosticArray", 45],
        "/simulation": ["std_msgs/msg/String", 1],
        "/state_hash": ["std_msgs/msg/String", 3],
    }


def test_quality_tells_what_does_not_depend_on_the_machine(recorded):
    (garments,) = {
        tuple(
            s.name for s in STORE.deserialize_cdr(d, "diagnostic_msgs/msg/DiagnosticArray").status
        )
        for _, d in on(recorded, "/quality")
    }
    assert garments == ("skirt",)
    quality = read_recording(recorded).quality["skirt"]
    assert not {"step_ms", "late_frames"} & set(quality)
    assert (quality["pierced"] == 0.0).all()
    assert 0.0 < quality["strain_p95"].max() < 0.2
    # Measured in the first frame and each second of simulated time.
    assert len(set(quality["inside"].tolist())) <= 3


def test_a_preset_and_single_parameters(outfit, tmp_path):
    clip = ["--clip", "walk", "--seconds", "0.4", "--rate", "20", "--outfit", outfit]
    single = ["--set", "cloth_node.gravity=[0, 0, -4]", "--set", "collider_node.thickness=0.004"]
    assert (
        main(["simulate", *clip, "--preset", "fast", *single, "--out", str(tmp_path / "a")]) == 0
    )
    ((_, data),) = on(tmp_path / "a", "/simulation")
    text = STORE.deserialize_cdr(data, "std_msgs/msg/String").data
    told = json.loads(text)["parameters"]
    fast = preset_values("fast", "cloth_node")
    assert {k: told["cloth_node"][k] for k in fast} == fast
    assert told["cloth_node"]["gravity"] == [0.0, 0.0, -4.0]
    assert told["collider_node"]["thickness"] == 0.004
    assert main(["simulate", "--verify", str(tmp_path / "a")]) == 0


@pytest.mark.parametrize("topics", ["joint_states", "collider_poses"])
def test_a_recording_of_either_gives_the_cloth_of_the_clip(recorded, outfit, tmp_path, topics):
    description = {"joint_states": "robot_desc", "collider_poses": "collider_desc"}[topics]
    kept = [m for m in messages(recorded) if m[0][1:].startswith((topics, description))]
    named = [(f"/ann{topic}", *rest) for topic, *rest in kept]
    plugin, compressed = {"joint_states": ("SQLITE3", "MESSAGE")}.get(topics, ("MCAP", "FILE"))
    bag = write(tmp_path / "bag", named, plugin, compressed)
    out = tmp_path / "out"
    assert main(["simulate", "--bag", str(bag), "--outfit", outfit, "--out", str(out)]) == 0
    assert on(out, "/ann/garments/skirt/points") == on(recorded, "/points")
    assert on(out, f"/ann/{topics}") == on(recorded, f"/{topics}")
    assert main(["simulate", "--verify", str(out)]) == 0


def test_verify_finds_a_changed_byte(recorded, tmp_path, capsys):
    assert main(["simulate", "--verify", str(recorded)]) == 0
    content = messages(recorded)
    clouds = [k for k, m in enumerate(content) if m[0].endswith("/points")]
    for place, second in ((2, 0), (30, 1), (44, 2)):
        changed = list(content)
        topic, kind, arrival, data = changed[clouds[place]]
        data = bytearray(data)
        data[-9] ^= 1
        changed[clouds[place]] = topic, kind, arrival, bytes(data)
        bag = write(tmp_path / f"changed_{place}", changed)
        line = refused(capsys, "--verify", bag)
        assert f"differs in second {second}: messages are not those" in line
    lost = write(tmp_path / "lost", [m for m in content if m != content[clouds[25]]])
    assert "differs in second 1" in refused(capsys, "--verify", lost)


def test_verify_finds_a_state_that_changed(recorded, capsys, monkeypatch):
    """One bit of one velocity, after the first second; no cloud of that frame shows it."""
    step, count = work.Cloth.step, [0]

    def disturbed(self, data):
        yield from step(self, data)
        count[0] += 1
        if count[0] == 30:
            v = self.stepper.simulation.state("skirt").v
            # Of a free particle: these come first. The last bit may be rounded away at once.
            v.view("u4")[0, 0] ^= 1 << 8

    monkeypatch.setattr(work.Cloth, "step", disturbed)
    line = refused(capsys, "--verify", recorded)
    assert "differs in second 1: the simulation comes to another state" in line


def test_verify_takes_nothing_else(recorded, tmp_path, capsys):
    content = messages(recorded)
    line = refused(capsys, "--verify", tmp_path / "none")
    assert "none: does not exist" in line
    bag = write(tmp_path / "plain", [m for m in content if m[0] != "/simulation"])
    assert "holds no simulation" in refused(capsys, "--verify", bag)
    bag = write(tmp_path / "unhashed", [m for m in content if m[0] != "/state_hash"])
    assert "holds no state_hash" in refused(capsys, "--verify", bag)
    nonsense = b"\0\1\0\0\3\0\0\0{]\0"
    for topic in ("/simulation", "/state_hash"):
        bag = write(
            tmp_path / topic[1:],
            [(*m[:3], nonsense if m[0] == topic else m[3]) for m in content],
        )
        refused(capsys, "--verify", bag)


def test_a_hash_does_not_depend_on_the_order_of_topics_but_on_each_byte():
    found = []
    for order in ((0, 1, 2), (2, 0, 1), (1, 0, 2)):
        hashed = MessageHash()
        for k in order:
            hashed.add(("a", "b", "a")[k], 5, (b"x", b"y", b"z")[k])
        found.append(hashed.take())
    assert found[0] != found[1]  # x before z
    assert found[0] == found[2]
    assert not hashed


def test_hostile_messages_are_left_out(recorded, outfit, tmp_path, capsys):
    """Damaged ones among the good: counted, the cloth is that of the good ones."""
    content = [m for m in messages(recorded) if m[0] in ("/joint_states", "/robot_description")]
    mixed = []
    for k, (topic, kind, arrival, data) in enumerate(content):
        mixed.append((topic, kind, arrival, data))
        for n, bad in enumerate((data[: k + 3], b"\xff" * 60, data[:-8] + b"\xff" * 8, b"")):
            mixed.append((topic, kind, arrival + n + 1, bad))
    bag, out = write(tmp_path / "bag", mixed), tmp_path / "out"
    words = ["simulate", "--bag", str(bag), "--outfit", outfit, "--out", str(out), "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out.splitlines()[-1])["recordings"][0]
    assert sum(told["rejected"].values()) == 4 * len(content)
    assert on(out, "/points") == on(recorded, "/points")
    only_bad = write(tmp_path / "bad", [m for m in mixed if m not in content])
    line = refused(capsys, "--bag", only_bad, "--outfit", outfit, "--out", tmp_path / "no")
    assert "leads to no cloth" in line
    assert not (tmp_path / "no").exists()


def test_recordings_that_are_cut_short(recorded, outfit, tmp_path, capsys):
    """One line, and no output."""
    bag = tmp_path / "bag"
    bag.mkdir()
    for name, data in files(recorded).items():
        (bag / name).write_bytes(data)
    file = bag / "simulation.mcap"
    whole = file.read_bytes()
    for part in (0, 7, 500, len(whole) // 2, len(whole) - 9):
        file.write_bytes(whole[:part])
        refused(capsys, "--bag", bag, "--outfit", outfit, "--out", tmp_path / "out")
        refused(capsys, "--verify", bag)
    assert [p.name for p in tmp_path.iterdir()] == ["bag"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "--clip: missing"),
        (("--clip", "walk"), "--out: missing"),
        (("--clip", "none.bvh", "--out", "{}/o"), "none.bvh: "),
        (("--clip", "walk", "--body", "none.glb", "--out", "{}/o"), "none.glb: does not exist"),
        (("--clip", "walk", "--outfit", "none.yaml", "--out", "{}/o"), "none.yaml: "),
        (("--clip", "walk", "--seconds", "nan", "--out", "{}/o"), "--seconds: found nan"),
        (("--clip", "walk", "--rate", "-1", "--out", "{}/o"), "rate: found -1"),
        (("--bag", "b", "--seconds", "1", "--out", "{}/o"), "--seconds: found without --clip"),
        (("--clip", "walk", "--begin-with", "joint_states", "--out", "{}/o"), "--begin-with: "),
        (("--clip", "walk", "walk", "--out", "{}/o"), "two inputs named 'walk'"),
        (("--clip", *2 * ("a.glb:animation=A/b",), "--out", "{}/o"), "inputs named 'a_A_b'"),
        (("--clip", "walk", "--jobs", "0", "--out", "{}/o"), "--jobs: found 0"),
        (
            ("--clip", "walk", "--scheduler", "x:1:2", "--out", "{}/o"),
            "--scheduler: found 'x:1:2'",
        ),
        (("--clip", "walk", "--preset", "none", "--out", "{}/o"), "preset: found 'none'"),
        *(
            (("--clip", "walk", "--set", f"cloth_node.{said}", "--out", "{}/o"), told)
            for said, told in (
                ("normals=true", "--set cloth_node.normals: has an option of its own"),
                ("step_on=timer", "--set cloth_node.step_on: found 'timer'; allowed: poses"),
                ("sub_step=9", "--set cloth_node.sub_step: found"),
            )
        ),
        (("--clip", "walk", "--out", "{}"), "exists and is no recording"),
    ],
)
def test_wrong_usage(words, told, tmp_path, capsys):
    (tmp_path / "mine").write_text("kept")
    assert told in refused(capsys, *(word.format(tmp_path) for word in words))
    assert [p.name for p in tmp_path.iterdir()] == ["mine"]


def test_what_is_interrupted_leaves_nothing(outfit, tmp_path):
    command = [sys.executable, "-m", "garment_sim_ros.cli.main", "simulate", "--clip", "walk"]
    words = ["--seconds", "3000", "--outfit", outfit, "--out", str(tmp_path / "a" / "out")]
    process = subprocess.Popen([*command, *words], stderr=subprocess.DEVNULL)
    until(lambda: list(tmp_path.glob("a/.partial-*/simulation/*")), process)
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 130
    assert not list(tmp_path.iterdir())


def until(holds, process, longest=120.0):
    """Wait for a condition while a process runs."""
    end = time.monotonic() + longest
    while not holds():
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.02)


def test_several_inputs_and_a_killed_process(recorded, outfit, tmp_path):
    """What is whole stays; the others are done again, and are the same as done alone."""
    inputs = []
    for name in "abc":
        inputs.append(str(tmp_path / name))
        (tmp_path / name).symlink_to(recorded)
    out = tmp_path / "out"
    # One that takes long enough to be met at work.
    command = [sys.executable, "-m", "garment_sim_ros.cli.main", "simulate", "--outfit", outfit]
    slow = ["--clip", "walk", "--seconds", "3000", "--out", str(out), "--bag", inputs[0]]
    process = subprocess.Popen([*command, *slow, "--jobs", "2"], stderr=subprocess.PIPE, text=True)
    until(lambda: (out / "a").exists() and list(out.glob(".partial-*/simulation/*")), process)
    for child in children(process.pid):
        os.kill(child, signal.SIGKILL)
    assert "error: --jobs: a process was ended" in process.communicate()[1]
    assert process.returncode == 2
    assert [p.name for p in out.iterdir()] == ["a"]
    whole = (out / "a").stat().st_ino
    again = ["--bag", *inputs, "--out", str(out), "--jobs", "2", "--resume"]
    subprocess.run([*command, *again], check=True, stderr=subprocess.DEVNULL)
    assert sorted(p.name for p in out.iterdir()) == ["a", "b", "c"]
    assert (out / "a").stat().st_ino == whole
    assert on(out / "a", "/points") == on(out / "c", "/points") == on(recorded, "/points")


def test_processes_end_with_one_that_was_killed(recorded, outfit, tmp_path):
    """It could not end them; they leave nothing half-written."""
    (tmp_path / "a").symlink_to(recorded)
    out = tmp_path / "out"
    command = [sys.executable, "-m", "garment_sim_ros.cli.main", "simulate", "--outfit", outfit]
    slow = ["--clip", "walk", "--seconds", "3000", "--bag", str(tmp_path / "a"), "--out", str(out)]
    process = subprocess.Popen([*command, *slow, "--jobs", "2"], stderr=subprocess.DEVNULL)
    until(lambda: (out / "a").exists() and list(out.glob(".partial-*/simulation/*")), process)
    left = [psutil.Process(child) for child in children(process.pid)]
    assert left
    process.kill()
    process.wait()
    _, alive = psutil.wait_procs(left, timeout=60)
    assert not alive
    assert [p.name for p in out.iterdir()] == ["a"]


def children(parent):
    """Processes that a process has started to simulate in."""
    found = psutil.Process(parent).children()
    return [p.pid for p in found if any("spawn_main" in word for word in p.cmdline())]


def test_no_middleware_is_loaded():
    code = (
        "import sys, garment_sim_ros.ros.offline.recording\n"
        "assert 'rclpy' not in sys.modules, 'rclpy'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
