"""Tethers, soft attachments and untangling against naive twins; and what watches over motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_attached
from naive import naive_self_collision as naive

from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.sim.holds.tether_kernels import pull_attached, pull_tethers
from garment_sim_ros.sim.holds.tethers import Attached
from garment_sim_ros.sim.motion import measure_motion
from garment_sim_ros.sim.self_collision.expected_motion import drift, expect
from garment_sim_ros.sim.self_collision.untangling import mark_tangled, untangle

SEEDS = st.integers(0, 10**6)


def singles(rng, *shape, scale=1.0):
    return (scale * rng.normal(size=shape)).astype(np.float32)


@given(SEEDS, st.sampled_from([0.0, 60.0]))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_tethers(seed, rate):
    """To several pins each; some far from all, some on a pin, some with none in reach."""
    rng = np.random.default_rng(seed)
    free, pins = 30, 4
    x, v = singles(rng, free + pins, 3), singles(rng, free + pins, 3)
    pin = rng.integers(free, free + pins, (free, 3)).astype(np.int32)
    length = rng.uniform(0.5, 3.0, (free, 3)).astype(np.float32)
    length[:5, 2] = np.inf
    x[0] = x[pin[0, 0]]
    length[1] = 0.0
    exact = x.astype(np.float64), v.astype(np.float64)
    expected = naive_attached.pull_tethers(*exact, pin, length.astype(np.float64), rate)
    assert 5 < expected <= free
    assert pull_tethers(x, v, pin, length, np.float32(rate)) == expected
    np.testing.assert_allclose(x, exact[0], atol=2e-6)
    np.testing.assert_allclose(v, exact[1], atol=2e-6 * max(rate, 1.0))


@given(SEEDS, st.floats(1e-3, 0.1), st.sampled_from([0.0, 1.0]))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_soft_attachments(seed, dt, gains):
    """From none to infinitely stiff; places that are known and such that are not."""
    rng = np.random.default_rng(seed)
    n, s, c = 20, 12, 3
    position, orientation = rng.normal(size=(c, 3)), rng.normal(size=(c, 4))
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    origin = rng.normal(size=3)
    attached = Attached.none()._replace(
        particle=rng.permutation(n)[:s].astype(np.int32),
        collider=rng.integers(0, c, s).astype(np.int32),
        place=rng.normal(size=(s, 3)),
        rate=rng.choice([0.0, 1.0, 1e3, 1e6], (s, 2)),
        target=singles(rng, s, 3),
    )
    attached.rate[0] = [1e18, 0.0]  # what stands for infinite
    attached.rate[1] = [1e18, 1e18]
    attached.target[::3] = np.nan
    x, v = singles(rng, n, 3), singles(rng, n, 3)
    x_start = x - np.float32(dt) * v
    keep = 0.9
    exact, exact_v = x.astype(np.float64), v.astype(np.float64)
    goals = np.zeros((s, 3))
    for k, p in enumerate(attached.particle):
        at = attached.collider[k]
        R = matrix_from_quaternion(orientation[at])
        goals[k] = R @ attached.place[k] + position[at] - origin
        end = naive_attached.spring_end(
            *(exact[p], x_start[p].astype(np.float64), goals[k], attached.target[k]),
            *(*attached.rate[k], keep, dt),
        )
        exact_v[p] += gains / dt * (end - exact[p])
        exact[p] = end
    pull_attached(
        *(x, v, x_start, attached, position, orientation, origin),
        *(keep, dt, np.float32(gains / dt)),
    )
    # Positions of some metres in float32.
    np.testing.assert_allclose(x, exact, atol=2e-6)
    np.testing.assert_allclose(v, exact_v, atol=3e-6 / dt)
    np.testing.assert_allclose(attached.target, goals, atol=1e-6)
    assert attached.held[0] == 0


def test_crossings_part_as_the_twin_has_it():
    """Edges with one or two triangles, pinned ends, edges beside triangles, flat triangles."""
    rng = np.random.default_rng(6)
    moved = still = 0
    for attempt in range(400):
        # Edge 0-1 with the corners 2 and 3, and the triangle 4-5-6.
        x = singles(rng, 7, 3)
        x[1] = -x[0] + 0.3 * singles(rng, 3)
        if attempt % 20 == 0:
            x[6] = x[5]
        if attempt % 20 == 1:
            x[1] = x[0]
        v = singles(rng, 7, 3)
        mass = rng.choice([0.0, 500.0, 2000.0], 7).astype(np.float32)
        has_two = bool(rng.integers(2))
        row = np.array([[0, 1, 2, 3 if has_two else -1, 4, 5, 6]], np.int32)
        exact = [a.astype(np.float64) for a in (x, v, mass)]
        ab, triangle = np.array([0, 1]), np.array([4, 5, 6])
        tangled = np.ones(7, np.bool_)
        crosses = naive.crossing(exact[0], ab, triangle) is not None
        assert mark_tangled(x, row, 1, tangled) == crosses
        assert (tangled == [crosses, crosses, False, False, crosses, crosses, crosses]).all()
        expected = naive.untangle(
            *(*exact, ab, np.array([2, 3][: 1 + has_two]), triangle, 0.01, 0.3)
        )
        assert untangle(x, v, mass, row, 1, np.float32(0.01), np.float32(0.3)) == expected
        np.testing.assert_allclose(x, exact[0], atol=5e-6)
        np.testing.assert_allclose(v, exact[1], atol=2e-4)
        moved += expected
        still += not expected
    assert min(moved, still) > 40


def test_each_crossing_is_met_after_those_before():
    """Two edges through one triangle: the second one finds it where the first one left it."""
    rng = np.random.default_rng(2)
    x = singles(rng, 9, 3, scale=0.02)
    x[:3] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.5, 0.0]]
    x[[3, 6], 2], x[[4, 7], 2] = -0.5, 0.5
    x[5], x[8] = [0.5, 0.1, 0.6], [-0.4, 0.2, -0.7]
    v, mass = singles(rng, 9, 3), np.full(9, 1000.0, np.float32)
    rows = np.array([[3, 4, 5, -1, 0, 1, 2], [6, 7, 8, -1, 0, 1, 2]], np.int32)
    exact = [a.astype(np.float64) for a in (x, v, mass)]
    for a, b, o, _, *triangle in rows.tolist():
        assert naive.untangle(
            *(*exact, np.array([a, b]), np.array([o]), np.array(triangle), 0.01, 0.3)
        )
    assert untangle(x, v, mass, rows, 2, np.float32(0.01), np.float32(0.3)) == 2
    np.testing.assert_allclose(x, exact[0], atol=2e-6)
    np.testing.assert_allclose(v, exact[1], atol=2e-5)


@given(SEEDS, st.floats(1e-3, 0.05), st.integers(1, 20))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_expected_motion(seed, dt, steps):
    rng = np.random.default_rng(seed)
    x, v = singles(rng, 25, 3), singles(rng, 25, 3)
    before = x - np.float32(dt) * v
    far = rng.uniform(0.0, 0.3)
    start, place, speed, way = np.zeros((4, 25, 3), np.float32)
    ahead = expect(before, x, v, np.float32(dt), steps, np.float32(far), start, place, speed, way)
    centred = [a - a.mean(axis=0) for a in (before.astype(float), x.astype(float), v)]
    rms = np.sqrt((centred[2] ** 2).sum() / 25)
    # As far as the way at that speed lasts, rounded down: on a whole number either is right.
    assert {ahead} <= {min(steps, int(far / (dt * rms) + e)) for e in (-1e-4, 1e-4)}
    for found, expected in zip((start, place, speed), centred):
        np.testing.assert_allclose(found, expected, atol=2e-6)
    there = centred[1] + ahead * dt * centred[2]
    np.testing.assert_allclose(way, there - centred[0], atol=2e-6)
    # Later, displaced all together and a little one by one.
    now = x + ahead * np.float32(dt) * v + singles(rng, 3) + singles(rng, 25, 3, scale=0.01)
    now = now.astype(np.float32)
    strayed = np.linalg.norm(now - now.mean(axis=0, dtype=float) - there, axis=1).max()
    assert drift(now, place, speed, np.float32(ahead * dt)) == pytest.approx(strayed, abs=5e-6)


def test_what_is_not_a_number_is_told():
    x = np.zeros((4, 3), np.float32)
    v = x.copy()
    assert drift(x, x, x, np.float32(1.0)) == 0.0
    scratch = [np.zeros((4, 3), np.float32) for _ in range(4)]
    limits = np.float32(0.01), 5, np.float32(0.1)
    assert expect(x, x, v, *limits, *scratch) == 5
    v[2, 1] = np.nan
    assert expect(x, x, v, *limits, *scratch) == -1
    assert not np.isfinite(drift(v, x, x, np.float32(1.0)))


@given(SEEDS)
@settings(derandomize=True, deadline=None, max_examples=10)
def test_sums_of_squared_speeds(seed):
    v = singles(np.random.default_rng(seed), 33, 3)
    motion = np.zeros(2)
    measure_motion(v, motion)
    squared = (v.astype(np.float64) ** 2).sum(axis=1)
    assert motion == pytest.approx([squared.sum(), squared.max()], rel=1e-6)
    measure_motion(v[:0], motion)
    assert (motion == 0.0).all()
