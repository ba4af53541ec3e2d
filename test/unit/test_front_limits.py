"""The judge of `make front`: figures beyond their limits are told, each of them."""

import math

import pytest


@pytest.fixture(scope="module")
def front(bench):
    return bench("front")


def test_figures_at_their_limits_are_well(front):
    assert front.worse(front.LIMITS, front.LIMITS) == []
    zeros = {scene: dict.fromkeys(limits, 0.0) for scene, limits in front.LIMITS.items()}
    assert front.worse(zeros, front.LIMITS) == []


def test_each_figure_can_fail_it(front):
    for scene, limits in front.LIMITS.items():
        for name, limit in limits.items():
            for bad in (limit + 1e-3, math.inf, math.nan):
                found = {scene: {**limits, name: bad}}
                (line,) = front.worse(found, front.LIMITS)
                assert line.startswith(f"{scene}: {name} is ")
            missing = {scene: {k: v for k, v in limits.items() if k != name}}
            assert len(front.worse(missing, front.LIMITS)) == 1


def test_every_preset_that_is_a_point_has_limits(front):
    assert {"fast", "balanced", "accurate"} <= set(front.LIMITS)
    for scene in ("fast", "balanced", "accurate"):
        assert front.LIMITS[scene]["pierced"] == 0.0
