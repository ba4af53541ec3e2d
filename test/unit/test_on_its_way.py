"""Cloth that was put elsewhere is shown on its way there."""

import numpy as np
import pytest

from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.sim.on_its_way import OnItsWay

FRAME = 1 / 60
FASTEST = 0.036, 0.05
"""What a point may move in a frame on a way of up to 48 cm, and of up to 69 cm [m]."""
LAST = 15
"""Frames after which all have arrived: 0.23 s and the rest of a frame."""


@pytest.fixture
def cloth_on_a_bone(cloth):
    return Garment.from_mesh(*cloth.grid(4, 4), name="cloth", bone="bone")


def frame(turn=0.0):
    """The bone, turned about z [rad]."""
    T = np.eye(4)[None].copy()
    T[0, :2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    return T


def shown(way):
    """Where points are seen whose place is the world's origin."""
    x = np.zeros((16, 3), np.float32)
    way.add_to(x)
    return x


def gone(garment, off, frames=30, turn=0.0):
    """Where they are seen, frame by frame, with a bone that turns so far in each [rad]."""
    way = OnItsWay(garment)
    way.begin(off, frame())
    seen = [shown(way)]
    for n in range(frames):
        way.go(FRAME, frame((n + 1) * turn))
        seen.append(shown(way))
    return np.array(seen)


def offsets(longest):
    off = np.random.default_rng(0).normal(size=(16, 3))
    return off * longest / np.linalg.norm(off, axis=1).max()


@pytest.mark.parametrize("longest", [0.02, 0.24, 0.48, 0.68])
def test_no_point_jumps_and_all_arrive(cloth_on_a_bone, longest):
    off = offsets(longest)
    seen = gone(cloth_on_a_bone, off)
    np.testing.assert_allclose(seen[0], off, atol=1e-6)
    assert np.linalg.norm(np.diff(seen, axis=0), axis=2).max() < FASTEST[longest > 0.48]
    arrived = np.flatnonzero((seen == 0.0).all(axis=(1, 2)))[0]
    assert arrived <= min(longest / 0.035 + 1, LAST)


def test_shapes_on_the_way_are_between_the_two(cloth_on_a_bone):
    """All points go the same part of their ways, so that edges are no longer than at the ends."""
    off = offsets(0.3)
    for x in gone(cloth_on_a_bone, off)[:8]:
        left = np.linalg.norm(x, axis=1) / np.linalg.norm(off, axis=1)
        assert np.ptp(left) < 1e-5


def test_what_is_far_takes_no_longer(cloth_on_a_bone):
    seen = gone(cloth_on_a_bone, offsets(20.0))
    assert not seen[LAST:].any()


def test_it_turns_with_the_skin(cloth_on_a_bone):
    """A way along x is one along y where the bone has turned by a right angle."""
    off = np.tile([0.3, 0.0, 0.0], (16, 1))
    seen = gone(cloth_on_a_bone, off, frames=6, turn=np.pi / 12)
    assert np.abs(seen[6][:, 0]).max() < 1e-6
    assert (seen[6][:, 1] > 0.05).all()


@pytest.mark.parametrize("off", [0.0, np.nan, np.inf])
def test_without_a_way_it_is_where_it_is(cloth_on_a_bone, off):
    assert not gone(cloth_on_a_bone, np.full((16, 3), off), frames=2).any()
