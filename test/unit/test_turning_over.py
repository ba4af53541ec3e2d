"""Halves that were drawn as the mirror image of each other: taken as what they are placed for."""

import json
from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.garmentcode import read_garmentcode
from garment_sim_ros.garment.patterns.pieces import cut
from garment_sim_ros.garment.patterns.placing import placed_clear
from garment_sim_ros.garment.patterns.turning_over import facing_outwards, unfolded
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import edge_table
from test.unit.test_rolled_tubes import TRUNK

BODY = MeshDistance(*TRUNK)
LEFT = [[0, 0], [30, 0], [30, 40], [20, 50], [0, 45]]


def half(sign, z, reverse):
    """One half of a front or back [cm], its armhole (edge 2) an arc, its shoulder (3) a curve."""
    edges = [{"endpoints": [i, (i + 1) % 5]} for i in range(5)]
    edges[2]["curvature"] = {"type": "circle", "params": [20, 0, int(sign < 0.0)]}
    edges[3]["curvature"] = {"type": "quadratic", "params": [[0.5, 0.1 * sign]]}
    edges[1]["label"] = "side"
    if reverse:
        for edge in edges:
            edge["endpoints"].reverse()
        edges[2]["curvature"]["params"][2] ^= 1
        edges[3]["curvature"]["params"][0][1] *= -1
    return {
        "translation": [0, 90, z],
        "rotation": [0, 0, 0],
        "vertices": [[sign * x, y] for x, y in LEFT],
        "edges": edges,
    }


def read(tmp_path, mirrored):
    """A front of two halves sewn in the middle, and a back of two; all as seen from the front."""

    def ends(a, b, edge):
        return [{"panel": p, "edge": edge} for p in (a, b)]

    content = {
        "pattern": {
            "panels": {
                "left": half(1, 20, False),
                "right": half(-1, 20, not mirrored),
                "back_left": half(1, -20, True),
                "back_right": half(-1, -20, False),
            },
            "stitches": [
                ends("left", "right", 4),
                ends("left", "back_left", 1),
                ends("left", "back_left", 3),
                ends("right", "back_right", 1),
                ends("right", "back_right", 3),
                ends("back_left", "back_right", 4),
            ],
        }
    }
    path = tmp_path / "halves.json"
    path.write_text(json.dumps(content))
    return read_garmentcode(path)


def test_mirrored_halves_make_the_garment_that_careful_ones_make(tmp_path):
    wanted = read(tmp_path, mirrored=False)
    assert facing_outwards(wanted, BODY) is wanted
    drawn = read(tmp_path, mirrored=True)
    made = facing_outwards(drawn, BODY)
    (note,) = made.notes
    assert note.startswith("panel 'right': drawn clockwise")
    for name, panel in made.panels.items():
        other = wanted.panels[name]
        np.testing.assert_allclose(
            panel.placement.T_world_panel[:3, 2], [-1.0 if "back" in name else 1.0, 0.0, 0.0]
        )
        assert panel.area == pytest.approx(other.area)
        place, at = (
            np.sort(p.placement.placed(p.outline).round(9), axis=0) for p in (panel, other)
        )
        np.testing.assert_allclose(place, at)
    for ours, theirs in zip(made.stitches, wanted.stitches, strict=True):
        for own, other in zip(ours.sides, theirs.sides, strict=True):
            (a,), (b,) = own, other
            curve = made.panels[a.panel].curves[a.edges[0]]
            theirs_curve = wanted.panels[b.panel].curves[b.edges[0]]
            x = made.panels[a.panel].placement.placed(curve)
            y = wanted.panels[b.panel].placement.placed(theirs_curve)
            np.testing.assert_allclose(x, y, atol=1e-9)  # the same edge, run through alike
    labels = {name: [e.label for e in p.edges].count("side") for name, p in made.panels.items()}
    assert set(labels.values()) == {1}


def test_the_sewn_halves_are_one_surface_with_one_outside(tmp_path):
    pieces = cut(facing_outwards(read(tmp_path, mirrored=True), BODY), 0.15)
    placed_clear(pieces, BODY, "a column")  # every right side outwards
    t = pieces.sewn_triangles
    half_edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    assert len(np.unique(half_edges, axis=0)) == len(half_edges)
    assert edge_table(t)[2].max() == 2


def test_without_turning_over_they_are_refused_with_what_to_write(tmp_path):
    drawn = read(tmp_path, mirrored=True)
    loose = replace(drawn, stitches=())
    with pytest.raises(GeometryError, match=r"panel '\w+' is mirrored.*counter-clockwise"):
        placed_clear(cut(loose, 0.15), BODY, "a column")


def test_a_panel_drawn_counter_clockwise_is_not_turned(tmp_path):
    drawn = read(tmp_path, mirrored=True)
    panels = {n: replace(p, clockwise=False) for n, p in drawn.panels.items()}
    other = replace(drawn, panels=panels)
    assert facing_outwards(other, BODY) is other  # it is refused when it is placed


def with_lapels(tmp_path, *, whole=True):
    """Lapels over the front edges, folded outwards, which are sewn to each other at the nape."""
    path = tmp_path / "halves.json"
    read(tmp_path, mirrored=False)
    content = json.loads(path.read_text())
    pattern = content["pattern"]
    corners = [[0, 0], [8, 0], [8, 40], [0, 45]]
    edges = [{"endpoints": [i, (i + 1) % 4]} for i in range(4)]
    for name, sign in (("lapel_left", 1), ("lapel_right", -1)):
        back = [{"endpoints": edge["endpoints"][::-1]} for edge in edges]
        pattern["panels"][name] = {
            "translation": [0, 90, 25],
            "rotation": [0, 0, 0],
            "vertices": [[sign * x, y] for x, y in corners],
            "edges": edges if sign > 0 else back,
        }
    left = [{"panel": "left", "edge": 4}, {"panel": "lapel_left", "edge": 3}]
    right = [{"panel": "right", "edge": 4}, {"panel": "lapel_right", "edge": 3}]
    pattern["stitches"] = [
        *(s for s in pattern["stitches"] if {e["panel"] for e in s} != {"left", "right"}),
        [*left, "right_wrong"],
        [*right, *(["right_wrong"] if whole else [])],
        [{"panel": "lapel_left", "edge": 2}, {"panel": "lapel_right", "edge": 2}],
    ]
    path.write_text(json.dumps(content))
    return read_garmentcode(path)


def test_folded_panels_are_turned_over_so_that_the_surface_has_one_outside(tmp_path):
    drawn = with_lapels(tmp_path)
    with pytest.raises(GeometryError, match="no surface with one outside"):
        cut(drawn, 0.06)
    made = unfolded(facing_outwards(drawn, BODY))
    assert {n for n, p in made.panels.items() if p.folded} == {"lapel_left", "lapel_right"}
    assert not any(s.turned for s in made.stitches)
    for name in ("lapel_left", "lapel_right"):
        was, now = drawn.panels[name].placement, made.panels[name].placement
        assert now.T_world_panel[:3, 2] == pytest.approx(-was.T_world_panel[:3, 2])
        assert made.panels[name].outwards == pytest.approx(was.T_world_panel[:3, 2])
    pieces = cut(made, 0.06)
    t = pieces.sewn_triangles
    half_edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    assert len(np.unique(half_edges, axis=0)) == len(half_edges)
    clear, x = placed_clear(pieces, BODY, "a column")
    assert BODY.signed_distance(x)[0].min() > 0.0
    lapel = [*clear.pattern.panels].index("lapel_left")
    assert x[clear.panel == lapel, 0].min() > 0.0  # before the body, as it was drawn


def test_seams_that_leave_no_outside_are_refused(tmp_path):
    drawn = with_lapels(tmp_path, whole=False)
    assert unfolded(drawn) is drawn
    with pytest.raises(GeometryError, match="no surface with one outside"):
        cut(drawn, 0.06)
