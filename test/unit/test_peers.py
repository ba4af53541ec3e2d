"""What `make peers` says of a run, on motions of which it is known."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

BENCH = Path(__file__).resolve().parents[2] / "bench"
pytestmark = pytest.mark.skipif(not BENCH.is_dir(), reason="no bench")


@pytest.fixture(scope="module")
def peers():
    """The modules of `bench/peers`, by name."""
    folders = [str(BENCH), str(BENCH / "peers")]
    sys.path[:0] = folders
    try:
        yield {
            name: importlib.import_module(name)
            for name in ("compare", "judging", "playing", "scenes", "settings")
        }
    finally:
        for folder in folders:
            sys.path.remove(folder)


@pytest.fixture
def scene(peers, tmp_path):
    """A scene as its peers read it."""
    return lambda name: peers["playing"].load(peers["scenes"].write(name, tmp_path))


def ridden(peers, scene, stretched=1.0):
    """All frames of a cloth that goes with the shape as if it were one solid, or larger."""
    first = stretched * (scene.vertices - scene.position[0])
    rotated = peers["playing"].rotated
    return np.array(
        [scene.position[n] + rotated(scene.orientation[n], first) for n in range(1, 181)]
    )


def result(x):
    """A run whose frames take 5 F."""
    return {"x": x, "time": np.full(len(x), 5e-3), "unit": np.full(len(x), 1e-3)}


def test_scenes_have_the_same_fabric_and_pins_that_ride(peers, scene):
    for name in peers["scenes"].SCENES:
        s = scene(name)
        corners = s.vertices[s.triangles]
        sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = 0.5 * np.linalg.norm(np.cross(*sides), axis=1).sum()
        assert s.mass.sum() == pytest.approx(0.2 * area)
        assert len(s.position) == len(s.orientation) == s.frames + 1
        assert peers["playing"].pinned(s, 0) == pytest.approx(s.vertices[s.pins])
    limb = scene("limb")
    x = peers["playing"].pinned(limb, 45)
    # The upper ring stays 5 cm from the pivot, across the limb.
    away = np.linalg.norm(x - [0.0, 0.0, 1.5], axis=1)
    assert away == pytest.approx(np.hypot(0.05, 0.075))


def test_a_cloth_that_rides_along_is_well(peers, scene):
    limb = scene("limb")
    found = peers["judging"].judge("limb", limb, result(ridden(peers, limb)))
    assert found["fault"] == ""
    assert found["cost_F"] == pytest.approx(5.0)
    assert found["stretch_p95_percent"] == pytest.approx(0.0, abs=1e-6)
    assert found["pierced"] == found["penetration_mm"] == 0.0
    tip = 2.0 * np.pi * 1.1 * 0.3e3  # somewhere along the limb, mm/s
    assert 0.2 * tip < found["speed_mm_s"] < 3.0 * tip


def test_stretch_is_that_of_the_edges(peers, scene):
    sheet = scene("drape")
    up = np.array([0.0, 0.0, 0.5])
    found = peers["judging"].judge("drape", sheet, result(ridden(peers, sheet, 1.07) + up))
    assert found["stretch_p95_percent"] == pytest.approx(7.0, abs=1e-3)
    assert found["stretch_max_percent"] == pytest.approx(7.0, abs=1e-3)
    assert found["fault"] == ""


@pytest.mark.parametrize(("name", "vertex"), [("drape", 500), ("limb", 480)])
def test_how_deep_cloth_is_in_the_shape(peers, scene, name, vertex):
    s = scene(name)
    x = ridden(peers, s)
    along = peers["playing"].rotated(s.orientation[100], np.array([[1.0, 0.0, 0.0]]))[0]
    x[99, vertex] = s.position[100] + (s.radius - 0.004) * along
    found = peers["judging"].judge(name, s, result(x))
    assert found["penetration_mm"] == pytest.approx(4.0, abs=1e-3)


def test_every_fault_is_told(peers, scene):
    judge = peers["judging"].judge
    sheet, hung, limb = map(scene, ("drape", "hung", "limb"))
    well = ridden(peers, sheet)
    broken = well.copy()
    broken[50, 3] = np.nan
    assert judge("drape", sheet, result(broken))["fault"] == "not finite"
    assert judge("drape", sheet, result(well - [0.0, 0.0, 2.0]))["fault"] == "falls through"
    assert judge("drape", sheet, result(well[:10]))["fault"].startswith("stopped")
    apart = ridden(peers, sheet, 1.6)
    assert judge("drape", sheet, result(apart))["fault"] == "comes apart"
    loose = np.tile(hung.vertices - [0.0, 0.0, 0.1], (180, 1, 1))
    assert judge("hung", hung, result(loose))["fault"] == "pins come off"
    across = ridden(peers, limb)
    first = limb.vertices - limb.position[0]
    across[60:70] = limb.position[61:71, None] + first[:, [2, 1, 0]] * [1.0, 1.0, -1.0]
    found = judge("limb", limb, result(across))
    assert found["pierced"] == pytest.approx(10 / 180)
    assert found["fault"] == "pierced"


def test_at_equal_error_the_cheapest_whole_run_counts(peers):
    rows = [
        {"fault": fault, "stretch_p95_percent": stretch, "cost_F": cost, "penetration_mm": depth}
        for fault, stretch, cost, depth in (
            *(("", 0.9, 20.0, 2.0), ("", 0.2, 30.0, 9.0), ("pierced", 0.1, 1.0, 0.0)),
            *(("", 2.0, 10.0, 0.0), ("", 0.1, 2.0, 30.0)),
        )
    ]
    cheapest = peers["compare"].cheapest
    costs = [cheapest(rows, error)["cost_F"] for error in (3.0, 1.0, 0.3)]
    assert costs == [10.0, 20.0, 30.0]
    assert cheapest(rows, 0.15) is None


def test_the_page_has_a_place_for_each_table(peers):
    compare = peers["compare"]
    made = compare.tables([])
    page = compare.fill(compare.PAGE.read_text(), dict.fromkeys(made, "| new |"))
    assert page.count("| new |") == len(made) == 4
    assert compare.fill(page, dict.fromkeys(made, "| new |")) == page


def test_every_setting_has_a_script(peers):
    for peer in peers["settings"].SETTINGS:
        assert (BENCH / "peers" / f"with_{peer}.py").is_file()
    assert set(peers["settings"].PACKAGES) == set(peers["settings"].SETTINGS) - {"ours"}
