"""Cells of the map that run a preset: all of it, with its own solver only."""

from dataclasses import replace

import pytest

from garment_sim_ros.cli.main import main
from garment_sim_ros.presets import preset_values
from garment_sim_ros.stability import dressed
from garment_sim_ros.stability.cells import cells
from garment_sim_ros.stability.run import Run

CELLS = {cell.name: cell for cell in cells(1)}


def test_a_preset_says_all(monkeypatch):
    made = CELLS["preset: fast, turns half around"].scene()
    assert {c.kind for c in made.colliders.colliders} >= {"capsule"}
    run, said = Run(made, "implicit"), preset_values("fast", "cloth_node")
    assert run.simulation.solver == said["solver"] == "xpbd"
    assert run.simulation.parameters.settings.search_every == said["search_every"]
    assert run.simulation.solver_step == said["solver_step"]
    simulated = len(run.simulation.model("skirt").rest)
    shown = len(run.by_name()["skirt"])
    assert simulated < 0.5 * shown
    # Of all that is simulated; the last frames of both runs are enough.
    run.simulation.reset(made.motion(0.0))
    run.simulation.health("skirt").tangled = 1
    monkeypatch.setattr(made.wearer, "look", lambda poses, x: None)
    monkeypatch.setattr("garment_sim_ros.stability.run.buried", lambda *_: 0.0)
    of_all = sum(len(run.simulation.model(n).rest) for n in run.simulation.names)
    assert run.end().tangled == pytest.approx(1 / of_all)


def test_steps_and_rate_are_those_of_a_node():
    accurate = Run(CELLS["preset: accurate, turns half around"].scene(), "xpbd")
    assert accurate.simulation.solver_step == pytest.approx(1 / 60)
    printed = CELLS["preset: gong2018, turns half around"].scene()
    said = preset_values("gong2018", "cloth_node")
    assert printed.frame == pytest.approx(1 / said["rate"])
    assert printed.environment.gust == said["gust"]
    assert printed.disturbed == printed.environment


def test_other_solvers_and_single_values_skip_it(monkeypatch, tmp_path, capsys):
    def short(preset, scene):
        made = dressed.dressed().scene(dressed.dressed().standing, busy=1 / 60, calm=2 / 60)
        return replace(made, preset=preset)

    monkeypatch.setattr(dressed, "of_preset", short)
    words = ["stability", "--out", str(tmp_path / "a"), "--only", "preset: fast, turns"]
    assert main([*words, "--solver", "implicit"]) == 0
    assert "| skipped |" in capsys.readouterr().out
    words[2] = str(tmp_path / "b")
    assert main([*words, "--set", "cloth_node.strain_limit=0.2"]) == 0
    said = capsys.readouterr()
    assert "| skipped |" in said.out
    assert "fast says all; allowed: no --preset or --set beside it" in said.err
