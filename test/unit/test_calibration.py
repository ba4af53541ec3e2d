"""`tradeoff --calibrate`: what the levels of `auto` cost here is measured, kept and used."""

import json
from functools import partial

import numpy as np
import pytest

from garment_sim_ros.cli import calibrate as command
from garment_sim_ros.cli.main import main
from garment_sim_ros.sim.auto.levels import LEVELS, START
from garment_sim_ros.sim.auto.own_front import own_levels
from garment_sim_ros.tradeoff.calibration import calibrate


@pytest.fixture(autouse=True)
def _short_and_into_an_empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(command, "calibrate", partial(calibrate, seconds=0.5))


def test_it_is_kept_and_used_from_then_on(capsys):
    assert own_levels().cost is None
    assert main(["tradeoff", "--calibrate", "--json"]) == 0
    said = capsys.readouterr().out.splitlines()
    rows = json.loads(said[-1])["levels"]
    assert [row["level"] for row in rows] == [level.name for level in LEVELS]
    assert [row["searches"] for row in rows] == [
        level.sub_steps // level.search_every for level in LEVELS
    ]
    strain = {row["level"]: row["strain_p95"] for row in rows}
    assert 0.0 < strain["accurate"] < 0.7 * strain["fast"] < 0.1
    own = own_levels()
    assert own.told == "as measured on this machine"
    assert own.cost == pytest.approx([row["ms"] for row in rows], abs=6e-4)
    taken = {row["level"]: row["of_balanced"] for row in rows if row["of_balanced"] is not None}
    assert taken == pytest.approx({level.name: level.cost for level in own.levels}, abs=6e-4)
    assert taken[START] == 1.0
    assert next(iter(taken)) == "fast"


def test_where_it_cannot_be_kept_the_command_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        command, "calibrate", lambda progress: (np.ones(len(LEVELS)), np.ones(len(LEVELS)))
    )
    monkeypatch.setattr(command, "keep_front", lambda cost: False)
    assert main(["tradeoff", "--calibrate"]) == 2
    assert "error: fronts: the user's cache folder cannot be written" in capsys.readouterr().err
