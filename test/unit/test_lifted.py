"""Hems that hands lift: cases of known answer, and a walk in which hands pass a skirt."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def lifted(bench):
    return bench("lifted").lifted


def hem(high, count=100, length=0.3):
    """A ring of a skirt's hem, so many points of which hang at half of its length."""
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    below = np.full(count, length)
    below[:high] = 0.5 * length
    x = np.stack([0.2 * np.cos(turn), 0.2 * np.sin(turn), 1.0 - below], axis=1)
    return below, np.full(count, length), x


def test_a_hem_that_hangs_is_not_lifted_wherever_the_hand_is(lifted):
    below, as_skin, x = hem(0)
    assert lifted(below, as_skin, x, x[:5]) == 0.0


@pytest.mark.parametrize("high", [1, 12, 30])
def test_what_hangs_too_high_beside_a_hand_counts(lifted, high):
    below, as_skin, x = hem(high)
    assert lifted(below, as_skin, x, x[:high] + 0.05) == pytest.approx(high / 100)


def test_what_legs_or_speed_lift_does_not_count(lifted):
    below, as_skin, x = hem(30)
    far = x[:30] + np.array([0.0, 0.0, 0.3])
    assert lifted(below, as_skin, x, far) == 0.0
    assert lifted(below, as_skin, x, np.zeros((0, 3))) == 0.0


def test_only_points_near_the_hand_count(lifted):
    below, as_skin, x = hem(50)
    share = lifted(below, as_skin, x, x[:1])
    within = np.linalg.norm(x[:50] - x[0], axis=1) < 0.1
    assert share == pytest.approx(within.sum() / 100)
    assert 0.0 < share < 0.2


def test_upside_down_no_hem_is_lifted(lifted):
    below, as_skin, x = hem(30)
    assert lifted(-below, -as_skin, x, x) == 0.0
