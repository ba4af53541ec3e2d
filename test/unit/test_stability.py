"""The stability map: verdicts that must find faults, and a few extremes that must hold."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from garment_sim_ros.cli.main import main
from garment_sim_ros.constants import GRAVITY
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.stability import limits
from garment_sim_ros.stability.cells import cells
from garment_sim_ros.stability.drawn import COUNT, drawn_cells
from garment_sim_ros.stability.energy import Energy
from garment_sim_ros.stability.extremes import Scene, curtain, garment, sheet, worn_on
from garment_sim_ros.stability.judge import Outcome, judge
from garment_sim_ros.stability.map import Row, grade, held_by, picture, table
from garment_sim_ros.stability.measures import Edges
from garment_sim_ros.stability.run import Run

CELLS = {cell.name: cell for cell in cells()}
FAST = (
    *("step: 333 ms", "stiffness: 1e+09 N/m", "NaN input: 1 s of poses"),
    *("pins: inside a collider", "teleport: 100 m, ignore", "gravity: 100 g"),
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


@pytest.mark.slow
def test_a_knot_gets_looser_until_cloth_rests():
    faults = judge(CELLS["self-collision: whirled at 1000 deg/s"].scene(), "xpbd").faults
    assert not {"restless", "energy grows"} & set(faults)


@pytest.mark.parametrize("name", FAST_IMPLICIT)
def test_extremes_hold_with_the_implicit_solver(name):
    assert judge(CELLS[name].scene(), "implicit").faults == ()


def test_every_cell_has_a_name_of_its_own_and_a_scene_that_ends():
    assert len(CELLS) == len(list(cells()))
    for cell in CELLS.values():
        dressed = ("dressed body", "long skirt", "colliders", "real body and clip", "preset")
        if cell.extreme not in dressed and "dressed" not in cell.value:
            made = cell.scene()
            still = [made.motion(made.busy + t) for t in (1.0, 2.0)]
            assert np.array_equal(still[0].position, still[1].position)
            assert np.array_equal(still[0].orientation, still[1].orientation)


@pytest.mark.parametrize("frame", [1 / 60, 0.07, 0.4])
def test_nothing_moves_in_the_calm_however_long_frames_are(monkeypatch, frame):
    """Neither the body nor the wind, which takes half a second to change."""
    blown = Environment(wind=(3.0, 0.0, 0.0))
    made = scene(calm=2.0, frame=frame, disturbed=blown)
    given, wind, advance = [], [], Simulation.advance

    def seen(self, start, end, dt):
        given.append((start.position.copy(), end.position.copy()))
        advance(self, start, end, dt)
        wind.append(self._wind.at(self.time).velocity[0])

    monkeypatch.setattr(Simulation, "advance", seen)
    run = Run(made, "xpbd")
    run.disturb()
    assert wind[-1] == pytest.approx(0.0, abs=1e-9)
    assert max(wind) == 3.0
    for before, after in pairwise(given):
        assert np.allclose(before[1], after[0], atol=1e-9), "poses jump"
    run.frame(made.still_from + frame)
    assert np.allclose(*given[-1], atol=1e-9)


def test_what_cloth_holds_is_edges_and_hinges():
    """Rolled up without stretch: half of the bending stiffness, curvature squared, the area."""
    vertices, triangles = sheet(17, 17, 0.2)
    cloth = garment(vertices, triangles, bending_stiffness=1e-3)
    simulation = Simulation([cloth], worn_on(), environment=Environment(), solver="xpbd")
    energy, x = Energy(simulation, (0.0, 0.0, 0.0)), simulation.state("cloth").x
    assert energy.now()[2] < 1e-9
    radius, y = 0.5, x[:, 1].copy()
    x[:, 1], x[:, 2] = radius * np.sin(y / radius), radius * (1.0 - np.cos(y / radius))
    assert energy.now()[2] == pytest.approx(0.5 * 1e-3 / radius**2 * 0.2**2, rel=0.1)


def test_cloth_that_is_still_swinging_is_found_restless():
    outcome = judge(scene(calm=1.0, unique=True), "xpbd")
    assert "restless" in outcome.faults
    assert "elsewhere" in outcome.faults


def broken(monkeypatch, change):
    """A solver that also does something wrong after each frame: `change(simulation, frame)`."""
    advance, frames = Simulation.advance, []

    def wrong(self, *args):
        advance(self, *args)
        frames.append(args)
        change(self, len(frames))

    monkeypatch.setattr(Simulation, "advance", wrong)


def hung(simulation, *factors):
    """The sheet as it hangs at rest, with its axes stretched, pins and all."""
    model, state = simulation.model("cloth"), simulation.state("cloth")
    state.x[:] = model.rest * np.array(factors) - simulation.origin
    state.v[:] = 0.0
    simulation["cloth"].worn.aside.forget()  # what contact asked for where it was


def to_one_point(simulation, _):
    state, free = simulation.state("cloth"), simulation.model("cloth").free_count
    state.x[:free] = state.x[0]


def one_vertex_away(simulation, _):
    simulation.state("cloth").x[0] += np.float32(5.0)


def shaken(simulation, frame):
    free = simulation.model("cloth").free_count
    simulation.state("cloth").x[:free] += np.float32(0.01 * (-1) ** frame)


def dropped(simulation, _):
    simulation.health("cloth").let_go = 1


IN_THE_DISTURBANCE = 125
"""Number of a frame of `scene(calm=4.0)`: 120 before it are without the disturbance."""


def tangled(simulation, _):
    simulation.health("cloth").tangled = 5


def spoilt(particles):
    """NaN as their velocity, once."""
    return lambda s, n: n == IN_THE_DISTURBANCE and s.state("cloth").v[:particles].fill(np.nan)


def in_the_ball(simulation, _):
    """A quarter of the sheet, in the middle of the ball that goes through it."""
    state, free = simulation.state("cloth"), simulation.model("cloth").free_count
    state.x[: free // 4] = np.array([0.05, 0.8, -0.5]) - simulation.origin


def lowered(simulation, _):
    state = simulation.state("cloth")
    hung(simulation, 1.0, 1.0, 1.0)
    state.x[:, 2] -= np.float32(0.3)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda s, _: s.state("cloth").v.fill(np.nan), "not finite"),
        (lambda s, _: s.state("cloth").x.__iadd__(np.float32(50.0)), "out of bounds"),
        (lambda s, _: s.state("cloth").v.__imul__(np.float32(1.02)), "energy grows"),
        (to_one_point, "crushed"),
        (to_one_point, "crushed meanwhile"),
        (lambda s, _: hung(s, 0.2, 0.2, 0.2), "crushed"),
        (lambda s, _: hung(s, 1.0, 1.0, 1.49), "stretched"),
        (lambda s, _: hung(s, 1.49, 1.0, 1.0), "stretched"),
        (lambda s, _: hung(s, 1.0, 1.0, 19.66), "stretched"),
        (one_vertex_away, "stretched"),
        (one_vertex_away, "stretched meanwhile"),
        (lowered, "elsewhere"),
        (shaken, "restless"),
        (dropped, "dropped"),
        (dropped, "dropped meanwhile"),
        (tangled, "tangled"),
        (in_the_ball, "inside"),
        (spoilt(1), "mended"),
        (spoilt(None), "reset"),
    ],
)
def test_what_a_broken_solver_does_is_found(monkeypatch, change, fault):
    """The same scene, and the run without the disturbance is broken in the same way."""
    broken(monkeypatch, change)
    assert fault in judge(scene(calm=4.0), "xpbd").faults


@pytest.mark.parametrize("counter", ["resets", "recovered"])
def test_what_is_put_right_after_nan_has_to_end(monkeypatch, counter):
    """It is no fault where poses are NaN, and one where it goes on half a second later."""
    made = scene(calm=4.0, broken=True)
    begin = 120 + round((made.still_from - made.busy) / made.frame)  # before, poses are refused
    for at, is_there in ((begin + 25, False), (begin + 35, True)):
        with monkeypatch.context() as patch:
            broken(patch, lambda s, n, at=at: n == at and add_one(s, counter))
            faults = judge(made, "xpbd").faults
        assert ({"resets": "reset", "recovered": "mended"}[counter] in faults) == is_there


def add_one(simulation, counter):
    health = simulation.health("cloth")
    setattr(health, counter, getattr(health, counter) + 1)


def test_a_reference_that_is_broken_in_the_same_way_hides_nothing(monkeypatch):
    """As `relaxation` in long steps: it hangs at 1,866 %, disturbed or not, in the same place."""
    broken(monkeypatch, lambda s, _: hung(s, 1.0, 1.0, 19.66))
    outcome = judge(scene(calm=4.0, unique=True), "xpbd")
    assert outcome.figures["away"] < 1e-6
    assert "stretched" in outcome.faults
    assert outcome.figures["strain_largest"] == pytest.approx(18.66, rel=0.01)


def test_what_is_broken_only_undisturbed_is_found(monkeypatch):
    broken(monkeypatch, lambda s, frame: frame <= 750 and hung(s, 1.0, 1.0, 1.49))
    faults = judge(scene(calm=25.0), "xpbd").faults
    assert "stretched undisturbed" in faults
    assert "stretched" not in faults


def test_what_is_broken_only_while_it_moves_is_found(monkeypatch):
    broken(monkeypatch, lambda s, frame: frame == 760 and hung(s, 1.0, 1.0, 1.3))
    faults = judge(scene(calm=25.0), "xpbd").faults
    assert "stretched meanwhile" in faults
    assert "stretched" not in faults


def short_and_dressed():
    """A body that stands still in a T-shirt and a skirt, for a moment."""
    made = CELLS["dressed body: teleport 100 m, keep"].scene()
    stand = made.motion(0.0)
    return replace(
        made, busy=made.frame, calm=2 * made.frame, jump=None, motion=lambda t: stand.copy()
    )


def beside(simulation):
    """The skirt beside the legs."""
    simulation.state("skirt").x[:, 1] += np.float32(0.06)


def fallen(simulation):
    for name in simulation.names:
        simulation.state(name).x[:, 2] -= np.float32(0.3)


def shrunk(simulation):
    """The shirt, to a fifth, within the trunk."""
    x = simulation.state("tshirt").x
    x[:] = x.mean(axis=0) + np.float32(0.2) * (x - x.mean(axis=0))


def swapped(simulation):
    """The skirt over the shirt's hem."""
    shirt, skirt = simulation.state("tshirt").x, simulation.state("skirt").x
    hem = skirt[:, 2] > shirt[:, 2].min()
    middle = skirt[hem, :2].mean(axis=0)
    skirt[hem, :2] = middle + np.float32(1.2) * (skirt[hem, :2] - middle)


@pytest.mark.parametrize(
    ("change", "faults"),
    [
        (lambda _: None, set()),
        (beside, {"pierced", "pierced meanwhile", "inside", "elsewhere"}),
        (fallen, {"elsewhere"}),
        (shrunk, {"crushed", "inside"}),
        (swapped, {"layers"}),
    ],
)
def test_garments_that_are_not_worn_are_found(monkeypatch, change, faults):
    broken(monkeypatch, lambda s, frame: frame > 1 and change(s))  # The first is undisturbed.
    outcome = judge(short_and_dressed(), "xpbd")
    assert faults <= set(outcome.faults), outcome
    assert faults or not set(outcome.faults) - {"restless"}, outcome
    assert outcome.figures["pierced_undisturbed"] == 0
    assert outcome.figures["inside_undisturbed"] < 0.005


def test_what_cannot_be_simulated_is_told_as_refused():
    cloth, colliders, motion = curtain()
    flat = replace(cloth, vertices=np.zeros_like(cloth.vertices))
    outcome = judge(Scene(garments=(flat,), colliders=colliders, motion=motion), "xpbd")
    assert "no area" in outcome.refused
    assert grade(outcome) == "refused"


def test_limits_of_stretch_are_those_of_the_fabric():
    """Weight 0.15 kg/m^2 x 9.81 m/s^2 x 0.6 m, on threads of 1500 N/m at least."""
    limit = limits.at_rest(scene())
    weight = 0.15 * GRAVITY * 0.6 / 1500.0
    assert limit.most == pytest.approx(0.05 + weight)
    assert limit.largest == pytest.approx(0.5 + 4.0 * weight)
    assert limit.crushed == pytest.approx(0.1 + weight)
    # Where the rod stands still, a ball stretches it by its speed over that of sound.
    cloth, colliders, _ = curtain()

    def rolling(t):
        poses = ColliderPoses.identity(3)
        poses.position[2, 1] = 2.0 * t
        return poses

    hit = Scene(garments=(cloth,), colliders=colliders, motion=rolling)
    soft = 4.0 / (1 / 2000.0 + 1 / 1500.0 + 1 / 60.0)
    expected = 2.0 / np.sqrt(soft / 0.15) + 0.15 * GRAVITY * 0.6 / soft
    assert limits.acting(hit) == pytest.approx(expected, rel=1e-6)
    # Fabric that is a hundred times as stiff may stretch less.
    assert limits.at_rest(CELLS["stiffness: 1e+06 N/m"].scene()).most < 0.0501


def test_cloth_through_itself_is_found():
    cloth, _, _ = curtain()
    edges = Edges((replace(cloth, self_collision=0.004),))
    flat = cloth.vertices
    assert edges.crossed({"cloth": flat}) == 0.0
    # The lower half turned up, and through the upper one.
    folded = flat.copy()
    below = folded[:, 2] < -0.3
    folded[below, 2] = -0.6 - folded[below, 2]
    folded[below, 1] = 0.05 * np.sin(40.0 * folded[below, 0] + 0.3)
    assert edges.crossed({"cloth": folded}) > 0.05
    assert Edges((cloth,)).crossed({"cloth": folded}) == 0.0  # It does not ask for it.


def test_what_is_drawn_at_random_depends_on_the_seed_alone():
    drawn = [[name for name, _ in drawn_cells(seed)] for seed in (1, 1, 2)]
    assert len(set(drawn[0])) == COUNT == 20
    assert drawn[0] == drawn[1]
    assert not set(drawn[0]) & set(drawn[2])


def test_cells_without_their_data_are_skipped_with_a_reason(tmp_path, monkeypatch, capsys):
    chosen = ["--only", "cartwheel", "--solver", "xpbd", "--json"]
    monkeypatch.delenv("GARMENT_SIM_DATA", raising=False)
    assert main(["stability", "--out", str(tmp_path / "a"), *chosen]) == 0
    said = capsys.readouterr()
    assert "GARMENT_SIM_DATA is not set" in said.err
    assert json.loads(said.out.splitlines()[-1])["held"] == {"xpbd": 0}
    assert "| skipped |" in said.out
    assert "| 0 of 0 |" in said.out
    monkeypatch.setenv("GARMENT_SIM_DATA", str(tmp_path))
    assert main(["stability", "--out", str(tmp_path / "b"), *chosen]) == 0
    assert "cartwheel.bvh is not there" in capsys.readouterr().err


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
        "| **held** | | 1 of 2 |",
    ]
    refused = Row(extreme="wind", value="3", outcomes={"xpbd": Outcome(refused="too strong")})
    assert held_by([*rows, refused]) == {"xpbd": 1}
    assert table([*rows, refused]).splitlines()[-2:] == [
        "| **held** | | 1 of 3 |",
        "| **refused** | | 1 |",
    ]
    picture(rows, tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes()[:4] == b"\x89PNG"


def test_the_command_lists_runs_and_refuses(tmp_path, capsys):
    assert main(["stability", "--out", str(tmp_path), "--only", "gravity", "--list"]) == 0
    assert "gravity: 100 g" in capsys.readouterr().out
    both = ["--only", "gravity: 1 g", "--only", "wind: 10 m/s", "--list"]
    assert main(["stability", "--out", str(tmp_path), *both]) == 0
    assert capsys.readouterr().out.splitlines() == ["gravity: 1 g", "wind: 10 m/s"]
    chosen = ["--only", "gravity: 1 g", "--solver", "xpbd"]
    assert main(["stability", "--out", str(tmp_path / "map"), *chosen, "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["held"] == {"xpbd": 1}
    made = sorted(path.name for path in (tmp_path / "map").iterdir())
    assert made == ["stability.json", "stability.md", "stability.png"]
    assert main(["stability", "--out", str(tmp_path), "--only", "wind", "--only", "hail"]) == 2
    assert "allowed" in capsys.readouterr().err
