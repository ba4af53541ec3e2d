"""Panels that are sewn to themselves: rolled around what they are placed beside."""

from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.pattern import Pattern
from garment_sim_ros.garment.patterns.rolling import rolled_tubes
from test.simple_patterns import panel, seam


def column(radius, y=0.0, n=24, height=1.8):
    """A skin: an upright closed column beside the middle."""
    angle = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    ring = np.stack([radius * np.cos(angle), y + radius * np.sin(angle), 0.0 * angle], axis=1)
    v = np.concatenate([ring, ring + np.array([0.0, 0.0, height]), [[0, y, 0.0], [0, y, height]]])
    j = np.arange(n)
    k = (j + 1) % n
    bottom, top = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    sides = [[j, k, j + n], [k, k + n, j + n], [bottom, k, j], [top, j + n, k + n]]
    return v, np.concatenate([np.stack(s, axis=1) for s in sides])


TRUNK, ARM = column(0.15), column(0.04, y=0.6)
SKIN = np.concatenate([TRUNK[0], ARM[0]]), np.concatenate([TRUNK[1], ARM[1] + len(TRUNK[0])])


def skirt(width, y=0.0, edges=(1, 3)):
    """A panel before the body: x of its plane is the world's y, y is up."""
    corners = [[y - width / 2, 0.8], [y + width / 2, 0.8], [y + width / 2, 1.2]]
    corners.append([y - width / 2, 1.2])
    one = panel("skirt", corners, x=0.3)
    stitch = seam(*(("skirt", e) for e in edges))
    return Pattern(name="tube", panels={"skirt": one}, stitches=(stitch,))


def rolled(pattern):
    return rolled_tubes(pattern, *SKIN, "a column").panels["skirt"]


def axis_distances(one, y):
    x = one.placement.placed(one.outline)
    return np.linalg.norm(x[:, :2] - np.array([0.0, y]), axis=1), x


@pytest.mark.parametrize(("width", "y", "radius"), [(1.2, 0.0, 0.15), (0.5, 0.6, 0.04)])
def test_a_tube_is_around_what_it_is_beside_and_its_edges_meet(width, y, radius):
    one = rolled(skirt(width, y))
    distance, x = axis_distances(one, y)
    np.testing.assert_allclose(distance, width / (2.0 * np.pi), rtol=1e-6)
    assert distance.min() > radius
    heights = one.outline[:, 1]
    for height in (0.8, 1.2):  # the ends of the seam are one place each
        ends = x[heights == height]
        assert np.linalg.norm(ends[0] - ends[1]) < 1e-9
    np.testing.assert_allclose(x[:, 2], heights)
    middle = one.placement.placed(np.array([[0.0, 1.0]]))[0]
    np.testing.assert_allclose(middle, [width / (2.0 * np.pi), y, 1.0], atol=1e-9)  # as placed


def test_a_tight_tube_stays_open_at_its_back():
    width = 0.98  # around 0.15 m, but not 15 mm off it
    distance, x = axis_distances(rolled(skirt(width)), 0.0)
    assert distance.min() > 0.15 + 0.0149
    assert 0.01 < np.linalg.norm(x[0] - x[1]) < 0.1


def test_a_tube_a_little_too_tight_is_around_what_it_is_pulled_over():
    distance, x = axis_distances(rolled(skirt(0.9)), 0.0)  # around 0.94 m
    assert distance.min() > 0.15 + 0.0149
    assert np.linalg.norm(x[0] - x[1]) > 0.1


def test_a_tube_that_the_body_does_not_fit_into_is_named():
    with pytest.raises(GeometryError, match=r"panel 'skirt'.* 0.8 m wide, a column is 0.9\d* m"):
        rolled(skirt(0.8))


def test_a_tube_beside_nothing_is_named():
    high = skirt(1.2)
    raised = high.panels["skirt"].placement.moved(np.array([0.0, 0.0, 3.0]))
    one = replace(high.panels["skirt"], placement=raised)
    with pytest.raises(GeometryError, match="a column is not beside it"):
        rolled(Pattern(name="tube", panels={"skirt": one}, stitches=high.stitches))


def test_a_tube_across_the_panel_is_named():
    with pytest.raises(GeometryError, match="'skirt' edge 0 to 'skirt' edge 2 above each other"):
        rolled(skirt(0.5, edges=(0, 2)))


@pytest.mark.parametrize("tip", [[[0.0, 1.0]], [[-0.01, 1.0], [0.01, 1.0]]])
def test_a_dart_is_no_tube(tip):
    corners = [[-0.3, 0.8], [0.3, 0.8], [0.3, 1.2], [0.03, 1.2], *tip[::-1], [-0.03, 1.2]]
    corners.append([-0.3, 1.2])
    one = panel("skirt", corners)
    stitch = seam(("skirt", 3), ("skirt", 3 + len(tip)))
    pattern = Pattern(name="dart", panels={"skirt": one}, stitches=(stitch,))
    assert rolled(pattern) is one
