"""Parameter files, the launch file and the table of topics agree with what is declared."""

import ast
import py_compile
from pathlib import Path

import pytest
import yaml

from garment_sim_ros import params
from garment_sim_ros.nodes import NODES
from garment_sim_ros.sim.solvers import SOLVERS

REPOSITORY = Path(__file__).resolve().parents[2]
GROUPS = {
    name: tuple(s.group for s in card.sections if s.solver in ("", "xpbd"))
    for name, card in NODES.items()
}
LAUNCH = REPOSITORY / "launch" / "garment_sim.launch.py"


@pytest.mark.parametrize("node", NODES)
def test_parameter_files_hold_every_default(node):
    text = (REPOSITORY / "config" / f"{node}.yaml").read_text()
    assert text == NODES[node].parameter_file()
    found = yaml.safe_load(text)["/**"]["ros__parameters"]
    declared = {}
    for group in GROUPS[node]:
        declared.update(params.declarations(group))
    assert set(found) == set(declared)
    for name, declaration in declared.items():
        assert params.checked(declaration, found[name]) == declaration.default
        assert type(found[name]) is (list if declaration.type is tuple else declaration.type)


@pytest.mark.parametrize("node", NODES)
def test_help_has_every_parameter_with_type_default_range_and_text(node):
    text = " ".join(NODES[node].help().split())
    for section in NODES[node].sections:
        assert set(section.live) <= set(params.declarations(section.group))
        for name, d in params.declarations(section.group).items():
            kind = "3 floats" if d.type is tuple else d.type.__name__
            assert f" {name} ({kind}, default " in text
            assert f"{d.described} {d.allowed[0].upper()}{d.allowed[1:]}" in text


def test_solvers_of_the_help_are_those_that_there_are():
    groups = {s.solver: s.group for s in NODES["cloth_node"].sections if s.solver}
    assert groups == {name: solver.settings for name, solver in SOLVERS.items()}


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
    assert arguments.keys() >= {
        "namespace",
        "body",
        "clip",
        "outfit",
        "use_sim_time",
        "preset",
        "set",
    }
    assert all(about for _, about in arguments.values())
    started = {
        call.args[0].value: [k.arg for k in call.keywords]
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "node"
    }
    given = {
        call.args[0].value: ast.unparse(call.args[1])
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "node"
    }
    assert set(started) == set(GROUPS)
    for node, names in started.items():
        known = {"use_sim_time"}.union(*(params.declarations(g) for g in GROUPS[node]))
        assert known.issuperset(names)
        assert "use_sim_time" in names
        assert f"given['{node}']" in given[node]
    conditional = {
        call.args[0].value
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "node" and call.args[2:]
    }
    assert conditional == {"mocap_player"}  # with an empty clip others send joint states


def test_launch_arguments_become_what_a_preset_and_single_values_say():
    tree = ast.parse(LAUNCH.read_text())
    (function,) = (n for n in tree.body if getattr(n, "name", "") == "given_in")
    said = {"preset": "fast", "set": "cloth_node.rate=30; collider_node.method=capsules;"}

    class Configuration(str):
        def perform(self, context):
            return context[self]

    scope = {
        "LaunchContext": dict,
        "LaunchConfiguration": Configuration,
        "ParameterValue": lambda value, value_type: (value_type, value),
    }
    exec(compile(ast.Module([function], []), str(LAUNCH), "exec"), scope)
    assert scope["given_in"](said) == {
        "mocap_player": {"preset": (str, "fast")},
        "collider_node": {"preset": (str, "fast"), "method": (str, "capsules")},
        "cloth_node": {"preset": (str, "fast"), "rate": 30.0},
    }


@pytest.mark.parametrize(
    ("namespace", "prefix"),
    [("", ""), ("/", ""), ("ann", "ann/"), ("/ann/", "ann/"), ("/a/b", "a/b/")],
)
def test_joint_frames_of_two_avatars_have_different_names(namespace, prefix):
    """robot_state_publisher puts `frame_prefix` before every frame of its tree."""
    tree = ast.parse(LAUNCH.read_text())
    (function,) = (n for n in tree.body if getattr(n, "name", "") == "frame_prefix")
    scope = {}
    exec(compile(ast.Module([function], []), str(LAUNCH), "exec"), scope)
    assert scope["frame_prefix"](namespace) == prefix
    keys = [k.value for d in ast.walk(tree) if isinstance(d, ast.Dict) for k in d.keys]
    assert "frame_prefix" in keys


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

    from garment_sim_ros.ros import topics as table

    topics = {t.name: t for t in vars(table).values() if isinstance(t, table.Topic)}
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
