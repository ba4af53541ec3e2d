"""The page on many avatars: its commands and its launch file say what `garment-sim run` takes."""

import ast
import re
import shlex
from pathlib import Path

import pytest

from garment_sim_ros.cli import run
from garment_sim_ros.cli.avatar_options import node_parameters
from garment_sim_ros.cli.main import parser

ROOT = Path(__file__).parents[2]
LAUNCH = ROOT / "launch" / "many_avatars.launch.py"
PAGE = (ROOT / "docs" / "many_avatars.md").read_text()


def commands():
    blocks = re.findall(r"```bash\n(.*?)```", PAGE, re.DOTALL)
    lines = [line.partition(" #")[0].strip() for block in blocks for line in block.splitlines()]
    return [shlex.split(line) for line in lines if line.startswith("garment-sim run")]


@pytest.mark.parametrize("line", commands(), ids=" ".join)
def test_commands_are_understood(line):
    args = parser("run").parse_args(line[1:])
    assert node_parameters(args)["cloth_node"]["rate"] > 0.0


def test_each_avatar_has_a_namespace():
    assert run._namespaces("", 1) == [""]
    assert run._namespaces("/ann/", 1) == ["/ann"]
    assert run._namespaces("", 2) == ["/avatar_1", "/avatar_2"]
    assert run._namespaces("host_1", 2) == ["/host_1/avatar_1", "/host_1/avatar_2"]


def function(name):
    tree = ast.parse(LAUNCH.read_text())
    scope = {}
    (found,) = (n for n in tree.body if getattr(n, "name", "") == name)
    exec(compile(ast.Module([found], []), str(LAUNCH), "exec"), scope)
    return scope[name]


def arguments():
    (found,) = (
        ast.literal_eval(n.value)
        for n in ast.parse(LAUNCH.read_text()).body
        if isinstance(n, ast.Assign) and n.targets[0].id == "ARGUMENTS"
    )
    return found


def test_the_launch_file_starts_what_it_is_asked_for():
    given = {name: default for name, (default, _) in arguments().items()}
    given |= {"host": "2", "avatars": "5", "set": "cloth_node.rate=30; mocap_player.speed=2;"}
    args = parser("run").parse_args(function("words")(given))
    nodes = node_parameters(args)
    assert (args.namespace, args.avatars, args.preset) == ("host_2", 5, "fast")
    assert (nodes["cloth_node"]["rate"], nodes["mocap_player"]["speed"]) == (30.0, 2.0)
    assert function("environment")(given) == {"ROS_DOMAIN_ID": "41"}
    assert function("environment")({**given, "domain": ""}) == {}


def test_the_page_names_all_arguments_of_the_launch_file():
    named = set(re.findall(r"(\w+):=", PAGE))
    assert named <= set(arguments())
    assert {"host", "avatars", "domain"} <= named
