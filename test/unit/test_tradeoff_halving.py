"""Successive halving: what is dropped early, and what never is."""

import json

import numpy as np
import pytest

from garment_sim_ros.cli import tradeoff
from garment_sim_ros.cli.main import main
from garment_sim_ros.tradeoff import reference, runner, scenes
from garment_sim_ros.tradeoff.halving import behind, better_half
from garment_sim_ros.tradeoff.points import grid

SCENE = scenes.Scene(
    text="",
    seconds=2.0,
    still=0.5,
    sheet={"width": 0.4, "height": 0.4, "edge": 0.1, "pins": "top corners"},
)


def row(cost, error, *faults):
    return {"hot_ms": cost, "trajectory_mm": error, "faults": list(faults)}


class TestBetterHalf:
    def test_points_on_the_front_are_1_and_others_as_much_worse_or_dearer(self):
        cost, error = [1.0, 2.0, 4.0, 4.0, 3.0], [8.0, 4.0, 1.0, 8.0, np.nan]
        # (4, 8) has 8 times the error of the third, and 4 times the cost of the first.
        np.testing.assert_allclose(behind(cost, error), [1.0, 1.0, 1.0, 4.0, np.inf])

    def test_equal_points_are_both_as_good_and_nothing_is_nothing(self):
        np.testing.assert_allclose(behind([1.0, 1.0], [2.0, 2.0]), [1.0, 1.0])
        assert len(behind([], [])) == 0

    def test_the_whole_front_is_kept_even_if_it_is_more_than_half(self):
        rows = [row(1, 8), row(2, 4), row(4, 2), row(8, 1), row(9, 9), row(8, 8)]
        assert better_half(rows, "hot_ms", "trajectory_mm") == [0, 1, 2, 3]

    def test_what_is_hardly_behind_the_front_is_kept_too(self):
        rows = [row(1, 8), row(8, 1), row(8.8, 1.3), row(9, 9), row(10, 10)]
        assert better_half(rows, "hot_ms", "trajectory_mm") == [0, 1, 2]

    def test_what_fails_is_dropped_however_fast(self):
        rows = [row(0.1, 0.1, "pierced"), row(1, 1), row(2, 2), row(3, 3), {"faults": ["refused"]}]
        assert better_half(rows, "hot_ms", "trajectory_mm") == [1, 2, 3]


@pytest.fixture(scope="module")
def staged():
    return scenes.staged(SCENE)


@pytest.fixture(scope="module")
def against(staged):
    return reference.reference(staged, most=120)


class TestGlance:
    def test_its_error_is_that_of_the_segments_it_runs(self, staged, against):
        (point,) = grid(["plain"], ["xpbd"], [4], [1])
        whole = runner.measure(staged, point, against, repeats=1)
        assert runner.glance(staged, point, against, 1)["trajectory_mm"] == pytest.approx(
            whole["trajectory_mm"], rel=1e-3
        )
        ran = []
        player = runner.Player

        class Watched(player):
            def play(self, first, last, **options):
                ran.append((first, last))
                return super().play(first, last, **options)

        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(runner, "Player", Watched)
            runner.glance(staged, point, against, 2)
        assert ran[0] == (0, 60)
        assert ran[1:] == [of for of in against.segments if of[0] < 60]
        assert ran[-1][1] >= 60

    @pytest.mark.parametrize("fault", ["not finite", "pierced"])
    def test_faults_are_seen(self, staged, against, monkeypatch, fault):
        (point,) = grid(["plain"], ["xpbd"], [4], [1])
        if fault == "pierced":
            monkeypatch.setattr(runner, "pierced", lambda *_: 0.1)
        else:
            monkeypatch.setattr(runner, "is_finite", lambda _: False)
        assert runner.glance(staged, point, against, 4)["faults"] == [fault]


def test_the_command_measures_what_is_left_and_tells_what_was_dropped(
    tmp_path, monkeypatch, capsys
):
    """Error is 16 over sub-steps; `implicit` has four times the error at four times the cost."""
    looked = []

    def glanced(scene, point, seconds, share, file):
        looked.append((share, point.name))
        dear = 4.0 if point.solver == "implicit" else 1.0
        cost = point.sub_steps * dear
        error = (
            dear * 16.0 / point.sub_steps * (1.0 if share == 4 or point.sub_steps != 5 else 9.0)
        )
        asked = {"scene": scene, "colliders": point.kind, "setting": point.name}
        return asked | row(cost, error, *(["pierced"] if point.sub_steps == 3 else []))

    def measured(scene, point, seconds, repeats, file):
        asked = {"solver": point.solver, "sub_steps": point.sub_steps, "passes": point.passes}
        return glanced(scene, point, seconds, 1, file) | asked | {"membrane": point.membrane}

    told = {"doubt_mm": 0.01, "converged": True}
    monkeypatch.setattr(tradeoff, "referenced", lambda *asked: told)
    monkeypatch.setattr(tradeoff, "glanced", glanced)
    monkeypatch.setattr(tradeoff, "measured", measured)
    words = ["--json", "tradeoff", "hung", "--out", str(tmp_path), "--halving", "--passes", "1"]
    words += ["--solver", "xpbd", "--solver", "implicit", "--sub-steps", "2", "3", "4", "5"]
    assert main(words) == 0
    found = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert [r["setting"] for r in found["rows"]] == ["xpbd 2x1", "xpbd 4x1"]
    assert found["front"] == ["hung, plain: xpbd 2x1", "hung, plain: xpbd 4x1"]
    first = {name for share, name in looked if share == 4}
    second = [name for share, name in looked if share == 2]
    assert len(first) == 8
    assert second == ["xpbd 2x1", "xpbd 4x1", "xpbd 5x1", "implicit 2x1"]
    assert len(found["dropped"]) == 6
    assert {r["setting"] for r in found["dropped"]} == first - {"xpbd 2x1", "xpbd 4x1"}
