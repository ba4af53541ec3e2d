"""A body that is moving in its first poses has its garments moving with it."""

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.sim import putting_on


@pytest.fixture(scope="module")
def avatar():
    return gs.Avatar.load("mannequin")


def left_behind(avatar, speed):
    """How far the skirt of a body that glides forwards lags behind after 0.1 s [m]."""
    outfit = avatar.dress("tshirt_short_skirt")
    simulation = gs.Simulation(outfit, avatar.colliders)
    T = next(avatar.joints("walk", seconds=0.0)).copy()
    simulation.reset(avatar.poses(T))
    before = simulation["skirt"].positions.astype(float).copy()
    for _ in range(6):
        T[:, 0, 3] += speed / 60.0
        simulation.step(avatar.poses(T), dt=1 / 60)
    moved = simulation["skirt"].positions - before
    return float(np.abs(moved - [0.1 * speed, 0.0, 0.0]).max())


def test_a_gliding_body_is_as_one_that_stands(avatar):
    # Galilean invariance; drag of air slows cloth by 1 m/s^2 at this speed.
    assert left_behind(avatar, 0.0) < 0.01
    assert left_behind(avatar, 3.0) < 0.02


def test_garments_at_rest_would_be_left_behind(avatar, monkeypatch):
    monkeypatch.setattr(putting_on, "_FASTEST", 0.0)
    assert left_behind(avatar, 3.0) > 0.05


def test_what_was_put_elsewhere_is_not_in_motion(avatar):
    # 12 m/s in the first frame is no person.
    assert left_behind(avatar, 12.0) > 0.1
