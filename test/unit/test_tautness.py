"""Where a garment is too narrow is told in centimetres of its panel."""

import re
from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.garment.patterns.gates import Gates
from garment_sim_ros.garment.patterns.pieces import cut
from garment_sim_ros.garment.patterns.sewing import Sewn
from garment_sim_ros.garment.patterns.tautness import tautest
from test.simple_patterns import tube


def hung(stretch):
    """A tube whose panels are where they were cut but for what `stretch` does to the front."""
    pieces = cut(replace(tube(width=0.4, height=0.4), stitches=()), 0.03)
    flat = pieces.flat[pieces.triangles]
    x = pieces.placed()
    front = pieces.panel == 0
    x[front] = stretch(x[front])
    return pieces, Sewn(
        vertices=x,
        shown=x,
        triangles=pieces.triangles,
        flat=flat,
        placed=x,
        closed=x,
        gaps=(),
        rms_speed=0.0,
        max_speed=0.0,
    )


@pytest.mark.parametrize(
    ("scale", "words"),
    [
        ([1.0, 1.1, 1.0], "panel 'front', 1... m .* across the grain: its 40 cm are 4.0 cm too n"),
        ([1.0, 1.0, 1.05], "panel 'front', 1... m .* along the grain: its 40 cm are 2.0 cm too s"),
    ],
)
def test_the_tautest_panel_is_told(scale, words):
    pieces, sewn = hung(lambda x: x * scale)
    assert re.search(words, tautest(pieces, sewn, -1.0))


def test_folds_beside_what_is_taut_give_nothing():
    def stretched_and_folded(x):
        across = x[:, 1] - x[:, 1].min()
        middle = 0.5 * across.max()
        x = x.copy()
        x[:, 1] = np.where(across < middle, 1.1 * across, 0.4 * across + 0.7 * middle)
        return x

    found = re.search(
        r"its 40 cm are (\S+) cm too narrow", tautest(*hung(stretched_and_folded), 0)
    )
    assert found
    assert 1.5 < float(found[1]) < 2.3


def test_it_is_told_where_the_limit_is_not_kept():
    failed = Gates(figures={"stretch_p95": 0.05}, taut="most in panel 'front'")
    assert failed.lines()[0].endswith("95th percentile: most in panel 'front'")
    assert "panel" not in Gates(figures={"stretch_p95": 0.02}, taut="in panel").lines()[0]
