"""A limit of how cloth lies to its place as skin is a file and a line of a table."""

import re
from pathlib import Path

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.garment.outfit_file import GARMENT_KEYS
from garment_sim_ros.sim.account import account
from garment_sim_ros.sim.holds.skin_limits import SKIN_LIMITS

PACKAGE = Path(gs.__file__).parent


def test_code_outside_of_its_folder_names_no_limit_but_of_shirts_and_of_prices():
    named = re.compile(r"\"(" + "|".join(SKIN_LIMITS) + r")\"|\b(DistanceLimit|Backstop)\b")
    files = [p for p in PACKAGE.rglob("*.py") if (PACKAGE / "sim" / "holds") not in p.parents]
    found = {p.name: {m[0] for m in named.finditer(p.read_text())} for p in files}
    assert {name: words for name, words in found.items() if words} == {
        "dressing.py": {'"max_distance"'},
        "compiler.py": {'"max_distance"'},
        "features.py": {'"max_distance"', '"backstop"'},
    }


@pytest.mark.parametrize("name", SKIN_LIMITS)
def test_every_limit_can_be_asked_for_holds_and_is_told(name):
    assert name in GARMENT_KEYS
    sheet = gs.Garment.sheet(0.2, 0.2, edge=0.1, pins=[0])
    limits = {name: np.full(len(sheet.vertices), 1e-4)}
    sheet = gs.Garment(**{**vars(sheet), "skin_limits": limits})
    simulation = gs.Simulation(sheet, gs.ColliderSet.of(gs.sphere(0.01, position=(9.0, 9.0, 9.0))))
    for _ in range(3):
        simulation.step(dt=1 / 60)
    assert simulation.skin_limits(sheet.name) == (name,)
    assert simulation[sheet.name].health.held > 0
    told = str(account(simulation))
    assert f"no garment has a {name}" not in told
    assert SKIN_LIMITS[name].effect in told
