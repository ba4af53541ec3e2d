"""Which cores belong outside of which triangles."""

import numpy as np
import pytest

from garment_sim_ros.contact.guard.outside import outside
from garment_sim_ros.contact.sides import LET_GO, OPPOSED, PASSING, UNDER

AROUND, DOWN, RADIUS, LENGTH = 24, 8, 0.15, 0.4


def trunk_of_a_shirt():
    """A tube about z, outer faces outward: particles [n, 3] and triangles [t, 3]."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    ring = RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    x = np.array([[*xy, z] for z in np.linspace(0.0, LENGTH, DOWN) for xy in ring])
    k, i = np.meshgrid(np.arange(DOWN - 1), np.arange(AROUND), indexing="ij")
    a, b = (k * AROUND + i).ravel(), (k * AROUND + (i + 1) % AROUND).ravel()
    c, d = a + AROUND, b + AROUND
    return x, np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)]).astype(np.int32)


SPINE = [[0.0, 0.0, 0.1], [0.0, 0.0, 0.3]]
ARM = [[0.25, 0.0, 0.0], [0.25, 0.0, 0.4]]
SHOULDERS = [[-0.12, 0.0, 0.45], [0.12, 0.0, 0.45]]
HEAD = [[0.0, 0.0, 1.0], [0.0, 0.0, 1.1]]
LONGEST = 1.0
UNKNOWN = [[np.nan] * 3] * 2


@pytest.mark.parametrize(
    ("core", "side", "expected"),
    [
        (SPINE, UNDER, "none"),
        (ARM, UNDER, "none"),
        (ARM, OPPOSED, "those that face it"),
        (SHOULDERS, OPPOSED, "none"),
        (HEAD, OPPOSED, "all"),
        (SPINE, OPPOSED, "none"),
        (UNKNOWN, OPPOSED, "all"),
        (SPINE, PASSING, "all"),
        (SPINE, LET_GO, "all"),
    ],
)
def test_a_core_is_outside_of_what_faces_it(core, side, expected):
    x, triangles = trunk_of_a_shirt()
    sides = np.full((1, len(x)), side, np.int8)
    (found,), (either,) = outside(sides, np.array([core]), triangles, x, LONGEST)
    facing = x[triangles].mean(axis=1)[:, 0] > 0.9 * RADIUS
    averted = x[triangles].mean(axis=1)[:, 0] < 0.2 * RADIUS
    if expected == "those that face it":
        assert found[facing].all()
        assert not found[averted].any()
    else:
        assert found.all() if expected == "all" else not found.any()
    # What is against a part of the cloth, and not outside of it, may be on either side.
    assert np.array_equal(either, ~found if side == OPPOSED else np.zeros_like(found))


def test_most_corners_that_are_free_decide():
    x, triangles = trunk_of_a_shirt()
    free = len(x) - AROUND  # those of the uppermost ring are pinned
    sides = np.full((1, free), PASSING, np.int8)
    sides[0, :AROUND] = UNDER
    (found,), _ = outside(sides, np.array([SPINE]), triangles, x, LONGEST)
    passing = np.count_nonzero((triangles >= AROUND) & (triangles < free), axis=1)
    under = np.count_nonzero(triangles < AROUND, axis=1)
    assert np.array_equal(found, passing > under)
