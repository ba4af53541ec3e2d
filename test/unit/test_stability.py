"""The stability map: verdicts that must find faults, and a few extremes that must hold."""

import json
from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.cli.main import main
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.stability.cells import cells
from garment_sim_ros.stability.extremes import Scene, curtain
from garment_sim_ros.stability.judge import Outcome, judge
from garment_sim_ros.stability.map import Row, grade, picture, table

CELLS = {cell.name: cell for cell in cells()}
FAST = (
    *("step: 333 ms", "stiffness: 1e+09 N/m", "NaN input: 1 s of poses"),
    *("pins: inside a collider", "teleport: 100 m, ignore"),
)
"""`garment-sim stability` runs all."""
FAST_IMPLICIT = ("stiffness: 1e+06 N/m", "mass ratio: 100, graded mesh")


def scene(**asked):
    cloth, colliders, motion = curtain()
    return Scene(garments=(cloth,), colliders=colliders, motion=motion, **asked)


@pytest.mark.parametrize("name", FAST)
def test_extremes_hold(name):
    outcome = judge(CELLS[name].scene(), "xpbd")
    assert outcome.faults == ()
    assert outcome.figures["resets"] == 0
    assert (outcome.figures["rejected"] > 0) == name.startswith("NaN")


@pytest.mark.parametrize("name", FAST_IMPLICIT)
def test_extremes_hold_with_the_implicit_solver(name):
    assert judge(CELLS[name].scene(), "implicit").faults == ()


def test_every_cell_has_a_name_of_its_own_and_a_scene_that_ends():
    assert len(CELLS) == len(list(cells()))
    for cell in CELLS.values():
        if cell.extreme != "dressed body":
            made = cell.scene()
            still = [made.motion(made.busy + t) for t in (1.0, 2.0)]
            assert np.array_equal(still[0].position, still[1].position)
            assert np.array_equal(still[0].orientation, still[1].orientation)


def test_cloth_that_is_still_swinging_is_found_restless():
    outcome = judge(scene(calm=1.0, unique=True), "xpbd")
    assert "restless" in outcome.faults
    assert "elsewhere" in outcome.faults


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda state: state.v.fill(np.nan), "not finite"),
        (lambda state: state.x.__iadd__(np.float32(50.0)), "out of bounds"),
        (lambda state: state.v.__imul__(np.float32(1.02)), "energy grows"),
    ],
)
def test_what_a_broken_solver_does_is_found(monkeypatch, change, fault):
    """The same scene, with a solver that also does something wrong after each frame."""
    advance = Simulation.advance

    def wrong(self, *args):
        advance(self, *args)
        change(self.state("cloth"))

    monkeypatch.setattr(Simulation, "advance", wrong)
    assert fault in judge(scene(calm=4.0), "xpbd").faults


def test_a_skirt_beside_a_leg_is_found_pierced_and_inside(monkeypatch):
    """A body that stands still, with a solver that pulls the skirt beside its legs."""
    made = CELLS["dressed body: teleport 100 m, keep"].scene()
    stand = made.motion(0.0)
    short = replace(
        made, busy=made.frame, calm=2 * made.frame, jump=None, motion=lambda t: stand.copy()
    )
    skirt = next(g.name for g in short.garments if "skirt" in g.name)
    advance, frames = Simulation.advance, []

    def beside(self, *args):
        advance(self, *args)
        frames.append(args)
        if len(frames) > 2:  # after the first, of the undisturbed run
            self.state(skirt).x[:, 1] += np.float32(0.06)

    monkeypatch.setattr(Simulation, "advance", beside)
    outcome = judge(short, "xpbd")
    assert {"pierced", "inside"} <= set(outcome.faults), outcome
    assert outcome.figures["pierced_undisturbed"] == 0
    assert outcome.figures["inside_undisturbed"] < 0.005
    assert outcome.figures["inside"] > 0.05


def test_what_cannot_be_simulated_is_told_as_refused():
    cloth, colliders, motion = curtain()
    flat = replace(cloth, vertices=np.zeros_like(cloth.vertices))
    outcome = judge(Scene(garments=(flat,), colliders=colliders, motion=motion), "xpbd")
    assert "no area" in outcome.refused
    assert grade(outcome) == "refused"


def test_table_and_picture(tmp_path):
    rows = [
        Row(extreme="wind", value="1 m/s", outcomes={"xpbd": Outcome(faults=(), figures={})}),
        Row(
            extreme="wind",
            value="2 m/s",
            outcomes={"xpbd": Outcome(faults=("restless",), figures={})},
        ),
    ]
    assert table(rows).splitlines()[2:] == [
        "| wind | 1 m/s | holds |",
        "|  | 2 m/s | restless |",
        "| **held** | of 2 | 1 |",
    ]
    picture(rows, tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes()[:4] == b"\x89PNG"


def test_the_command_lists_runs_and_refuses(tmp_path, capsys):
    assert main(["stability", "--out", str(tmp_path), "--only", "gravity", "--list"]) == 0
    assert "gravity: 100 g" in capsys.readouterr().out
    chosen = ["--only", "gravity: 1 g", "--solver", "xpbd"]
    assert main(["stability", "--out", str(tmp_path / "map"), *chosen, "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["held"] == {"xpbd": 1}
    made = sorted(path.name for path in (tmp_path / "map").iterdir())
    assert made == ["stability.json", "stability.md", "stability.png"]
    assert main(["stability", "--out", str(tmp_path), "--only", "hail"]) == 2
    assert "allowed" in capsys.readouterr().err
