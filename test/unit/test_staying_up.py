"""What slid down the body is not called worn."""

from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.pieces import cut
from garment_sim_ros.garment.patterns.sewing import Sewn
from garment_sim_ros.garment.patterns.staying_up import check_up
from test.simple_patterns import tube

SKIN = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.8]])


def lowered(way, at):
    """A tube that was placed from `at` on [m] and rests so much lower."""
    pieces = cut(tube(), 0.1)
    placed = pieces.placed() + np.array([0.0, 0.0, at])
    gone = placed - np.array([0.0, 0.0, way])
    sewn = Sewn(
        vertices=pieces.joined(gone),
        shown=pieces.joined(gone),
        triangles=pieces.sewn_triangles,
        flat=pieces.corners,
        placed=placed,
        closed=gone,
        gaps=(),
        rms_speed=0.0,
        max_speed=0.0,
    )
    return pieces, sewn, SKIN


@pytest.mark.parametrize(("way", "at"), [(0.0, 0.9), (0.5, 1.2), (0.1, 0.1)])
def test_what_sinks_a_little_is_worn(way, at):
    check_up(*lowered(way, at))


def test_a_garment_far_down_the_body_is_named():
    with pytest.raises(GeometryError, match=r"panel 'front' slid down the body by 0\.7\d m and"):
        check_up(*lowered(0.7, 1.0))


def test_a_skirt_around_the_knees_is_named():
    """Its front sank by less than a third of the height; its top is on no hips."""
    check_up(*lowered(0.3, 0.7))
    with pytest.raises(GeometryError, match=r"panel 'front' slid down the body by 0\.45 m and"):
        check_up(*lowered(0.45, 0.7))
    check_up(*lowered(0.05, 0.2))  # it was placed there


def test_a_garment_on_the_floor_is_named():
    pieces, sewn, skin = lowered(0.3, 0.3)
    flat = sewn.vertices * [1.0, 1.0, 0.2]  # in a heap
    heap = replace(sewn, vertices=flat)
    with pytest.raises(GeometryError, match="panel 'front' slid down"):
        check_up(pieces, heap, skin)
    check_up(pieces, sewn, skin)  # a legwarmer at the ankles stands
