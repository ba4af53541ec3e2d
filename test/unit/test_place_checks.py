"""Patterns that are for no body, by where their pieces start, and what comes of them."""

from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.ironing import ironed, self_intersections
from garment_sim_ros.garment.patterns.pattern import WAIST, Stitch
from garment_sim_ros.garment.patterns.pieces import cut
from garment_sim_ros.garment.patterns.place_checks import check_band, check_near, check_ways
from garment_sim_ros.garment.patterns.placing import placed_clear
from garment_sim_ros.garment.patterns.sewing import _check_free
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import mesh_topology
from test.simple_patterns import seam, tube
from test.unit.test_rolled_tubes import column, skirt

SKIN, TRIANGLES = column(0.15)
BODY = MeshDistance(SKIN, TRIANGLES)


def around(pattern, at=0.8):
    """The panels of a tube before and behind the body, right sides outwards."""
    panels = {}
    for name, panel in pattern.panels.items():
        T = panel.placement.T_world_panel.copy()
        if name == "back":
            T = T @ np.diag([-1.0, 1.0, -1.0, 1.0])
        T[:3, 3] += [0.0, 0.5 * np.ptp(panel.corners[:, 0]) * (1 if name == "back" else -1), at]
        panels[name] = replace(panel, placement=replace(panel.placement, T_world_panel=T))
    return replace(pattern, panels=panels)


def placed(pattern):
    return placed_clear(cut(pattern, 0.05), BODY, "a column")


def crossed(pattern):
    return replace(
        pattern, stitches=(seam(("front", 1), ("back", 1)), seam(("front", 3), ("back", 3)))
    )


def test_stitches_whose_sides_are_swapped_name_the_seam():
    pattern = around(tube(width=0.5))
    check_ways(*placed(pattern), BODY, "a column")
    words = "the seam 'front' edge 1 to 'back' edge 1 would be drawn through a column, 4. % of"
    with pytest.raises(GeometryError, match=words):
        check_ways(*placed(crossed(pattern)), BODY, "a column")


@pytest.mark.parametrize("width", [0.1, 0.25])
def test_panels_narrower_than_the_body_may_be_stretched_over_it(width):
    check_ways(*placed(around(tube(width=width))), BODY, "a column")


def test_sides_of_a_tube_around_the_body_may_be_far_apart():
    one = skirt(0.98)
    pattern = replace(one, stitches=(Stitch(sides=one.stitches[0].sides),))
    check_ways(*placed(pattern), BODY, "a column")


@pytest.mark.parametrize(
    ("at", "words"),
    [
        (0.8, None),
        (1.7, None),
        (
            1.8,
            r"panel 'front' reaches up to 2\.3 m, a column is 1\.8 m high; allowed: up to 2\.25",
        ),
        (4.0, "panel 'front' is 2.21 m away from a column"),
    ],
)
def test_patterns_far_over_the_head_are_in_another_unit(at, words):
    pattern = around(tube(), at)
    if words is None:
        check_near(pattern, BODY, SKIN, "a column")
        return
    with pytest.raises(GeometryError, match=words):
        check_near(pattern, BODY, SKIN, "a column")


def labelled(pattern, edge):
    panels = {}
    for name, panel in pattern.panels.items():
        edges = [replace(e, label=WAIST) if k == edge else e for k, e in enumerate(panel.edges)]
        panels[name] = replace(panel, edges=tuple(edges))
    return replace(pattern, panels=panels)


@pytest.mark.parametrize(
    ("width", "edge", "refused"),
    [(0.6, 2, False), (0.63, 2, True), (0.63, 0, True), (0.63, 1, False)],  # edge 1 is sewn
)
def test_a_band_much_longer_than_the_body_is_around_is_named(width, edge, refused):
    pieces, x = placed(labelled(around(tube(width=width)), edge))
    if not refused:
        check_band(pieces, x, SKIN, TRIANGLES, "a column")
        return
    words = r"panel 'front' and others are 1\.26 m around, a column is 0\.94 m there; .* 1\.22 m"
    with pytest.raises(GeometryError, match=words):
        check_band(pieces, x, SKIN, TRIANGLES, "a column")


def test_a_band_where_the_body_has_no_trunk_is_named():
    pieces, x = placed(labelled(around(tube(width=0.5)), 2))
    legs = [column(0.06, y) for y in (-0.1, 0.1)]
    skin = np.concatenate([v for v, _ in legs])
    triangles = np.concatenate([legs[0][1], legs[1][1] + len(legs[0][0])])
    words = r"panel 'front' start 1\.2 m over the floor, where a pair of legs has no trunk"
    with pytest.raises(GeometryError, match=words):
        check_band(pieces, x, skin, triangles, "a pair of legs")


@pytest.mark.parametrize(("edge", "refused"), [(2, True), (None, False)])
def test_a_tube_with_a_waist_is_not_moved_down_the_legs(edge, refused):
    """What is rolled around a limb may be: there it is clear of the trunk."""
    hips, _ = column(0.15)
    hips[hips[:, 2] > 1.0, :2] *= 2.0  # a cone, upwards wider
    one = labelled(skirt(1.3), edge)
    panel = one.panels["skirt"]
    rolled = replace(panel, placement=replace(panel.placement, bend=0.22).moved([-0.08, 0, 0]))
    pieces = cut(replace(one, panels={"skirt": rolled}, stitches=()), 0.05)
    body = MeshDistance(hips, TRIANGLES)
    if not refused:
        lower = placed_clear(pieces, body, "a cone")[0].pattern.panels["skirt"].placement
        assert lower.T_world_panel[2, 3] < -0.1
        return
    with pytest.raises(GeometryError, match=r"panel 'skirt', rolled to 1\.38 m .* labelled 'wai"):
        placed_clear(pieces, body, "a cone")


def waves(depth):
    """A tube that was sewn, its front and back in waves through each other."""
    pieces = cut(around(tube()), 0.04)
    x = pieces.placed()
    side = np.where(pieces.panel == 0, 1.0, -1.0)
    x[:, 0] = side * (0.05 - depth * np.sin(40.0 * x[:, 1]))
    return pieces, pieces.joined(x)


def test_what_runs_through_itself_all_over_is_no_garment():
    _check_free(*waves(0.0))
    pieces, x = waves(0.12)
    count = len(mesh_topology(pieces.sewn_triangles).edges)
    words = rf"'tube' runs through itself where it is sewn, at \d+ of {count} edges, .*'front'"
    with pytest.raises(GeometryError, match=words):
        _check_free(pieces, x)
    assert ironed(x, pieces.sewn_triangles) is x  # which takes its time, for nothing


def test_crossings_of_triangles_of_any_size_are_found():
    """A vertex pulled across makes long triangles, which others must not be searched as far as."""
    pieces, x = waves(0.02)
    t = pieces.sewn_triangles
    far = int(np.argmax(x[:, 2]))
    x[far] = [-0.3, 0.0, 0.9]
    found = {tuple(e) for e in self_intersections(x, t).tolist()}
    edges = mesh_topology(t).edges
    naive = {tuple(e) for e in edges.tolist() if _runs_through(x, t, e)}
    assert len(naive) > 5
    assert found == naive


def _runs_through(x, t, edge):
    """Whether an edge runs through any triangle that it has no vertex in common with."""
    p, way = x[edge[0]], x[edge[1]] - x[edge[0]]
    for corners in t[~np.isin(t, edge).any(axis=1)]:
        a, b, c = x[corners]
        sides = np.column_stack([way, a - b, a - c])
        if abs(np.linalg.det(sides)) < 1e-18:
            continue
        s, u, v = np.linalg.solve(sides, a - p)
        if 0.0 < s < 1.0 and u > 0.0 and v > 0.0 and u + v < 1.0:
            return True
    return False
