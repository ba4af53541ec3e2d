"""Prices of features: one thing is switched, turns are paired, the list says what was measured."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from garment_sim_ros.cli.main import main
from garment_sim_ros.params import Environment, declarations
from garment_sim_ros.tradeoff import prices, scenes
from garment_sim_ros.tradeoff.features import FEATURES, Case
from garment_sim_ros.tradeoff.metrics import crossed_own
from garment_sim_ros.tradeoff.playing import Player
from garment_sim_ros.tradeoff.price_list import COLUMNS, line, markdown
from garment_sim_ros.tradeoff.prices import price, priced

SOFT = {"stretch_stiffness_warp": 2.0, "stretch_stiffness_weft": 2.0, "shear_stiffness": 0.5}
SHEET = {"width": 0.4, "height": 0.4, "edge": 0.1, "pins": "top corners"}


@pytest.fixture
def hung(monkeypatch):
    """A sheet so soft that it gets twice as long by its weight, 1.5 s long."""
    scene = scenes.Scene(text="", seconds=1.5, still=0.5, sheet=SHEET | {"material": SOFT})
    monkeypatch.setitem(scenes.SCENES, "hung", scene)
    scenes.staged_scene.cache_clear()
    yield Case.of("hung", "balanced", 0.0)
    scenes.staged_scene.cache_clear()


@pytest.fixture(scope="module")
def walk():
    return Case.of("walk", "balanced", 0.1)


def differences(a, b):
    """Names of all that differs between two cases."""
    found = set()
    for one, other in zip(a.staged.garments, b.staged.garments):
        found |= {
            f"garment {name}"
            for name in vars(one)
            if name != "material" and repr(getattr(one, name)) != repr(getattr(other, name))
        }
        found |= {
            f"material {name}"
            for name in vars(one.material)
            if getattr(one.material, name) != getattr(other.material, name)
        }
    for name in declarations(Environment):
        if getattr(a.parameters.environment, name) != getattr(b.parameters.environment, name):
            found.add(name)
    for name in declarations(type(a.parameters.settings)):
        if getattr(a.parameters.settings, name) != getattr(b.parameters.settings, name):
            found.add(name)
    if a.numerics.detail != b.numerics.detail:
        found.add("detail")
    return found | ({"kind"} if a.point.kind != b.point.kind else set())


class TestFeatures:
    @pytest.mark.parametrize(
        ("name", "now", "changed"),
        [
            ("self_collision", True, {"garment self_collision"}),
            ("layers", False, {"garment layer"}),
            ("strain_limit", False, {"strain_limit"}),
            ("coarse", True, {"coarse"}),
            ("detail", True, {"detail"}),
            ("triangles", True, {"membrane"}),
            ("max_distance", False, {"garment skin_limits"}),
            ("backstop", True, {"garment skin_limits"}),
            ("tethers", True, {"garment tethers"}),
            ("friction", False, {"material friction"}),
            ("bending", False, {"material bending_stiffness"}),
            ("wind", True, {"wind", "wind_drag", "wind_lift"}),
            ("gusts", True, {"gust", "wind_drag", "wind_lift"}),
            ("root_motion", True, {"root_linear_inertia", "root_angular_inertia"}),
            ("guard", False, set()),
        ],
    )
    def test_one_thing_is_switched_and_nothing_else(self, walk, name, now, changed):
        case, is_on = FEATURES[name].switch(walk)
        assert (is_on, differences(walk, case)) == (now, changed)

    def test_what_was_switched_on_is_switched_off_again(self, walk):
        for name in (
            "self_collision",
            "strain_limit",
            "detail",
            "wind",
            "root_motion",
            "triangles",
        ):
            case, was_on = FEATURES[name].switch(walk)
            back, is_on = FEATURES[name].switch(case)
            assert is_on is not was_on
            assert not differences(walk, back) - {"wind", "wind_drag", "wind_lift"}

    @pytest.mark.parametrize("name", ["extras", "elastic", "hulls"])
    def test_what_the_base_cannot_have_is_nothing_to_switch(self, walk, name):
        assert FEATURES[name].switch(walk) is None

    @pytest.mark.parametrize("name", ["layers", "guard", "backstop", "sdf"])
    def test_a_sheet_without_a_body_has_no_more(self, hung, name):
        assert FEATURES[name].switch(hung) is None

    def test_without_the_guard_no_core_is_kept_out(self, walk):
        case, _ = FEATURES["guard"].switch(walk)
        for of, there in ((walk, True), (case, False)):
            worn = [view.worn for view in of.player().simulation]
            assert all(bool(len(w.workspace.guard.shape)) is there for w in worn)

    def test_other_colliders_are_those_of_the_walk(self, walk):
        case, is_on = FEATURES["capsules"].switch(walk)
        assert is_on
        assert {c.kind for c in case.staged.colliders.colliders} == {"capsule", "frame"}
        assert case.staged.frames == walk.staged.frames

    def test_the_simulation_runs_what_the_case_says(self, hung):
        case, _ = FEATURES["strain_limit"].switch(hung)
        assert case.player().simulation.parameters.settings.strain_limit == 0.0
        assert hung.player().simulation.parameters.settings.strain_limit == 0.3
        assert case.point.name == "balanced strain_limit=0.0"


class TestPrice:
    def test_tethers_remove_strain(self, hung):
        """The sheet's own weight makes it twice as long; they let it be 1.02 times as long."""
        row = priced("hung", "balanced", "tethers", 0.0, 1)
        assert row["in_preset"] == "off"
        assert row["strain_p95_off"] > 0.8
        assert row["strain_p95_on"] < 0.3
        assert row["moved_mm"] > 100.0

    def test_what_differs_in_nothing_does_nothing(self, hung):
        row = price(hung, hung, 2)
        assert row["moved_mm"] == 0.0
        assert row["turns"] == 6
        for name, value in row.items():
            if name.endswith("_off"):
                assert row[name.removesuffix("_off") + "_on"] == value

    def test_turns_are_taken_alternately_and_paired_by_frame(self, hung, monkeypatch):
        """Frame n takes 1 + n / 1000 s with the feature, 0.6 s less without it."""
        order, play = [], Player.play
        without, _ = FEATURES["strain_limit"].switch(hung)

        def timed(self, first, last, **options):
            played = play(self, first, last, **options)
            is_on = self.simulation.parameters.settings.strain_limit > 0.0
            order.append((first, is_on))
            played.processor = [(1.0 if is_on else 0.4) + 0.001 * n for n in range(first, last)]
            return played

        monkeypatch.setattr(Player, "play", timed)
        row = price(without, hung, 2)
        assert row["cost_ms"] == pytest.approx(600.0)
        assert row["cost_ms_p10"] == row["cost_ms_p90"] == row["cost_ms"]
        assert row["off_ms"] == pytest.approx(1e3 * (0.4 + 0.001 * 44.5), rel=1e-3)
        off_first = [(0, False), (0, True), (30, True), (30, False), (60, False), (60, True)]
        on_first = [(first, not is_on) for first, is_on in off_first]
        assert order[2:] == off_first + on_first

    def test_one_disturbed_turn_of_three_moves_the_spread_only(self):
        off, on = [[1.0, 1.0]] * 3, [[1.5, 1.5], [1.5, 1.5], [9.0, 9.0]]
        found = prices._cost(off, on)
        assert (found["cost_ms"], found["cost_share"]) == (500.0, 0.5)
        assert found["cost_ms_p10"] == 500.0
        assert found["cost_ms_p90"] == pytest.approx(500.0 + 0.8 * 7500.0)

    def test_what_is_not_finite_is_said_and_has_no_figures(self, hung, monkeypatch):
        play = Player.play
        without, _ = FEATURES["strain_limit"].switch(hung)

        def broken(self, first, last, **options):
            played = play(self, first, last, **options)
            if self.simulation.parameters.settings.strain_limit == 0.0:
                played.paths["sheet"][:] = np.nan
            return played

        monkeypatch.setattr(Player, "play", broken)
        row = price(without, hung, 1)
        assert not row["finite_off"]
        assert row["finite_on"]
        assert not {"strain_max_off", "moved_mm"} & set(row)
        assert "not finite without it" in line({"feature": "strain_limit", **row})
        json.dumps(row, allow_nan=False)

    def test_what_cannot_be_simulated_says_why(self):
        row = priced("walk", "balanced", "mesh", 0.1, 1)
        assert "relaxation" in row["refused"]
        assert "mesh: " in line(row)
        assert markdown([row]).count("\n") == 2

    def test_a_sheet_folded_through_itself_is_crossed(self):
        sheet = {"width": 0.4, "height": 0.4, "edge": 0.05}
        staged = scenes.staged(scenes.Scene(text="", seconds=0.1, sheet=sheet))
        x = staged.garments[0].vertices
        flat = {"sheet": np.repeat(x[None], staged.frames + 1, axis=0)}
        assert crossed_own(staged, flat) == 0.0
        # The right half is turned up about the y axis and laid slanting through the left half.
        folded = x.copy()
        right = x[:, 0] > 1e-9
        folded[right, 0] = -0.7 * x[right, 0]
        folded[right, 2] = 0.7 * x[right, 0] - 0.071
        through = {"sheet": np.repeat(folded[None], staged.frames + 1, axis=0)}
        assert crossed_own(staged, through) > 0.02


ROW = {
    "scene": "walk",
    "preset": "balanced",
    "feature": "self_collision",
    "in_preset": "off",
    "off_ms": 6.7,
    "on_ms": 7.5,
    "cost_ms": 0.8,
    "cost_ms_p10": 0.71,
    "cost_ms_p90": 0.92,
    "cost_share": 0.12,
    "turns": 12,
    "crossed_own_off": 0.041,
    "crossed_own_on": 0.009,
    "finite_off": True,
    "finite_on": True,
    "dropped_off": 0,
    "dropped_on": 0,
    "moved_mm": 3.21,
}


class TestList:
    def test_a_line_says_what_it_costs_and_removes(self):
        said = "self_collision: +0.80 ms (+12 %), crossed_own 4.1 -> 0.9 %"
        assert line(ROW) == said
        assert "contacts dropped with it" in line(ROW | {"dropped_on": 2})

    def test_the_table_has_the_spread_and_the_base(self):
        row = markdown([ROW]).splitlines()[-1]
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert cells[3:] == [
            *("off", "+0.80", "+0.71 to +0.92", "+12 %", "crossed_own 4.1 -> 0.9 %", "3.2")
        ]

    def test_every_figure_that_a_feature_is_for_is_told(self):
        for feature in FEATURES.values():
            assert {f"{name}_on" for name in feature.figures} <= set(COLUMNS)


def test_the_command_tells_prices_and_goes_on_where_it_was(hung, tmp_path, monkeypatch, capsys):
    words = ["--json", "tradeoff", "hung", "--prices", "strain_limit", "layers"]
    words += ["--out", str(tmp_path), "--repeats", "1"]
    assert main(words) == 0
    out = capsys.readouterr().out.splitlines()
    told = json.loads(out[-1])
    assert [row["feature"] for row in told["prices"]] == ["strain_limit", "layers"]
    assert {"numba", "processor", "threads"} <= set(told["machine"])
    assert told["prices"][0]["in_preset"] == "on"
    assert told["prices"][1]["refused"] == "nothing to switch"
    with (tmp_path / "prices.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["strain_max_on"]) == told["prices"][0]["strain_max_on"]
    assert json.loads((tmp_path / "prices.json").read_text())["prices"] == told["prices"]
    assert "`strain_limit`" in (tmp_path / "prices.md").read_text()

    calls = []
    monkeypatch.setattr("garment_sim_ros.cli.prices.priced", lambda *a: calls.append(a))
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["prices"] == told["prices"]
    assert calls == []


def test_the_list_in_print_has_the_base_and_each_feature(hung, tmp_path, capsys):
    assert main(["tradeoff", "hung", "--prices", "strain_limit", "--out", str(tmp_path)]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("hung, balanced: ")
    assert second.startswith("  strain_limit: ")
    assert ", strain_max " in second


def test_the_document_has_all_features():
    text = (Path(__file__).parents[2] / "docs" / "tradeoff.md").read_text()
    for name, feature in FEATURES.items():
        assert f"| `{name}` | {feature.text} |" in text


def test_an_unknown_feature_is_refused(tmp_path, capsys):
    assert main(["tradeoff", "hung", "--prices", "nonesuch", "--out", str(tmp_path)]) == 2
    assert "self_collision" in capsys.readouterr().err


def test_a_changed_case_leaves_the_base_alone(hung):
    before = replace(hung)
    FEATURES["self_collision"].switch(hung)
    FEATURES["wind"].switch(hung)
    assert not differences(before, hung)
