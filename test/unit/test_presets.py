"""Presets: what their files say, who takes it, and what wins over them."""

import argparse

import pytest
import yaml

import garment_sim_ros as gs
from garment_sim_ros import presets
from garment_sim_ros.cli import main as cli
from garment_sim_ros.cli import stability
from garment_sim_ros.cli.avatar_options import node_parameters
from garment_sim_ros.garment.outfit_file import outfit_from
from garment_sim_ros.nodes import NODES
from garment_sim_ros.params import (
    PRESETS,
    ClothNodeParameters,
    ColliderOptions,
    Environment,
    ImplicitSettings,
    XpbdSettings,
    declarations,
    idle,
    validated,
)
from garment_sim_ros.presets import chosen, collider_options, preset_file, preset_values

PAPERS = ("sun2007", "gong2018")
OURS = tuple(name for name in PRESETS if name not in PAPERS)
BALL = gs.ColliderSet.of(gs.sphere(0.1))


def simulation(**options):
    return gs.Simulation(gs.Garment.sheet(0.4, 5), BALL, **options)


def test_there_is_a_file_for_every_name_and_no_other():
    folder = preset_file("balanced").parent
    assert {path.stem for path in folder.glob("*.yaml")} == set(PRESETS)


@pytest.mark.parametrize("name", PRESETS)
def test_files_set_every_node_and_do_something(name):
    content = yaml.safe_load(preset_file(name).read_text())
    assert set(content) == {f"/**/{node}" for node in NODES}
    for node in NODES:
        said = content[f"/**/{node}"]["ros__parameters"]
        assert said
        assert preset_values(name, node) == said
    said = preset_values(name, "cloth_node")
    assert said.keys() >= ({"solver", "sub_step", "iterations"} if name in OURS else {"sweeps"})
    assert idle(simulation(preset=name).parameters.settings) == []
    assert idle(validated(ColliderOptions, collider_options(name))) == []


def test_balanced_is_the_defaults():
    for node, card in NODES.items():
        known = card.declared()
        if node == "cloth_node":
            known |= declarations(XpbdSettings)
        for name, value in preset_values("balanced", node).items():
            assert value == known[name].default, name
            assert type(value) is known[name].type, name
    assert simulation(preset="balanced").parameters == simulation().parameters
    assert simulation(preset="balanced").solver_step == simulation().solver_step
    assert validated(ColliderOptions, collider_options("balanced")) == ColliderOptions()


def test_fast_takes_longer_sub_steps_than_balanced_and_accurate_shorter_ones():
    step = {name: preset_values(name, "cloth_node")["sub_step"] for name in OURS}
    assert step["fast"] > step["balanced"] > step["accurate"]


@pytest.mark.parametrize("name", sorted({*PRESETS} - {"auto"}))  # which is not one point
def test_figures_are_in_the_head(name):
    head = [line for line in preset_file(name).read_text().splitlines() if line[:3] == "#: "]
    assert head[0].startswith("#: python bench/presets.py")
    pierced = "pierced 0.0 %" if name in OURS else "pierced "
    assert any("walk: " in line and pierced in line for line in head)


def test_single_values_and_groups_win_in_python():
    fast = preset_values("fast", "cloth_node")
    assert simulation(preset="fast").parameters.settings.sub_step == fast["sub_step"]
    both = simulation(preset="fast", sub_step=0.004, solver_step=0.008)
    assert both.parameters.settings.sub_step == 0.004
    assert both.parameters.settings.search_every == fast["search_every"]
    assert both.solver_step == 0.008
    group = simulation(preset="fast", settings=XpbdSettings(iterations=2))
    assert group.parameters.settings == XpbdSettings(iterations=2)


def test_what_a_preset_says_of_its_solver_is_not_for_another():
    other = simulation(preset="fast", solver="implicit")
    plain = simulation(solver="implicit")
    assert other.parameters == plain.parameters
    assert other.solver_step == plain.solver_step
    words = ["cloth_node.solver=implicit", "cloth_node.iterations=3"]
    choice = chosen("fast", words)
    assert choice.solver == "implicit"
    group = type(plain.parameters.settings)
    assert choice.values("cloth_node", group) == {"iterations": 3}
    assert "solver_step" not in choice.values("cloth_node", ClothNodeParameters)


def test_an_avatar_takes_colliders_from_a_preset(monkeypatch):
    asked = []
    monkeypatch.setattr(
        "garment_sim_ros.avatar.collider_options", lambda name: {"max_faces": 40, "split": 1.0}
    )
    monkeypatch.setattr(
        "garment_sim_ros.avatar.fit_colliders", lambda body, how: asked.append(how) or BALL
    )
    monkeypatch.setattr(gs.Avatar, "__init__", lambda self, body, colliders, attachments: None)
    gs.Avatar.load("mannequin", preset="fast", split=0.1, cache=False)
    assert asked == [ColliderOptions(max_faces=40, split=0.1)]


@pytest.mark.parametrize(
    ("text", "node", "name", "value"),
    [
        ("cloth_node.rate=30", "cloth_node", "rate", 30.0),
        ("cloth_node.coarse=true", "cloth_node", "coarse", True),
        ("cloth_node.iterations = 2", "cloth_node", "iterations", 2),
        ("cloth_node.gravity=[0, 0, -9]", "cloth_node", "gravity", (0.0, 0.0, -9.0)),
        ("collider_node.method=capsule", "collider_node", "method", "capsules"),
        ("collider_node.mu=left_thigh=0.03", "collider_node", "mu", "left_thigh=0.03"),
        ("mocap_player.speed=1e-1", "mocap_player", "speed", 0.1),
    ],
)
def test_single_values_from_a_command_line(text, node, name, value):
    choice = chosen("fast", ["cloth_node.rate=20", text])
    assert choice.given(node)[name] == value
    assert choice.given(node)["preset"] == "fast"


WRONG = [
    (
        ["--preset", "best"],
        "preset: found 'best'; allowed: fast, balanced, accurate, auto, sun2007, gong2018",
    ),
    (["--set", "fast"], "--set: found 'fast'; allowed: NODE.PARAM=VALUE"),
    (["--set", "sub_step=1"], "--set: found 'sub_step=1'; allowed: NODE.PARAM=VALUE"),
    (["--set", "cloth.rate=30"], "--set: no node 'cloth'; allowed: mocap_player, collider_node"),
    (["--set", "cloth_node.sub_stp=1"], "--set cloth_node.sub_stp: unknown, perhaps sub_step; "),
    (["--set", "cloth_node.sweeps=1"], "--set cloth_node.sweeps: does nothing with the solver xp"),
    (["--set", "cloth_node.iterations=no"], "--set cloth_node.iterations: found 'no'; allowed: a"),
    (["--set", "cloth_node.coarse=1"], "--set cloth_node.coarse: found '1'; allowed: true or fal"),
]


@pytest.mark.parametrize("command", ["demo", "info", "stability"])
@pytest.mark.parametrize(("words", "line"), WRONG)
def test_wrong_names_and_values_give_one_line(command, words, line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    out = ["--out", "out"] if command != "info" else []
    assert cli.main([command, *out, *words]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {line}")
    assert error.count("\n") == 1
    assert "; allowed: " in error
    assert not list(tmp_path.iterdir())


def parsed(command, *words):
    return cli.parser(command).parse_args([command, "--out", "out", *words])


def test_demo_starts_nodes_with_the_preset_and_what_wins_over_it():
    args = parsed("demo", "--preset", "fast", "--set", "cloth_node.rate=30")
    nodes = node_parameters(args)
    assert {node["preset"] for node in nodes.values()} == {"fast"}
    assert nodes["cloth_node"]["rate"] == 30.0
    assert "sub_step" not in nodes["cloth_node"]  # the node reads it itself
    with pytest.raises(gs.ParameterError, match=r"own; allowed: --body-bone-names"):
        node_parameters(parsed("demo", "--set", "cloth_node.body_bone_names=f.yaml"))


def test_stability_drives_the_solver_of_the_preset():
    fast = stability._settings(parsed("stability", "--preset", "fast"))
    assert fast == {"xpbd": simulation(preset="fast").parameters.settings}
    single = stability._settings(parsed("stability", "--set", "cloth_node.iterations=3"))
    assert single == {"xpbd": XpbdSettings(iterations=3)}
    assert len(stability._settings(parsed("stability"))) == 3
    for word in ("cloth_node.solver_step=0.01", "collider_node.method=capsules"):
        with pytest.raises(gs.ParameterError, match=r"is what the scenes say; allowed: cloth_n"):
            stability._settings(parsed("stability", "--set", word))


def test_stability_takes_single_parameters_for_the_solver_that_is_asked_for():
    words = ("stability", "--solver", "implicit", "--set")
    found = stability._settings(parsed(*words, "cloth_node.sub_step=0.004"))
    assert found == {"implicit": ImplicitSettings(sub_step=0.004)}
    both = stability._settings(parsed(*words, "cloth_node.iterations=3", "--solver", "xpbd"))
    assert both == {"implicit": ImplicitSettings(iterations=3), "xpbd": XpbdSettings(iterations=3)}
    with pytest.raises(gs.ParameterError, match=r"coarse: does nothing with the solver implicit"):
        stability._settings(parsed(*words, "cloth_node.coarse=true"))
    with pytest.raises(gs.ParameterError, match=r"solver: is beside --solver; allowed: one"):
        stability._settings(parsed(*words, "cloth_node.solver=xpbd"))


def test_an_outfit_wins_over_a_preset_where_it_says_something():
    usual = ColliderOptions(max_faces=40, method="ellipsoids", mu="left_thigh=0.02")
    garment = {"name": "skirt", "generator": "short_skirt", "mu": "left_thigh=0.01"}
    silent = outfit_from({"version": 1, "garments": [{**garment, "mu": ""}]})
    assert silent.colliders_on(usual) == usual
    tight = outfit_from({"version": 1, "garments": [garment]})
    assert tight.colliders_on(usual).mu == "left_thigh=0.01"
    says = outfit_from({"version": 1, "garments": [garment], "colliders": {"method": "hulls"}})
    assert says.colliders_on(usual).method == "hulls"
    assert says.colliders_on(usual).max_faces == 40


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("cloth_node: {}", "is not a preset; allowed: /**/mocap_player, "),
        ("/**/cloth_node: {}", "has no ros__parameters"),
        ("/**/cloth_node: {ros__parameters: {sub_stp: 1}}", "unknown, perhaps sub_step"),
        ("/**/cloth_node: {ros__parameters: {sweeps: 1}}", "does nothing with the solver xpbd"),
        ("/**/cloth_node: {ros__parameters: {sub_step: 1}}", "sub_step: found 1; allowed: a num"),
    ],
)
def test_a_damaged_file_is_told(text, line, tmp_path, monkeypatch):
    (tmp_path / "fast.yaml").write_text(text)
    monkeypatch.setattr(presets, "preset_file", lambda name: tmp_path / f"{name}.yaml")
    with pytest.raises(gs.InputFileError) as raised:
        preset_values("fast", "cloth_node")
    assert line in str(raised.value)


def test_files_are_found_in_every_layout(tmp_path, monkeypatch):
    """A clone, and an environment into which the package and its shared files were installed."""
    for layout, package, files in (
        ("clone", "garment_sim_ros", "config/presets"),
        (
            "venv",
            "lib/python3.12/site-packages/garment_sim_ros",
            "share/garment_sim_ros/config/presets",
        ),
        ("target", "garment_sim_ros", "share/garment_sim_ros/config/presets"),
    ):
        root = tmp_path / layout
        (root / package).mkdir(parents=True)
        monkeypatch.setattr(presets, "__file__", str(root / package / "presets.py"))
        with pytest.raises(gs.InputFileError, match=r"fast\.yaml: is not installed; allowed: "):
            preset_file("fast")
        (root / files).mkdir(parents=True)
        (root / files / "fast.yaml").write_text("")
        assert preset_file("fast") == root / files / "fast.yaml"


def test_what_a_preset_says_in_vain_is_not_told_as_the_users():
    usual = {"max_faces": 40}
    told = ColliderOptions(method="capsules", max_faces=40)
    assert len(idle(told)) == 1
    assert idle(told, usual) == []
    assert len(idle(ColliderOptions(method="capsules", max_faces=60), usual)) == 1


def test_options_are_shown_with_what_is_allowed():
    from garment_sim_ros.cli.preset_options import add_preset_options, choice_of

    parser = argparse.ArgumentParser()
    add_preset_options(parser)
    words = " ".join(parser.format_help().split())
    assert "fast, balanced, accurate, auto, sun2007, gong2018 (default: balanced)" in words
    choice = choice_of(parser.parse_args(["--set", "cloth_node.wind_drag=1"]))
    assert choice.values("cloth_node", Environment) == {"wind_drag": 1.0}
