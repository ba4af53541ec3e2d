"""What RViz and Foxglove are set up to show is what the nodes publish."""

import ast
import json
import re
from pathlib import Path

import pytest
import yaml

pytest.importorskip("sensor_msgs")
from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT, read_outfit
from garment_sim_ros.ros.topics import topic_of

ROOT = Path(__file__).resolve().parents[2]
RVIZ = ROOT / "config" / "garment_sim.rviz"
FOXGLOVE = ROOT / "config" / "garment_sim.foxglove.json"
LAUNCH = ROOT / "launch" / "garment_sim.launch.py"
SHOWN = {
    "rviz_default_plugins/Marker": "visualization_msgs/msg/Marker",
    "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
    "rviz_default_plugins/PointCloud2": "sensor_msgs/msg/PointCloud2",
    "rviz_default_plugins/Pose": "geometry_msgs/msg/PoseStamped",
}
GARMENTS = {garment.name for garment in read_outfit(DEFAULT_OUTFIT).garments}


def displays():
    found = yaml.safe_load(RVIZ.read_text())["Visualization Manager"]["Displays"]
    return [display for display in found if "Topic" in display]


def named(topic):
    """The topic of our table that a full name is of; its garment is one of the usual outfit."""
    known = topic_of(topic)
    assert known is not None, topic
    pattern = re.escape("/" + known.name.lstrip("/")).replace(r"\{\}", "(.*)")
    match = re.fullmatch(pattern, topic)
    assert match, topic
    assert set(match.groups()) <= GARMENTS, topic
    return known


def test_rviz_asks_for_what_is_published_as_it_is_published():
    for display in displays():
        asked = display["Topic"]
        topic = named(asked["Value"])
        assert SHOWN[display["Class"]] == topic.kind
        assert asked["Depth"] == topic.depth
        assert asked["Reliability Policy"] == "Reliable"
        assert asked["Durability Policy"] == ("Transient Local" if topic.latched else "Volatile")
        assert asked["History Policy"] == "Keep Last"
        assert display["Enabled"] is display["Value"]
    meshes = {d["Name"] for d in displays() if d["Topic"]["Value"].endswith("/mesh")}
    assert meshes == GARMENTS


def test_launch_puts_every_topic_of_rviz_into_its_namespace():
    tree = ast.parse(LAUNCH.read_text())
    (function,) = (n for n in tree.body if getattr(n, "name", "") == "shown_topics")
    scope = {"yaml": yaml}
    exec(compile(ast.Module([function], []), str(LAUNCH), "exec"), scope)
    remapped = scope["shown_topics"](RVIZ.read_text())
    assert {full for full, _ in remapped} == {d["Topic"]["Value"] for d in displays()}
    assert all(full == f"/{relative}" for full, relative in remapped)


def test_foxglove_shows_topics_and_figures_that_there_are():
    layout = json.loads(FOXGLOVE.read_text())
    panels = layout["configById"]
    assert set(re.findall(r'"(\w+!\w+)"', json.dumps(layout["layout"]))) == set(panels)
    for topic in panels["3D!avatar"]["topics"]:
        named(topic)
    assert panels["DiagnosticSummary!nodes"]["topicToRender"] == "/diagnostics"
    told = (ROOT / "garment_sim_ros" / "ros" / "garment_quality.py").read_text()
    told += (ROOT / "garment_sim_ros" / "ros" / "cloth_frames.py").read_text()
    told += (ROOT / "garment_sim_ros" / "ros" / "cloth_node.py").read_text()
    paths = [p["value"] for panel in panels.values() for p in panel.get("paths", ())]
    assert paths
    for path in paths:
        match = re.fullmatch(
            r'/quality\.status\[:\]\{name=="(\w+)"\}\.values\[:\]\{key=="(\w+)"\}\.value', path
        )
        assert match, path
        assert match[1] in GARMENTS
        assert f'"{match[2]}"' in told
