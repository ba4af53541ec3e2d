"""Particles against ellipsoids: the three errors of the paper's Fig. 6, order, a plain twin."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.contact.kinds.ellipsoid import ellipsoid_bound, nearest_on_ellipsoid
from garment_sim_ros.contact.papers.earliest.hit import collide_earliest
from garment_sim_ros.contact.papers.earliest.poses import PosedEllipsoids
from garment_sim_ros.errors import GeometryError

SETTINGS = settings(derandomize=True, deadline=None, max_examples=40)
seeds = st.integers(0, 2**32 - 1)
DT = 0.01
SINGLE = 1e-6
"""Positions within a block of some metres are in single precision [m]."""
SPEED = 1e-6 / DT


def balls(*centres, radii=(1.0, 1.0, 1.0)):
    centres = np.array(centres, dtype=float)
    m = len(centres)
    return PosedEllipsoids(centres, np.tile(np.eye(3), (m, 1, 1)), np.tile(radii, (m, 1)))


def move(ellipsoids, p0, p1, end=None, **options):
    """Positions, velocities and hits after one step."""
    p0, p1 = np.atleast_2d(p0).astype(float), np.atleast_2d(p1).astype(float)
    x, v = p1.copy(), (p1 - p0) / DT
    hit = collide_earliest(ellipsoids, end or ellipsoids, p0, x, v, DT, **options)
    return x, v, hit


def lowest_zeta(e, points):
    local = np.einsum("kji,nkj->nki", e.axes, points[:, None] - e.centre) / e.radii
    return (local**2).sum(axis=-1).min(axis=1)


def random_scene(seed, count=8):
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    start = PosedEllipsoids(
        rng.uniform(-0.3, 0.3, (count, 3)), axes, rng.uniform(0.05, 0.25, (count, 3))
    )
    end = PosedEllipsoids(start.centre + rng.normal(size=(count, 3)) * 0.01, axes, start.radii)
    p0 = rng.uniform(-0.6, 0.6, (60, 3))
    return start, end, p0, p0 + rng.normal(size=(60, 3)) * 0.2


def test_case_1_in_both_at_the_end_earliest_wins_in_any_order():
    p0, p1 = [-3.0, 0.2, 0.0], [0.0, 0.2, 0.0]
    for centres in itertools.permutations([[-0.6, 0.0, 0.0], [0.6, 0.0, 0.0]]):
        x, _, hit = move(balls(*centres), p0, p1, response="reflection")
        assert centres[hit[0]] == [-0.6, 0.0, 0.0]
        assert x[0] == pytest.approx([-0.6 - np.sqrt(1.0 - 0.04), 0.2, 0.0], abs=SINGLE)


def test_case_2_pushed_out_of_one_is_not_left_in_the_other():
    e = balls([-0.5, 0.0, 0.0], [0.5, 0.0, 0.0])
    x, _, hit = move(e, [0.1, 3.0, 0.0], [-0.1, 0.3, 0.0])
    assert hit[0] >= 0
    assert lowest_zeta(e, x)[0] >= 1.0 - 2e-5
    assert x[0, 1] > 0.5


@pytest.mark.parametrize("response", ["surface", "inelastic", "reflection"])
def test_case_3_stays_on_its_side(response):
    e = balls([0.0, 0.0, 0.0], radii=(1.0, 0.05, 1.0))
    # Ends beyond the middle, and beyond the whole ellipsoid.
    for end in (-0.03, -0.5):
        x, _, hit = move(e, [0.1, 0.5, 0.2], [0.1, end, 0.2], response=response)
        assert hit[0] == 0
        assert x[0, 1] > 0.0
        assert lowest_zeta(e, x)[0] >= 1.0 - 2e-5


def naive_earliest(start, end, p0, p1):
    """First hit by small steps of time; index and time."""
    for t in np.linspace(0.0, 1.0, 4001):
        for k in range(len(start.centre)):
            q = [
                (e.axes[k].T @ (p - e.centre[k])) / e.radii[k] for e, p in ((start, p0), (end, p1))
            ]
            if np.linalg.norm(q[0] + t * (q[1] - q[0])) < 1.0:
                return k, t
    return -1, 1.0


@settings(derandomize=True, deadline=None, max_examples=3)
@given(seeds)
def test_plain_twin(seed):
    start, end, p0, p1 = random_scene(seed, 4)
    outside = np.flatnonzero(lowest_zeta(start, p0) > 1.01)[:12]
    x, _, hit = move(start, p0[outside], p1[outside], end, response="reflection")
    for i, p in enumerate(outside):
        k, t = naive_earliest(start, end, p0[p], p1[p])
        if k < 0:
            # The small steps may miss a graze.
            if hit[i] < 0:
                assert (x[i] == p1[p]).all()
            continue
        assert hit[i] == k
        q0 = start.axes[k].T @ (p0[p] - start.centre[k]) / start.radii[k]
        q1 = end.axes[k].T @ (p1[p] - end.centre[k]) / end.radii[k]
        at = end.centre[k] + end.axes[k] @ ((q0 + t * (q1 - q0)) * end.radii[k])
        # Where the hit ends inside another one that has moved, it goes on from there.
        if lowest_zeta(end, at[None])[0] > 0.999:
            assert x[i] == pytest.approx(at, abs=2e-3)


@SETTINGS
@given(seeds)
def test_nobody_ends_inside_and_order_does_not_matter(seed):
    start, end, p0, p1 = random_scene(seed)
    order = np.random.default_rng(seed + 1).permutation(len(start.centre))
    shuffled = [
        PosedEllipsoids(e.centre[order], e.axes[order], e.radii[order]) for e in (start, end)
    ]
    for response in ("surface", "inelastic", "reflection"):
        x, v, hit = move(start, p0, p1, end, response=response)
        assert lowest_zeta(end, x).min() >= 1.0 - 2e-5
        x2, v2, hit2 = move(shuffled[0], p0, p1, shuffled[1], response=response)
        assert (x == x2).all()
        assert (v == v2).all()
        assert (hit == np.where(hit2 >= 0, order[hit2], -1)).all()


@SETTINGS
@given(seeds)
def test_start_inside_leaves_by_a_short_way(seed):
    """Not longer than the way to the nearest point of the union's surface, by brute force."""
    start, _, p0, _ = random_scene(seed, 3)
    inside = p0[lowest_zeta(start, p0) < 0.9]
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(4000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    surface = np.concatenate(
        [c + (u * r) @ R.T for c, R, r in zip(start.centre, start.axes, start.radii)]
    )
    surface = surface[lowest_zeta(start, surface) > 1.0 - 1e-9]
    for p in inside:
        x, _, _ = move(start, p, p)
        assert lowest_zeta(start, x)[0] >= 1.0 - 2e-5
        shortest = np.linalg.norm(surface - p, axis=1).min()
        single = [
            e
            for e in range(3)
            if lowest_zeta(
                PosedEllipsoids(start.centre[[e]], start.axes[[e]], start.radii[[e]]), p[None]
            )[0]
            < 1.0
        ]
        factor = 1.05 if len(single) == 1 else 2.5
        assert np.linalg.norm(x[0] - p) < factor * shortest + 0.01


def test_responses():
    e = balls([0.0, 0.0, 0.0], radii=(2.0, 1.0, 1.0))
    p0, p1 = np.array([1.0, 3.0, 0.0]), np.array([1.0, 0.0, 0.0])
    at = np.array([1.0, np.sqrt(0.75), 0.0])
    true = at / [4.0, 1.0, 1.0]
    true /= np.linalg.norm(true)
    speed = (p1 - p0) / DT

    x, v, _ = move(e, p0, p1, response="reflection")
    printed = at / np.linalg.norm(at)
    assert x[0] == pytest.approx(at, abs=SINGLE)
    assert v[0] == pytest.approx(speed - 2.0 * (speed @ printed) * printed, abs=SPEED)

    x, v, _ = move(e, p0, p1, response="inelastic")
    assert v[0] == pytest.approx(speed - (speed @ true) * true, abs=SPEED)
    x, v, _ = move(e, p0, p1, restitution=0.5, friction=0.0)
    assert v[0] @ true == pytest.approx(-0.5 * (speed @ true), abs=SPEED)
    x, v, _ = move(e, p0, p1, friction=10.0)
    assert v[0] == pytest.approx([0.0, 0.0, 0.0], abs=SPEED)
    assert x[0] == pytest.approx(at, abs=SINGLE)


@pytest.mark.parametrize("response", ["surface", "inelastic", "reflection"])
def test_a_leaving_particle_is_let_go(response):
    e = balls([0.0, 0.0, 0.0])
    x, v, hit = move(e, [0.0, 1.0, 0.0], [0.0, 2.0, 0.3], response=response)
    assert hit[0] == -1
    assert x[0] == pytest.approx([0.0, 2.0, 0.3])
    assert v[0] == pytest.approx([0.0, 100.0, 30.0])


def test_rides_a_moving_ellipsoid():
    start, end = balls([0.0, 0.0, 0.0]), balls([0.0, 0.1, 0.0])
    x, v, hit = move(start, [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], end, response="inelastic")
    assert hit[0] == 0
    assert x[0] == pytest.approx([0.0, 1.1, 0.0], abs=SINGLE)
    assert v[0] == pytest.approx([0.0, 10.0, 0.0], abs=SPEED)


def test_bad_input():
    e = balls([0.0, 0.0, 0.0])
    with pytest.raises(GeometryError, match="reflection"):
        move(e, [2.0, 0, 0], [0.0, 0, 0], response="bounce")
    with pytest.raises(GeometryError, match="positive"):
        balls([0.0, 0.0, 0.0], radii=(1.0, 0.0, 1.0))
    none = PosedEllipsoids(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    x, _, hit = move(none, [2.0, 0, 0], [0.0, 0, 0])
    assert hit[0] == -1
    assert (x == 0.0).all()


@SETTINGS
@given(seeds)
def test_nearest_point_of_an_ellipsoid(seed):
    """On the surface, with the way along the normal, and no sampled point is nearer."""
    rng = np.random.default_rng(seed)
    radii = 10.0 ** rng.uniform(-2.0, 0.0, 3)
    p = rng.normal(size=3) * radii * rng.choice([0.3, 1.0, 3.0])
    x = nearest_on_ellipsoid(*p, *radii)
    s, n = np.array(x[:3]), np.array(x[3:])
    assert ((s / radii) ** 2).sum() == pytest.approx(1.0, abs=1e-6)
    way = p - s
    assert np.linalg.norm(way - (way @ n) * n) < 2e-3 * max(radii.max(), np.linalg.norm(way))
    u = rng.normal(size=(3000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    assert np.linalg.norm(u * radii - p, axis=1).min() > np.linalg.norm(way) - 1e-3 * radii.max()


@pytest.mark.parametrize("axis", range(3))
def test_nearest_from_the_centre_and_on_symmetry_planes(axis):
    radii = np.array([0.5, 0.3, 0.1])
    s = np.array(nearest_on_ellipsoid(0.0, 0.0, 0.0, *radii)[:3])
    assert np.linalg.norm(s) == pytest.approx(0.1, rel=1e-3)
    p = np.zeros(3)
    p[axis] = 2.0
    s = np.array(nearest_on_ellipsoid(*p, *radii)[:3])
    assert s[axis] == pytest.approx(radii[axis], rel=1e-5)


def test_bound_holds_the_ellipsoid():
    rng = np.random.default_rng(0)
    u = rng.normal(size=(2000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    for radii in itertools.permutations((0.5, 0.3, 0.1)):
        b = np.array(ellipsoid_bound(radii))
        start, way = b[:3], b[3:6] - b[:3]
        p = u * radii
        t = np.clip(((p - start) @ way) / (way @ way), 0.0, 1.0)
        assert np.linalg.norm(p - start - t[:, None] * way, axis=1).max() <= b[6] + 1e-9
