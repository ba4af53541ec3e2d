"""Parameter files, the launch file and the table of topics agree with what is declared."""

import ast
import py_compile
from pathlib import Path

import pytest
import yaml

from garment_sim_ros import params

REPOSITORY = Path(__file__).resolve().parents[2]
GROUPS = {
    "mocap_player": (params.MocapPlayerParameters,),
    "collider_node": (params.ColliderNodeParameters,),
    "cloth_node": (params.ClothNodeParameters, params.Environment, params.RelaxationSettings),
}
LAUNCH = REPOSITORY / "launch" / "garment_sim.launch.py"


@pytest.mark.parametrize("node", sorted(GROUPS))
def test_parameter_files_hold_every_default(node):
    text = (REPOSITORY / "config" / f"{node}.yaml").read_text()
    found = yaml.safe_load(text)["/**"]["ros__parameters"]
    declared = {}
    for group in (params.LifecycleParameters, *GROUPS[node]):
        declared.update(params.declarations(group))
    assert list(found) == list(declared)
    for name, declaration in declared.items():
        assert params.checked(declaration, found[name]) == declaration.default
        assert type(found[name]) is (list if declaration.type is tuple else declaration.type)


def test_launch_file_starts_the_nodes_with_its_arguments(tmp_path):
    py_compile.compile(str(LAUNCH), cfile=str(tmp_path / "launch.pyc"), doraise=True)
    tree = ast.parse(LAUNCH.read_text())
    functions = {n.name for n in tree.body if isinstance(n, ast.FunctionDef)}
    assert "generate_launch_description" in functions
    (arguments,) = (
        ast.literal_eval(n.value)
        for n in tree.body
        if isinstance(n, ast.Assign) and n.targets[0].id == "ARGUMENTS"
    )
    assert arguments.keys() >= {"namespace", "body", "clip", "outfit", "use_sim_time"}
    assert all(about for _, about in arguments.values())
    started = {
        call.args[0].value: [k.arg for k in call.keywords]
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "node"
    }
    assert set(started) == set(GROUPS)
    for node, names in started.items():
        known = {"use_sim_time"}.union(*(params.declarations(g) for g in GROUPS[node]))
        assert known.issuperset(names)
        assert "use_sim_time" in names
    conditional = {
        call.args[0].value
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "node" and call.args[1:]
    }
    assert conditional == {"mocap_player"}  # with an empty clip others send joint states


# Name: message type, depth, transient local, reliable for publishers, reliable for subscribers.
TOPICS = {
    "joint_states": ("JointState", 10, False, True, False),
    "robot_description": ("String", 1, True, True, True),
    "collider_description": ("String", 1, True, True, True),
    "collider_poses": ("PoseArray", 10, False, True, True),
    "root_pose": ("PoseStamped", 10, False, True, True),
    "collider_markers": ("MarkerArray", 2, False, True, True),
    "garments/{}/points": ("PointCloud2", 2, False, True, True),
    "garments/{}/mesh": ("Marker", 2, False, True, True),
    "garments/{}/topology": ("Mesh", 1, True, True, True),
    "quality": ("DiagnosticArray", 2, False, True, True),
}


def test_topics_are_those_promised():
    pytest.importorskip("rclpy")
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy

    from garment_sim_ros.ros import interfaces

    topics = {t.name: t for t in vars(interfaces).values() if isinstance(t, interfaces.Topic)}
    assert set(topics) == {*TOPICS, "/clock", "/diagnostics"}
    for name, (kind, depth, latched, *reliable) in TOPICS.items():
        topic = topics[name]
        assert topic.type.__name__ == kind
        for subscribed, is_reliable in zip((False, True), reliable):
            profile = topic.profile(subscribed=subscribed)
            assert profile.depth == depth
            assert profile.history == HistoryPolicy.KEEP_LAST
            assert (profile.durability == DurabilityPolicy.TRANSIENT_LOCAL) == latched
            assert (profile.reliability == ReliabilityPolicy.RELIABLE) == is_reliable
    assert topics["collider_poses"].profile(keep_all=True).history == HistoryPolicy.KEEP_ALL
