"""Patterns: curves, panels, what is wrong with them, seams, triangulation, what becomes one."""

from dataclasses import replace

import numpy as np
import pytest
from simple_patterns import panel, seam, tube

from garment_sim_ros.errors import GeometryError, ParameterError
from garment_sim_ros.garment.patterns.checking import check
from garment_sim_ros.garment.patterns.curves import arc, bezier, lengths
from garment_sim_ros.garment.patterns.pattern import Edge, Joint, Pattern, Placement, Seam, Stitch
from garment_sim_ros.garment.patterns.pieces import cut, edge_length_for
from garment_sim_ros.garment.patterns.seams import outlines
from garment_sim_ros.garment.patterns.triangulation import (
    SMALLEST_ANGLE,
    inner_angles,
    triangulate,
)
from garment_sim_ros.geometry.topology import boundary_loops, edge_table, non_manifold_edges


def test_curves_pass_through_their_ends_and_have_their_lengths():
    quarter = arc(np.array([1.0, 0.0]), np.array([0.0, 1.0]), 1.0, right=True)
    assert lengths(quarter)[-1] == pytest.approx(np.pi / 2, rel=1e-4)
    assert np.hypot(*quarter.T) == pytest.approx(1.0)
    rest = arc(np.array([1.0, 0.0]), np.array([0.0, 1.0]), 1.0, large=True, right=True)
    # The longer arc that bulges to the right is about the other centre.
    assert lengths(rest)[-1] == pytest.approx(1.5 * np.pi, rel=1e-4)
    assert np.hypot(rest[:, 0] - 1.0, rest[:, 1] - 1.0) == pytest.approx(1.0)
    parabola = bezier(np.array([[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]]))
    assert parabola[128] == pytest.approx([0.5, 0.5])
    with pytest.raises(GeometryError, match="radius"):
        arc(np.zeros(2), np.array([1.0, 0.0]), 0.4)


def test_a_rolled_panel_keeps_its_widths():
    flat = np.stack([np.linspace(-0.1, 0.1, 41), np.zeros(41)], axis=1)
    placed = Placement(T_world_panel=np.eye(4), bend=0.05).placed(flat)
    steps = np.linalg.norm(np.diff(placed, axis=0), axis=1)
    assert steps == pytest.approx(0.005, rel=1e-3)
    assert np.hypot(placed[:, 0], placed[:, 2] + 0.05) == pytest.approx(0.05)


def test_a_rolled_panel_turns_with_its_limb():
    around = np.linspace(0.0, 0.1 * np.pi, 13)
    turn = np.array([0.5, 0.0, 0.0])
    place = Placement(T_world_panel=np.eye(4), bend=0.05, joint=Joint(y=-0.2, turn=turn))
    above, below = (place.placed(np.stack([around, np.full(13, y)], axis=1)) for y in (-0.1, -0.4))
    assert np.hypot(above[:, 0], above[:, 2] + 0.05) == pytest.approx(0.05)
    elbow = np.array([0.0, -0.2, -0.05])
    axis = np.array([0.0, -np.cos(0.5), -np.sin(0.5)])  # where the fore arm leads
    off = below - elbow
    assert off @ axis == pytest.approx(0.2)
    assert np.linalg.norm(off - np.outer(off @ axis, axis), axis=1) == pytest.approx(0.05)
    # Farther down the limb the elbow stays where it is.
    moved = place.along(0.05).placed(np.stack([around, np.full(13, -0.35)], axis=1))
    assert moved == pytest.approx(below)


def broken(change):
    pattern = tube()
    front = pattern.panels["front"]
    return replace(pattern, panels={**pattern.panels, "front": change(front)})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p: replace(p, edges=p.edges[:3]), "panel 'front' is open"),
        (lambda p: replace(p, corners=p.corners[[0, 2, 1, 3]]), "'front' crosses itself"),
        (lambda p: replace(p, corners=p.corners * [-1, 1]), "'front' is mirrored"),
        (lambda p: replace(p, corners=p.corners[[0, 1, 1, 3]]), "'front' edge 1 has no length"),
        (lambda p: replace(p, corners=p.corners * 100), "'front' is 50 m.*centimetres"),
        (lambda p: replace(p, corners=p.corners * np.nan), "'front'.*not finite"),
        (lambda p: replace(p, edges=(*p.edges[:3], Edge(start=3, end=9))), "corner beyond 3"),
    ],
)
def test_a_panel_that_cannot_be_cut_is_named(change, words):
    with pytest.raises(GeometryError, match=words):
        check(broken(change))


@pytest.mark.parametrize(
    ("stitches", "words"),
    [
        ([seam(("front", 1), ("sleeve", 0))], "there is no panel 'sleeve'"),
        ([seam(("front", 1), ("back", 4))], "panel 'back' has no edge 4"),
        ([seam(("front", 1), ("front", 1))], "sewn to itself"),
        (
            [seam(("front", 1), ("back", 3)), seam(("back", 3), ("front", 3))],
            "panel 'back' edge 3 is sewn 2 times",
        ),
        ([seam(("front", 1), ("front", 3))], "panel 'back' is not sewn"),
    ],
)
def test_stitches_that_make_no_garment_are_named(stitches, words):
    with pytest.raises(GeometryError, match=words):
        check(replace(tube(), stitches=tuple(stitches)))


def test_a_stitch_of_sides_of_very_different_length_is_refused():
    with pytest.raises(GeometryError, match="ratio"):
        check(tube(other=0.05))


@pytest.mark.parametrize("other", [0.5, 0.43])
def test_seams_match_vertex_to_vertex_eased_or_not(other):
    made = outlines(tube(other=other), 0.03)
    for pairs in made.pairs:
        a, b = (np.array([made.of_panel[n].points[i] for n, i in side]) for side in zip(*pairs))
        assert len(a) == round(0.5 * (0.5 + other) / 0.03) + 1
        assert a[:, 1] / 0.5 == pytest.approx(b[:, 1] / other)


def test_a_side_of_several_edges_is_cut_where_the_other_one_is():
    pattern = tube()
    front = panel("front", [[0, 0], [0.4, 0], [0.4, 0.2], [0.4, 0.5], [0, 0.5]])
    whole = replace(
        pattern,
        panels={**pattern.panels, "front": front},
        stitches=(
            Stitch(
                sides=((Seam(panel="front", edges=(1, 2)),), (Seam(panel="back", edges=(3,)),))
            ),
        ),
    )
    back = panel("back", [[0, 0], [0.4, 0], [0.4, 0.5], [0, 0.5]], x=-0.3)
    whole = replace(whole, panels={**whole.panels, "back": back})
    made = outlines(whole, 0.04)
    points = made.of_panel["back"].points
    assert np.isclose(points[points[:, 0] == 0.0, 1], 0.2).any()
    for (n, i), (m, j) in made.pairs[0]:
        assert made.of_panel[n].points[i][1] == pytest.approx(made.of_panel[m].points[j][1])


@pytest.mark.parametrize("seed", range(4))
def test_triangles_keep_the_outline_and_are_wide(seed):
    a = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    outline = np.stack([(0.3 + 0.05 * np.cos(3 * a)) * np.cos(a), 0.25 * np.sin(a)], axis=1)
    x, t = triangulate(outline, 0.03, seed=seed)
    assert np.array_equal(x[:60], outline)
    edges, _, count = edge_table(t)
    border = {tuple(e) for e in edges[count == 1].tolist()}
    assert border == {tuple(sorted((i, (i + 1) % 60))) for i in range(60)}
    assert inner_angles(x, t, 60).min() >= SMALLEST_ANGLE
    assert len(t) == 2 * len(x) - 60 - 2
    inside = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)[count == 2]
    assert 0.8 < np.median(inside) / 0.03 < 1.1
    again = triangulate(outline, 0.03, seed=seed)
    assert np.array_equal(x, again[0])
    assert np.array_equal(t, again[1])


def test_triangles_have_no_direction_of_their_own():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    sides = [np.linspace(square[k], square[(k + 1) % 4], 25)[:-1] for k in range(4)]
    outline = np.concatenate(sides)
    total = 0.0
    for seed in range(4):
        x, t = triangulate(outline, 1 / 24, seed=seed)
        edges, _, count = edge_table(t)
        way = (x[edges[:, 0]] - x[edges[:, 1]])[count == 2]
        a = np.arctan2(way[:, 1], way[:, 0])
        total += np.exp(6j * a).mean()  # a lattice in one direction has 1 here
    assert abs(total) / 4 < 0.7
    assert abs(np.exp(2j * a).mean()) < 0.05


def test_a_dart_closes_to_a_cone_without_cracks():
    corners = [[-0.2, 0], [0.2, 0], [0.2, 0.3], [0.03, 0.3], [0, 0.12], [-0.03, 0.3], [-0.2, 0.3]]
    pattern = Pattern(
        name="dart",
        panels={"front": panel("front", corners)},
        stitches=(seam(("front", 3), ("front", 4)),),
    )
    check(pattern)
    pieces = cut(pattern, 0.025)
    t = pieces.sewn_triangles
    assert not len(non_manifold_edges(t))
    assert len(boundary_loops(t)) == 1
    v, f = pieces.sewn_count, len(t)
    assert v - len(edge_table(t)[0]) + f == 1


def test_a_tube_has_the_vertices_asked_for_and_two_openings():
    pattern = tube(other=0.5)
    pieces = cut(pattern, edge_length_for(pattern, 900))
    assert pieces.sewn_count == pytest.approx(900, rel=0.05)
    t = pieces.sewn_triangles
    assert not len(non_manifold_edges(t))
    assert len(boundary_loops(t)) == 2
    assert pieces.corners.shape == (len(t), 3, 2)
    # Nothing that is sewn has a vertex on one side only: every seam's pairs are one.
    for pairs in pieces.seams:
        assert np.array_equal(pieces.welded[pairs[:, 0]], pieces.welded[pairs[:, 1]])


def test_a_panel_sewn_on_the_wrong_way_round_makes_no_surface():
    pattern = tube()
    wrong = replace(pattern, stitches=tuple(replace(s, turned=True) for s in pattern.stitches))
    with pytest.raises(GeometryError, match=r"'front'.*'back'|'back'.*'front'"):
        cut(wrong, 0.04)


def test_an_edge_length_larger_than_a_panel_names_it():
    with pytest.raises(ParameterError, match=r"edge_length.*larger than panel 'front'"):
        cut(tube(other=0.5), 0.6)
    with pytest.raises(ParameterError, match="vertices"):
        cut(tube(other=0.5), 1e-4)


@pytest.mark.parametrize("length", [0.0, -0.01, np.nan])
def test_an_edge_length_that_is_none_is_not_called_too_large(length):
    with pytest.raises(ParameterError, match=r"edge_length: found \S+ m; allowed: above 0, up to"):
        cut(tube(other=0.5), length)


def test_a_pattern_that_no_body_fits_into_is_in_another_unit():
    check(tube(width=0.02, height=0.11, other=0.09))
    words = "largest panel, 'front', is 0.05 m long: another unit of length"
    with pytest.raises(GeometryError, match=words):
        check(tube(width=0.02, height=0.05, other=0.04))


def test_the_grain_turns_the_threads():
    pattern = tube(other=0.5)
    pieces = cut(pattern, 0.05)
    turned = {name: replace(p, grain=(1.0, 0.0)) for name, p in pattern.panels.items()}
    on_the_cross = cut(replace(pattern, panels=turned), 0.05)
    straight, cross = pieces.corners, on_the_cross.corners
    assert cross[..., 1] == pytest.approx(straight[..., 0])
    assert cross[..., 0] == pytest.approx(-straight[..., 1])
