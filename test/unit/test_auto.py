"""Preset `auto`: what it sets, who may use it, and the front that a machine keeps."""

import os
import time

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros import disk_cache
from garment_sim_ros.params import XpbdSettings
from garment_sim_ros.presets import preset_values
from garment_sim_ros.sim.auto import own_front
from garment_sim_ros.sim.auto.levels import FRAME, LEVELS, MOVED, START
from garment_sim_ros.sim.auto.pacer import Pacer

BALL = gs.ColliderSet.of(gs.sphere(0.1))
AT_FIRST = [level.name for level in LEVELS].index(START)
COST = np.array([2.0, 3.0, 3.1, 3.3, 4.0, 5.0, 5.5, 6.5, 8.0])


@pytest.fixture(autouse=True)
def _empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def simulation(**options):
    return gs.Simulation(gs.Garment.sheet(0.4, 0.4, edge=0.1), BALL, **options)


def test_it_begins_as_balanced_does():
    auto, balanced = (preset_values(name, "cloth_node") for name in ("auto", "balanced"))
    assert {name: auto[name] for name in balanced} == balanced
    assert preset_values("auto", "collider_node") == preset_values("balanced", "collider_node")
    start = LEVELS[AT_FIRST]
    assert start.settings(XpbdSettings()).sub_step == pytest.approx(auto["sub_step"])
    assert start.search_every == auto["search_every"]


def test_its_ends_are_the_solvers_of_fast_and_accurate():
    for level, name in ((LEVELS[0], "fast"), (LEVELS[-1], "accurate")):
        said = preset_values(name, "cloth_node")
        assert level.sub_steps == round(FRAME / said["sub_step"])
        assert level.search_every == said["search_every"]
        assert level.detail == said.get("detail", 1.0)


def test_a_level_is_set_whatever_else_is_set_meanwhile():
    worn = simulation(strain_limit=0.2)
    pacer = Pacer(worn, 5.0)
    before = worn.parameters.environment
    pacer.frame(1.0, behind=True)
    settings = worn.parameters.settings
    assert (pacer.number, pacer.changes, pacer.cause) == (1, 1, "the cloth is behind")
    assert settings.sub_step == FRAME / 9
    assert settings.search_every == 9
    assert settings.strain_limit == 0.2
    assert worn.solver_step == FRAME
    assert worn.parameters.environment is before
    worn.parameters = worn.parameters.__class__(
        environment=gs.Environment(gravity=(0.0, 0.0, -1.0)), settings=XpbdSettings()
    )
    pacer.apply()
    assert worn.parameters.settings.sub_step == FRAME / 9
    assert worn.parameters.environment.gravity[2] == -1.0


def test_only_the_lowest_level_simulates_fewer_vertices_and_none_more_than_asked_for():
    assert [level.detail for level in LEVELS] == [0.25] + [1.0] * (len(LEVELS) - 1)
    for most, lowest in ((1.0, 0.25), (0.5, 0.25)):
        sheet = gs.Garment.sheet(1.0, 1.0, edge=0.05)
        worn = gs.Simulation(sheet, BALL, detail=most)
        pacer, (view,) = Pacer(worn, 5.0), worn
        asked = len(view.model)
        worn.step()
        found = []
        for _ in range(2):
            pacer.frame(1.0, behind=True)
            found.append((pacer.number, worn.detail, len(view.model)))
        fewer = gs.Simulation(sheet, BALL, detail=lowest)["sheet"].model
        assert found == [(1, most, asked), (0, lowest, len(fewer))]


def test_where_so_few_vertices_are_asked_for_anyway_the_lowest_level_is_the_next_one():
    worn = gs.Simulation(gs.Garment.sheet(1.0, 1.0, edge=0.05), BALL, detail=0.2)
    pacer = Pacer(worn, 5.0)
    worn.step()
    assert pacer.frame(1.0, behind=True) == (AT_FIRST - 1, 0, "the cloth is behind")
    assert (pacer.level.name, worn.detail) == (LEVELS[1].name, 0.2)
    assert pacer.frame(1.0, behind=True) is None


def test_a_change_moves_no_vertex():
    worn = simulation()
    pacer = Pacer(worn, 5.0)
    for _ in range(30):
        worn.step()
    (name,) = worn.names
    before = worn.positions(name).tobytes(), worn.state(name).v.tobytes()
    pacer.frame(1.0, behind=True)
    assert (worn.positions(name).tobytes(), worn.state(name).v.tobytes()) == before


def test_python_keeps_a_budget_and_only_then(monkeypatch):
    worn = simulation(preset="auto", frame_budget_ms=4.0)
    now = [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now.append(now[-1] + 0.02) or now[-1])
    worn.step()  # puts it on: not a frame
    for _ in range(8):
        worn.step()
    assert worn.pace.number == 0
    assert worn.parameters.settings.sub_step == FRAME / 9
    assert worn.pace.cause == "frames take 20 ms of 4 ms"
    balanced = simulation(preset="balanced")
    for other in (simulation(preset="auto"), simulation(preset="auto", frame_budget_ms=0.0)):
        for _ in range(8):
            other.step()
            balanced.step()
        assert other.parameters == balanced.parameters
        balanced = simulation(preset="balanced")


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"preset": "fast"}, "frame_budget_ms: does nothing with preset fast; allowed with: auto"),
        ({}, "frame_budget_ms: does nothing with preset None; allowed with: auto"),
        ({"preset": "auto", "sub_step": 0.001}, "sub_step: found 0.001, but preset auto con"),
        ({"preset": "auto", "search_every": 2}, "search_every: found 2, but preset auto con"),
        ({"preset": "auto", "solver": "implicit"}, "solver: found 'implicit', which preset au"),
        ({"preset": "auto", "frame_budget_ms": -1.0}, "frame_budget_ms: found -1.0; allowed: a "),
    ],
)
def test_what_it_cannot_keep_to_is_refused(options, line):
    with pytest.raises(gs.ParameterError) as raised:
        simulation(**{"frame_budget_ms": 4.0, **options})
    assert str(raised.value).startswith(line)


def test_what_it_does_not_move_may_be_given():
    worn = simulation(preset="auto", frame_budget_ms=4.0, strain_limit=0.1, coarse=True)
    assert worn.parameters.settings.strain_limit == 0.1
    assert not set(MOVED) & {"strain_limit", "coarse"}


def test_a_measured_front_is_used_until_something_changes(monkeypatch):
    assert own_front.own_levels() == (LEVELS, None, own_front.SHIPPED)
    assert own_front.keep_front(COST)
    own = own_front.own_levels()
    assert [level.cost for level in own.levels] == pytest.approx(list(COST / 5.0))
    assert own.told == "as measured on this machine"
    pacer = simulation(preset="auto", frame_budget_ms=4.0).pace
    assert pacer.level.cost == 1.0
    monkeypatch.setattr(own_front, "processor", lambda: "another one")
    own_front._key.cache_clear()
    assert own_front.own_levels().levels == LEVELS
    own_front._key.cache_clear()


@pytest.mark.parametrize(
    "cost",
    [
        COST[:-1],
        COST.astype(np.float32),
        COST * np.nan,
        COST * 1e-9,
        -COST,
        COST * np.array([1e-2, 1, 1, 1, 1, 1, 1, 1, 1]),
        np.full(len(COST), np.inf),
    ],
)
def test_a_front_that_cannot_be_is_not_used(cost):
    own_front.keep_front(cost)
    own = own_front.own_levels()
    assert own.levels == LEVELS
    assert own.told.startswith("the measured front is not used, it")
    assert own.told.endswith(own_front.SHIPPED)


@pytest.mark.parametrize("damage", [b"", b"PK", b"x" * 5000])
def test_a_damaged_file_is_not_used_and_told(damage, tmp_path):
    own_front.keep_front(COST)
    (file,) = (tmp_path / "garment_sim_ros" / own_front.FOLDER).iterdir()
    file.write_bytes(damage)
    assert own_front.own_levels().levels == LEVELS
    assert "is not used" in own_front.own_levels().told
    file.write_bytes(b"")
    os.truncate(file, 2**40)
    assert "is not used" in own_front.own_levels().told


def test_other_arrays_are_no_front():
    disk_cache.keep_arrays(own_front.FOLDER, own_front._key(), {"cost": COST, "other": COST})
    assert "it holds something else" in own_front.own_levels().told


def test_a_cache_that_cannot_be_written_is_told(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/none")
    assert not own_front.keep_front(COST)
