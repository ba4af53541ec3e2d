"""The demo as a newcomer runs it: three real processes, a bag, figures and pictures."""

import colorsys
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from PIL import Image
from rosbags.highlevel import AnyReader
from waiting import until

from garment_sim_ros.cli.avatar_options import node_parameters
from garment_sim_ros.cli.main import parser
from garment_sim_ros.cli.node_processes import NodeProcesses
from garment_sim_ros.errors import GarmentSimError

pytest.importorskip("rclpy")
pytest.importorskip("embreex")

pytestmark = pytest.mark.ros

COMMAND = [sys.executable, "-m", "garment_sim_ros.cli.main", "demo"]
GARMENTS = ("tshirt", "skirt")
TOPICS = {
    *("/joint_states", "/robot_description", "/root_pose", "/quality"),
    *("/collider_poses", "/collider_description", "/collider_markers"),
    *(f"/garments/{g}/{t}" for g in GARMENTS for t in ("points", "mesh", "topology")),
}
FIGURES = {
    *("frames", "rate_hz", "late_frames", "step_ms_median", "step_ms_p95"),
    *("pierced", "inside_p99", "inside_median"),
    *("penetration_mm_p99", "penetration_mm_max", "gap_mm_median", "strain_p95", "strain_max"),
    *("finite", "resets", "garments"),
}


def nodes_of(folder: Path) -> list[psutil.Process]:
    """Node processes whose parameters lie in `folder`."""
    found = []
    for process in psutil.process_iter(["cmdline"]):
        words = process.info["cmdline"] or []
        if "--params-file" in words and str(folder) in " ".join(words):
            found.append(process)
    return found


def hue_of_marker(reader: AnyReader, topic: str) -> float:
    """Hue of a marker's colour, 0 to 1."""
    connections = [c for c in reader.connections if c.topic == topic]
    connection, _, data = next(reader.messages(connections))
    colour = reader.deserialize(data, connection.msgtype).color
    return colorsys.rgb_to_hsv(colour.r, colour.g, colour.b)[0]


def rows_of_hue(picture: Image.Image, hue: float) -> np.ndarray:
    """Rows of a picture's pixels that have a hue, within 6 degrees, and are far from grey."""
    found = np.asarray(picture.convert("HSV"), np.float64) / 255.0
    away = np.abs((found[..., 0] - hue + 0.5) % 1.0 - 0.5)
    return np.nonzero((away < 6 / 360) & (found[..., 1] > 0.3))[0]


def test_demo_leaves_bag_figures_and_pictures(tmp_path):
    out = tmp_path / "out"
    words = [*COMMAND, "--seconds", "1", "--out", str(out), "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not nodes_of(out)
    assert "frames published" in done.stdout
    summary = json.loads((out / "summary.json").read_text())
    assert json.loads(done.stdout.splitlines()[-1]) == summary
    assert set(summary) >= FIGURES
    assert summary["finite"] is True
    assert set(summary["garments"]) == set(GARMENTS)
    for garment in summary["garments"].values():
        assert garment["vertices"] > 1000
        assert 0.0 < garment["pinned_share"] < 0.1

    with AnyReader([out / "bag"]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        hues = {name: hue_of_marker(reader, f"/garments/{name}/mesh") for name in GARMENTS}
    assert {topic for topic, count in counts.items() if count} >= TOPICS
    # How many there are in a second says how fast and busy the machine is, no more.
    frames = min(counts[f"/garments/{name}/points"] for name in GARMENTS)
    assert summary["frames"] == frames > 1
    with Image.open(out / "preview.png") as picture:
        assert picture.width > 3 * picture.height / 2
        rows = {name: rows_of_hue(picture, hue) for name, hue in hues.items()}
    # Each is drawn in the colour that its topic has: the shirt above the skirt.
    assert all(len(found) > 0.005 * picture.width * picture.height for found in rows.values())
    assert np.median(rows["tshirt"]) < np.median(rows["skirt"]) - 0.1 * picture.height
    with Image.open(out / "preview.gif") as film:
        assert film.n_frames > 1
    assert (out / "preview.gif").stat().st_size < 3e6
    assert {p.name for p in out.iterdir()} == {
        *("bag", "logs", "preview.gif", "preview.png", "summary.json"),
    }


@pytest.mark.parametrize(
    ("moment", "sign"),
    [
        ("starting", signal.SIGTERM),
        pytest.param("starting", signal.SIGINT, marks=pytest.mark.slow),
        ("recording", signal.SIGINT),
        pytest.param("recording", signal.SIGTERM, marks=pytest.mark.slow),
    ],
)
def test_interrupted_demo_leaves_nothing_behind(tmp_path, moment, sign):
    out = tmp_path / "a" / "out"
    demo = subprocess.Popen([*COMMAND, "--out", str(out)], stderr=subprocess.PIPE)
    limit = time.monotonic() + 180.0

    def reached() -> bool:
        if moment == "starting":
            return len(nodes_of(out)) == 3
        return any(bag.stat().st_size > 100_000 for bag in out.glob("*/bag/*.mcap"))

    while not reached():
        assert time.monotonic() < limit
        assert demo.poll() is None
    demo.send_signal(sign)
    demo.communicate(timeout=60.0)
    assert demo.returncode == 130
    assert not nodes_of(out)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("option", "name", "content"),
    [
        ("--body", "body.glb", b"not a body"),
        ("--clip", "clip.bvh", b"HIERARCHY\nnothing"),
        ("--outfit", "outfit.yaml", b"version: 99\n"),
        pytest.param("--clip", "tango", None, marks=pytest.mark.slow),
    ],
)
def test_unusable_input_is_named_and_ends_the_demo(tmp_path, option, name, content):
    value = name
    if content is not None:
        (tmp_path / name).write_bytes(content)
        value = str(tmp_path / name)
    words = [*COMMAND, "--out", str(tmp_path / "out"), option, value]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1
    assert name in lines[0]
    assert not (tmp_path / "out").exists()
    assert not nodes_of(tmp_path)


BAD_HOLD = """version: 1
garments:
  - {name: skirt, generator: short_skirt, attachments: [{bone: wing, vertices: [0]}]}
"""


def test_a_body_that_cannot_wear_an_outfit_ends_the_demo_before_nodes_are_started(tmp_path):
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(BAD_HOLD)
    words = [*COMMAND, "--out", str(tmp_path / "out"), "--outfit", str(outfit)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    (line,) = (line for line in done.stderr.splitlines() if line.startswith("error: "))
    assert line.startswith(f"error: {outfit}: garment 'skirt': ")
    assert "wing" in line
    assert not (tmp_path / "out").exists()


def test_a_node_that_says_that_it_cannot_dress_the_body_ends_the_demo(tmp_path):
    """The nodes go on for ever: another description might come. Here none does."""
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(BAD_HOLD)
    asked = node_parameters(parser("demo").parse_args(["demo", "--outfit", str(outfit)]))

    def refused():
        try:
            nodes.check()
        except GarmentSimError as error:
            return str(error)
        return ""

    with NodeProcesses(tmp_path) as nodes:
        for name in ("collider_node", "cloth_node"):
            nodes.start(name, asked[name])
        said = until(refused)
    assert said.startswith("cloth_node: rejected collider_description: ")
    assert "wing" in said
    assert not nodes_of(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "clip"),
    [
        ("mh_female_young.glb", "cmu_131_03_hop_spin.bvh"),
        ("CesiumMan.glb", "deepmimic_cartwheel.bvh"),
        ("mh_female_young.glb", "rokoko_jesse_dance.bvh"),
    ],
)
def test_demo_on_real_bodies_and_clips(tmp_path, data_file, body, clip):
    words = [*COMMAND, "--out", str(tmp_path / "out"), "--seconds", "4", "--json"]
    # A copy: the fit is kept beside the body.
    words += [
        "--body",
        str(shutil.copy(data_file("bodies", body), tmp_path)),
        "--clip",
        str(data_file("mocap", clip)),
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=os.environ)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout.splitlines()[-1])
    assert summary["finite"] is True
    assert summary["frames"] > 1  # how many says how fast and busy the machine is
