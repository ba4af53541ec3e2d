"""Drafts are cut to the body: front and back, around the crotch, along the arm."""

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.garment.patterns.drafts.trousers import CROTCH, trousers
from garment_sim_ros.garment.patterns.drafts.tshirt import long_sleeved_shirt, tshirt
from garment_sim_ros.garment.patterns.drafts.upper import bent
from garment_sim_ros.garment.patterns.making import Model
from garment_sim_ros.garment.patterns.tape_sections import girth_of, level_of

BODIES = ("mannequin", "mannequin:height=2.0,build=1,sex=1", "mannequin:height=1.45,build=0")


@pytest.fixture(scope="module", params=BODIES)
def tape(request):
    return Model(load_body(request.param)).tape()


def width(panel, height):
    """How wide a panel is at a height [m]."""
    x, y = panel.outline.T
    a, b = np.stack([x, y], 1), np.stack([np.roll(x, -1), np.roll(y, -1)], 1)
    crossed = (a[:, 1] - height) * (b[:, 1] - height) < 0.0
    a, b = a[crossed], b[crossed]
    s = (height - a[:, 1]) / (b[:, 1] - a[:, 1])
    return float(np.ptp(a[:, 0] + s * (b[:, 0] - a[:, 0])))


def test_a_girth_is_parted_by_a_plane():
    angle = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    level = level_of(1.0, np.stack([0.1 * np.cos(angle) + 0.3, 0.2 * np.sin(angle)], axis=1))
    assert level.before(0.3) == pytest.approx(0.5 * level.girth, rel=1e-3)
    assert level.before(0.0) == pytest.approx(level.girth)
    assert level.before(0.5) == 0.0
    front, back = level.before(0.35), level.before(0.25)
    assert front + back == pytest.approx(level.girth, rel=1e-3)
    assert 0.0 < front < 0.5 * level.girth
    assert girth_of(level.outline) == pytest.approx(level.girth)


def test_a_shirt_has_room_in_front_and_behind(tape):
    pattern = tshirt(tape)
    shoulders = np.mean([arm.shoulder[0] for arm in tape.arms])
    chest = tape.bust
    wide = {name: width(pattern.panels[name], chest.height - 0.08) for name in ("front", "back")}
    assert wide["front"] > 1.02 * chest.before(shoulders)
    assert wide["back"] > 1.02 * (chest.girth - chest.before(shoulders))
    assert wide["back"] > tape.shoulder


def test_trousers_go_around_the_crotch(tape):
    panels = trousers(tape).panels
    levels = [v for v in tape.levels if tape.crotch <= v.height <= tape.waist.height]
    points = [(x, v.height) for v in levels for x in (v.front, v.back)]
    around = girth_of(np.array(points)) - tape.waist.size[0]
    seam = panels["left_front"].lengths[CROTCH] + panels["right_back"].lengths[CROTCH]
    assert seam > 1.02 * around


def test_long_sleeves_end_at_the_wrist(tape):
    pattern = long_sleeved_shirt(tape)
    panel = pattern.panels["left_sleeve"]
    arm = tape.arms[0]
    ends = pattern.panels["front"].corners[3, 0] - 0.5 * tape.shoulder
    around = float(np.linalg.norm(bent(arm))) * arm.upper / (2.0 * np.pi)
    assert np.ptp(panel.outline[:, 1]) == pytest.approx(
        0.97 * arm.length - ends + around, abs=1e-6
    )
