"""A body without bones, parted for trousers."""

from types import SimpleNamespace

import numpy as np
import pytest

from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.garment.patterns.parted import has_legs, parted

CELL = 0.02
NODES = CELL * (np.indices((21, 21, 51)).reshape(3, -1).T - [10.0, 10.0, 25.0])
"""A grid about its middle, which is 0.5 m above the floor."""


@pytest.fixture(scope="module")
def parts():
    """A capsule of 0.1 m from the floor to 1 m, parted at 0.4 m and at y = 0."""
    to_axis = np.hypot(NODES[:, 0], NODES[:, 1])
    beyond = np.maximum(np.abs(NODES[:, 2]) - 0.3, 0.0)
    grid = DistanceGrid.sampled(CELL, (np.hypot(to_axis, beyond) - 0.1).reshape(21, 21, 51))
    body = Collider(name="body", kind="sdf", bone="root", geometry=grid.geometry())
    still = ColliderPoses.identity(1)
    still.position[0, 2] = 0.5
    made = parted(ColliderSet(colliders=(body,)), still, 0.4, 0.0)
    return grid, {c.name: DistanceGrid.of(c.geometry) for c in made.colliders}


def test_parts_are_the_whole_together(parts):
    whole, made = parts
    assert list(made) == ["body_trunk", "body_left_leg", "body_right_leg"]
    places = np.random.default_rng(0).uniform([-0.15, -0.15, -0.4], [0.15, 0.15, 0.4], (4000, 3))
    nearest = np.min([grid.value(places) for grid in made.values()], axis=0)
    outside = whole.value(places) > 0.001
    assert (nearest[outside] > 0.0).all()
    inside = (whole.value(places) < -0.02) & (np.abs(places[:, 1]) > 0.02)
    assert (nearest[inside] < 0.0).all()


def test_legs_are_on_their_sides_and_below(parts):
    _, made = parts
    up = np.array([[0.0, 0.05, 0.2], [0.0, 0.05, -0.3], [0.0, -0.05, -0.3]])
    signs = {name: np.sign(grid.value(up)).tolist() for name, grid in made.items()}
    assert signs == {
        "body_trunk": [-1.0, 1.0, 1.0],
        "body_left_leg": [1.0, -1.0, 1.0],
        "body_right_leg": [1.0, 1.0, -1.0],
    }


def test_openings_that_touch_are_no_legs():
    x = np.array([[0.0, y, 0.3] for y in (-0.2, -0.1, 0.0, 0.1, 0.2)])
    pieces = SimpleNamespace(
        welded=np.arange(5),
        sewn_triangles=np.array([[0, 1, 2], [2, 3, 4]], np.int32),
        placed=lambda: x,
    )
    assert not has_legs(pieces, np.array([[0.0, -0.5, 0.0], [0.0, 0.5, 1.7]]))
