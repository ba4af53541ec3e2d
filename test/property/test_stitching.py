"""Stitches: the kernel beside its naive twin, and what they must not do."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive.naive_stitching import draw_together as naive

from garment_sim_ros.sim.holds.stitching import Stitching, draw_together


def scene(seed, n=40, stitches=9):
    rng = np.random.default_rng(seed)
    x, v = rng.normal(size=(2, n, 3)).astype(np.float32)
    weight = rng.uniform(100.0, 1e4, n).astype(np.float32)
    order = rng.permutation(n).astype(np.int32)
    start = np.concatenate([[0], np.cumsum(rng.integers(2, 5, stitches))]).astype(np.int32)
    member = order[: start[-1]]
    gap = rng.uniform(0.1, 3.0, stitches).astype(np.float32)
    share = rng.choice([0.0, 0.3, 1.0], stitches).astype(np.float32)
    return x, v, weight, member, start, gap, share


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_twin(seed):
    x, v, weight, member, start, gap, share = scene(seed)
    groups = [member[a:b] for a, b in pairwise(start)]
    x64, v64 = x.astype(float), v.astype(float)
    expected = naive(x64, v64, weight.astype(float), groups, gap, share, 0.9, 1e-3)
    moved = draw_together(
        x, v, weight, member, start, gap, share, np.float32(0.9), np.float32(1e-3)
    )
    assert moved == expected
    assert x == pytest.approx(x64, abs=2e-5)
    assert v == pytest.approx(v64, rel=1e-3, abs=2e-2)


@pytest.mark.parametrize("seed", range(5))
def test_momentum_stays_and_gaps_close(seed):
    x, v, weight, member, start, gap, share = scene(seed)
    share[:] = 0.0
    mass = 1.0 / weight.astype(float)
    before = (mass[:, None] * v).sum(axis=0), (mass[:, None] * x).sum(axis=0)
    draw_together(x, v, weight, member, start, gap, share, np.float32(0.9), np.float32(1e-3))
    assert (mass[:, None] * v).sum(axis=0) == pytest.approx(before[0], abs=1e-4)
    assert (mass[:, None] * x).sum(axis=0) == pytest.approx(before[1], abs=1e-6)
    for a, b in pairwise(start):
        assert np.ptp(x[member[a:b]], axis=0) == pytest.approx(0.0, abs=1e-5)


def test_nothing_moves_as_stitches_begin_whatever_particles_weigh():
    """Vertices at the corner of a panel weigh a sixth of those inside."""
    x, v, weight, member, start, *_ = scene(3)
    stitch = np.full(len(x), -1, np.int32)
    for k, (a, b) in enumerate(pairwise(start)):
        stitch[member[a:b]] = k
    model = SimpleNamespace(vertex=np.arange(len(x)), inverse_mass=weight)
    v[:] = 0.0
    state = SimpleNamespace(x=x.copy(), v=v)
    Stitching(model, stitch).hold(state, 0.0, 1e-6)
    assert state.x == pytest.approx(x, abs=1e-5)
