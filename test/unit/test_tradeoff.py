"""Speed against accuracy: metrics of known answer, faults that must be found, front, command."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from garment_sim_ros.cli.main import main
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.tradeoff import metrics, plots, runner, scenes
from garment_sim_ros.tradeoff.front import front
from garment_sim_ros.tradeoff.playing import Player
from garment_sim_ros.tradeoff.points import GRID, Point, grid
from garment_sim_ros.tradeoff.reference import Reference, reference
from garment_sim_ros.tradeoff.table import Kept, across_colliders, on_fronts

SIDE, EDGE = 0.4, 0.1


def small(shapes=(), **asked):
    """A sheet of 25 vertices, 0.5 s long."""
    sheet = {"width": SIDE, "height": SIDE, "edge": EDGE, "at": (0.0, 0.0, 0.12)}
    sheet |= {"material": {"damping": 4.0}, **asked}
    return scenes.staged(
        scenes.Scene(text="", seconds=0.6, still=4.0, sheet=sheet, shapes=tuple(shapes))
    )


BALL = (("sphere", {"radius": 0.1}),)
XPBD = Point(kind="plain", solver="xpbd", sub_steps=8, passes=1)


@pytest.fixture(scope="module")
def hung():
    staged = small(pins="top corners")
    return staged, reference(staged)


def still_paths(staged, frames=None):
    """Every vertex where it is at rest, in every frame."""
    count = (frames or staged.frames) + 1
    return {g.name: np.repeat(g.vertices[None], count, axis=0) for g in staged.garments}


class TestMetrics:
    def test_a_path_moved_as_a_whole_is_off_by_the_way(self):
        x = {"a": np.random.default_rng(1).normal(size=(4, 7, 3))}
        moved = {"a": x["a"] + np.array([0.0, 0.003, 0.004])}
        assert metrics.distance_mm(x, moved) == pytest.approx(5.0)
        assert metrics.distance_mm(x, x) == 0.0

    def test_one_vertex_of_four_off_counts_by_its_square(self):
        x = {"a": np.zeros((1, 4, 3))}
        y = {"a": x["a"].copy()}
        y["a"][0, 2, 0] = 0.01
        assert metrics.distance_mm(x, y) == pytest.approx(10.0 / np.sqrt(4.0))
        y["a"][0, 0] = np.nan
        assert np.isnan(metrics.distance_mm(x, y))
        assert not metrics.is_finite(y)

    def test_steady_motion_has_its_speed(self):
        frames = np.arange(15)[:, None, None]
        path = {"a": np.zeros((15, 5, 3)) + frames * np.array([0.0, 0.0, 0.001])}
        assert metrics.rest_speed_mm_s(path, 0.1) == pytest.approx(10.0)
        path["a"][:] = path["a"][0]
        assert metrics.rest_speed_mm_s(path, 0.1) == 0.0

    def test_only_the_last_frames_are_asked_for_rest(self):
        path = {"a": np.zeros((40, 5, 3))}
        path["a"][5] = 1.0
        assert metrics.rest_speed_mm_s(path, 0.1) == 0.0

    def test_a_sheet_above_a_ball_has_its_gap_and_nothing_inside(self):
        staged = small(BALL)
        figures = metrics.worn_figures(staged, still_paths(staged))
        x = staged.garments[0].vertices
        gap = np.median(np.linalg.norm(x, axis=1) - 0.1)
        assert figures["gap_mm"] == pytest.approx(1e3 * gap, abs=1e-3)
        assert figures["inside"] == figures["penetration_mm"] == figures["pierced"] == 0.0
        assert abs(figures["strain_max"]) < 1e-9

    def test_a_sheet_through_a_ball_is_as_deep_as_it_is(self):
        staged = small(BALL)
        paths = still_paths(staged)
        paths["sheet"] = paths["sheet"] - np.array([0.0, 0.0, 0.12])
        figures = metrics.worn_figures(staged, paths)
        assert figures["penetration_mm"] == pytest.approx(100.0, abs=1e-3)
        # Its share of the disk of radius 0.098 m, by few samples.
        assert figures["inside"] == pytest.approx(np.pi * 0.098**2 / SIDE**2, rel=0.35)

    def test_a_sheet_pulled_by_a_tenth_is_stretched_by_it(self):
        staged = small()
        paths = still_paths(staged)
        paths["sheet"][5:8, :, :2] *= 1.1
        figures = metrics.worn_figures(staged, paths)
        assert figures["strain_p95"] == pytest.approx(0.1)
        assert figures["strain_max"] == pytest.approx(0.1)


class TestReference:
    def test_it_says_that_it_converged_and_more_sub_steps_change_little(self, hung):
        staged, made = hung
        assert made.converged
        assert max(made.changes) < 0.1
        assert max(made.chaos) < 0.1
        assert made.rest_moved < 0.1
        finer = Player(staged, replace(XPBD, sub_steps=480).arguments(1 / 60))
        finer.put_on(settle=False)
        finer.begin(made.starts[0])
        path = finer.play(*made.segments[0]).paths
        whole = {n: x[: len(path[n])] for n, x in made.paths.items()}
        assert metrics.distance_mm(path, whole) < 0.1

    def test_segments_are_half_a_second_at_most_and_meet(self, hung):
        staged, made = hung
        assert made.segments == [(0, 30), (30, 36)]
        assert [s.frame for s in made.starts] == [0, 30]
        np.testing.assert_array_equal(made.starts[1].x["sheet"], made.paths["sheet"][30])
        assert len(made.paths["sheet"]) == staged.frames + 1

    def test_too_few_sub_steps_are_not_called_converged(self):
        made = reference(small(pins="top corners"), most=60)
        assert not made.converged
        told = made.told()
        assert (told["converged"], told["doubt_mm"], told["over"]) == (False, None, 36)
        json.dumps(told, allow_nan=False)

    def test_what_is_chaotic_alone_is_not_called_converged(self, hung):
        made = replace(hung[1], changes=(0.01, 0.02), chaos=(0.0, 0.2))
        assert not made.converged
        assert made.doubt == pytest.approx(np.sqrt((30 * 0.01**2 + 6 * 0.2**2) / 36))
        assert made.told()["over"] == 1
        assert replace(made, chaos=(0.0, np.nan)).over == 1

    def test_segments_are_short_where_the_sheet_may_fall_to_any_side(self):
        """It stands on its edge, upright on the top of a ball."""
        staged = small(BALL, upright=True, at=(0.0, 0.0, 0.1 + 0.5 * SIDE + 0.003))
        made = reference(staged, most=240)
        lengths = [last - first for first, last in made.segments]
        assert min(lengths) < 10
        assert sum(lengths) == staged.frames
        for start, (first, _) in zip(made.starts, made.segments):
            np.testing.assert_array_equal(start.x["sheet"], made.paths["sheet"][first])

    def test_nothing_rests_in_gusts(self, tmp_path):
        calm = small(pins="top corners")
        gusts = {"gust": 1.0, "wind_drag": 1.2, "wind": (2.0, 0.0, 0.0)}
        staged = replace(calm, scene=replace(calm.scene, environment=gusts))
        made = reference(staged, most=120)
        assert made.rest == {}
        made.save(tmp_path / "r.npz")
        assert Reference.load(tmp_path / "r.npz").told() == made.told()
        json.dumps(made.told(), allow_nan=False)
        row = runner.measure(staged, XPBD, made, repeats=1)
        assert row["faults"] == []
        assert row["static_mm"] is None
        assert "rest_speed_mm_s" not in row
        assert row["trajectory_mm"] > 0.0

    def test_a_file_gives_it_back_and_a_damaged_one_nothing(self, hung, tmp_path):
        made = hung[1]
        made.save(tmp_path / "r.npz")
        back = Reference.load(tmp_path / "r.npz")
        assert back.told() == made.told()
        np.testing.assert_array_equal(back.paths["sheet"], made.paths["sheet"])
        np.testing.assert_array_equal(back.starts[1].v["sheet"], made.starts[1].v["sheet"])
        whole = (tmp_path / "r.npz").read_bytes()
        (tmp_path / "r.npz").write_bytes(whole[: len(whole) // 2])
        assert Reference.load(tmp_path / "r.npz") is None
        assert Reference.load(tmp_path / "none.npz") is None


class TestRunner:
    def test_more_sub_steps_are_nearer_to_the_reference(self, hung):
        errors = []
        for n in (4, 16, 64):
            row = runner.measure(*[hung[0], replace(XPBD, sub_steps=n), hung[1]], repeats=1)
            assert row["faults"] == []
            errors.append(row["trajectory_mm"])
        assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]

    def test_the_reference_itself_has_no_error(self, hung):
        count = hung[1].sub_steps[0]
        row = runner.measure(hung[0], replace(XPBD, sub_steps=count), hung[1], repeats=1)
        assert row["trajectory_mm"] < 0.1
        assert row["static_mm"] < 0.1

    @pytest.mark.parametrize(
        ("change", "fault"),
        [
            (lambda s, n: s.state("sheet").x.fill(np.nan), "not finite"),
            (
                lambda s, n: s.state("sheet").x.__iadd__(np.float32(5e-4 * (-1) ** n)),
                "not at rest",
            ),
            (lambda s, n: setattr(s.health("sheet"), "let_go", 3), "dropped contacts"),
            (lambda s, n: setattr(s.health("sheet"), "recovered", n), "put right"),
        ],
    )
    def test_what_a_broken_solver_does_is_a_failure(self, hung, monkeypatch, change, fault):
        advance, frames = Simulation.advance, []

        def wrong(self, *args):
            advance(self, *args)
            frames.append(args)
            change(self, len(frames))

        monkeypatch.setattr(Simulation, "advance", wrong)
        row = runner.measure(*[hung[0], XPBD, hung[1]], repeats=1)
        assert fault in row["faults"]

    def test_pierced_is_a_failure_even_where_the_reference_is(self, hung, monkeypatch):
        monkeypatch.setattr(metrics, "pierced", lambda staged, paths: 0.25)
        against = replace(hung[1], pierced=0.5)
        assert "pierced" in runner.measure(hung[0], XPBD, against, repeats=1)["faults"]

    def test_what_cannot_be_simulated_says_so(self, hung, monkeypatch, tmp_path):
        hung[1].save(tmp_path / "r.npz")
        monkeypatch.setattr(runner, "staged_scene", lambda *_: hung[0])
        bad = replace(XPBD, sub_steps=1, solver="nonesuch")
        row = runner.measured("hung", bad, 0.0, 1, tmp_path / "r.npz")
        assert row["faults"] == ["refused"]
        assert "nonesuch" in row["refused"]
        json.dumps(row, allow_nan=False)


class TestScenes:
    def test_real_ones_say_why_they_are_absent(self, monkeypatch, tmp_path):
        monkeypatch.delenv(scenes.VARIABLE, raising=False)
        assert scenes.SCENES["cartwheel"].absent == f"{scenes.VARIABLE} is not set"
        assert scenes.SCENES["walk"].absent == ""
        monkeypatch.setenv(scenes.VARIABLE, str(tmp_path))
        assert "mh_female_young.glb is not there" in scenes.SCENES["cartwheel"].absent
        assert "rokoko_jesse_dance.bvh is not there" in scenes.SCENES["dance"].absent
        assert scenes.SCENES["trousers"].files[-1] == ("garments", "trousers_female.obj")

    def test_the_papers_steps_are_the_frames(self):
        for name, step in (("walk_33ms", 0.033), ("dance", 0.033), ("dance_330ms", 0.33)):
            assert scenes.SCENES[name].frame == step

    def test_settings_are_as_the_grid_says(self):
        points = list(grid(["hulls"], ["xpbd", "relaxation"]))
        assert len(points) == len(GRID["xpbd"]) + len(GRID["relaxation"])
        asked = Point(kind="hulls", solver="relaxation", sub_steps=3, passes=10).arguments(0.03)
        assert asked["solver_step"] == pytest.approx(0.01)
        assert asked["settings"].sweeps == 10
        some = [(p.sub_steps, p.passes) for p in grid(["sdf"], ["implicit"], [2, 5], [7])]
        assert some == [(2, 7), (5, 7)]


class TestFront:
    def test_dominated_points_are_off_it(self):
        cost, error = [3.0, 1.0, 2.0, 2.0, 5.0], [1.0, 9.0, 4.0, 3.0, 2.0]
        assert front(cost, error) == [1, 3, 0]

    def test_points_that_are_not_finite_are_off_it(self):
        assert front([np.nan, 1.0, np.inf], [0.0, 2.0, 0.0]) == [1]
        assert front([], []) == []

    def test_a_failure_is_never_a_fast_point(self):
        row = {"scene": "a", "colliders": "b", "hot_ms": 2.0, "trajectory_mm": 2.0, "faults": []}
        fast = row | {"hot_ms": 1.0, "trajectory_mm": 1.0, "faults": ["pierced"]}
        none = row | {"hot_ms": 0.5, "trajectory_mm": None}
        assert on_fronts([fast, none, row], "hot_ms", "trajectory_mm") == [row]

    def test_across_colliders_there_is_one_front_to_a_scene(self):
        row = {"scene": "a", "colliders": "hulls", "hot_ms": 2.0, "gap_mm": 20.0, "faults": []}
        cheap = row | {"colliders": "capsules", "hot_ms": 1.0, "gap_mm": 25.0}
        beaten = row | {"colliders": "ellipsoids", "hot_ms": 3.0, "gap_mm": 30.0}
        pierced = row | {"colliders": "sdf", "gap_mm": 1.0, "faults": ["pierced"]}
        alone = row | {"scene": "b", "hot_ms": 0.1}
        deep = row | {"colliders": "spheres", "gap_mm": 2.0, "inside": 0.1}
        through = row | {"colliders": "none", "gap_mm": -4.0}
        rows = [row, beaten, cheap, pierced, alone, deep, through]
        assert across_colliders(rows, "hot_ms", "gap_mm") == [cheap, row]
        assert on_fronts(rows[:5], "hot_ms", "gap_mm") == [row, beaten, cheap, alone]


def test_a_line_that_was_not_finished_counts_for_nothing(tmp_path):
    kept = Kept(tmp_path / "rows.jsonl")
    kept.put("a", {"n": 1})
    with (tmp_path / "rows.jsonl").open("a") as out:
        out.write('{"key": "b", "ro')
    again = Kept(tmp_path / "rows.jsonl")
    assert (again.get("a"), again.get("b")) == ({"n": 1}, None)
    again.put("b", {"n": 2})
    assert Kept(tmp_path / "rows.jsonl").get("b") == {"n": 2}


def test_pictures_show_every_point_and_the_front(tmp_path):
    rows = [
        {
            **{"solver": s, "sub_steps": n, "passes": 1, "faults": f, "colliders": "plain"},
            **{"hot_ms": h, "trajectory_mm": e},
        }
        for s, n, f, h, e in (
            ("xpbd", 8, [], 1.0, 9.0),
            ("xpbd", 16, [], 2.0, 3.0),
            ("implicit", 2, ["pierced"], 0.5, 1.0),
        )
    ]
    plots.draw(rows, "hung_plain", tmp_path, cost="hot_ms", error="trajectory_mm")
    text = (tmp_path / "hung_plain.svg").read_text()
    assert text.count("<polygon") == len(rows) + 2  # and the legend's
    assert ">8x1<" in text
    assert ">16x1<" in text
    assert ">2x1<" not in text
    rows[1]["colliders"] = "hulls"
    plots.draw(rows, "both", tmp_path, cost="hot_ms", error="trajectory_mm")
    text = (tmp_path / "both.svg").read_text()
    assert ">16x1, hulls<" in text
    assert ">8x1, plain<" in text
    assert Image.open(tmp_path / "hung_plain.png").info["dpi"][0] == pytest.approx(300, abs=1)


def test_the_command_writes_all_and_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    tiny = scenes.Scene(
        text="",
        seconds=0.2,
        still=0.5,
        sheet={"width": SIDE, "height": SIDE, "edge": EDGE, "pins": "top corners"},
    )
    monkeypatch.setitem(scenes.SCENES, "hung", tiny)
    monkeypatch.delenv(scenes.VARIABLE, raising=False)
    scenes.staged_scene.cache_clear()
    words = ["--json", "tradeoff", "hung", "cartwheel", "--out", str(tmp_path), "--solver", "xpbd"]
    words += ["--sub-steps", "4", "16", "--repeats", "1"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert told["skipped"] == {"cartwheel": f"{scenes.VARIABLE} is not set"}
    assert [row["setting"] for row in told["rows"]] == ["xpbd 4x1", "xpbd 16x1"]
    assert {"numba", "processor", "threads", "jobs"} <= set(told["machine"])
    assert told["references"]["hung, plain"]["converged"]
    with (tmp_path / "tradeoff.csv").open() as file:
        assert [row["setting"] for row in csv.DictReader(file)] == ["xpbd 4x1", "xpbd 16x1"]
    for name in ("tradeoff.json", "tradeoff.md", "hung_plain.png", "hung_plain.svg"):
        assert (tmp_path / name).stat().st_size > 0

    calls = []
    monkeypatch.setattr("garment_sim_ros.cli.tradeoff.measured", lambda *a: calls.append(a))
    monkeypatch.setattr("garment_sim_ros.cli.tradeoff.referenced", lambda *a: calls.append(a))
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["rows"] == told["rows"]
    assert calls == []
    scenes.staged_scene.cache_clear()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nonesuch", "--out", "x"], "nonesuch"),
        (["--out", "x"], "none given"),
        (["hung"], "--out"),
        (["hung", "--out", "x", "--jobs", "0"], "--jobs"),
        (["hung", "--out", "x", "--vary", "cloth_node.rate=30"], "cloth_node.search_every"),
        (["hung", "--out", "x", "--preset", "auto"], "--preset"),
    ],
)
def test_what_is_wrong_is_told(words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["tradeoff", *words]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
