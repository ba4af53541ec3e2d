"""Cloth whose heavy particles hang by light ones: what hangs by which edge, and how far."""

from itertools import pairwise

import numpy as np
import pytest

from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers.xpbd import step, workspace
from garment_sim_ros.sim.solvers.xpbd.hanging import _flows, lag
from garment_sim_ros.stability import extremes

ROWS = 9


def graded(ratio, extra=None):
    """A square sheet, pinned above, where threads get closer; masses differ by a ratio."""
    closer = np.geomspace(1.0, 1.0 / np.sqrt(ratio), ROWS - 1)[::-1]
    at = np.concatenate([[0.0], np.cumsum(closer)])
    side = extremes.SIDE
    vertices, triangles = extremes.woven(side * at / at[-1], side * (at / at[-1] - 0.5))
    vertices = extremes.hanging(vertices)
    if extra is not None:
        triangles = np.concatenate([triangles, len(vertices) + np.arange(3)[None]]).astype(
            np.int32
        )
        vertices = np.concatenate([vertices, extra])
    return extremes.garment(vertices, triangles, range(ROWS))


def model_of(garment):
    colliders = extremes.curtain()[1]
    return Simulation(garment, colliders)[garment.name].model


def edges_of(model):
    springs = model.springs
    ends = springs.particles.reshape(-1, 2)[springs.bending :].astype(int)
    return ends, springs.rest_length[springs.bending :].astype(float)


@pytest.mark.parametrize("ratio", [1.0, 1e2, 1e6])
def test_all_that_is_below_a_cut_hangs_by_the_edges_through_it(ratio):
    model = model_of(graded(ratio))
    ends, length = edges_of(model)
    hangs = _flows(ends, length, model.mass.astype(float), model.free_count)
    z = model.rest[:, 2]
    rows = np.unique(np.round(z, 9))
    for low, high in pairwise(rows):
        cut = 0.5 * (low + high)
        lower = (z[ends] < cut) @ [-1, 1]
        assert lower @ hangs == pytest.approx(model.mass[z < cut].sum(), rel=1e-5)


def test_a_part_without_a_pin_hangs_by_nothing():
    apart = np.array([[2.0, 0.0, 0.0], [2.1, 0.0, 0.0], [2.0, 0.1, 0.0]])
    model = model_of(graded(1.0, apart))
    ends, length = edges_of(model)
    hangs = _flows(ends, length, model.mass.astype(float), model.free_count)
    alone = (model.rest[ends][..., 0] > 1.0).all(axis=1)
    assert alone.sum() == 3
    assert np.isfinite(hangs).all()
    assert np.abs(hangs[alone]).max() < 1e-6 * hangs.max()


def test_what_hangs_by_nothing_does_not_lag():
    sheet = extremes.garment(*extremes.sheet(5))
    assert lag(model_of(sheet)) == 0.0


@pytest.mark.parametrize("side", [5, 60])
def test_even_cloth_does_not_lag(side):
    vertices, triangles = extremes.sheet(side)
    garment = extremes.garment(extremes.hanging(vertices), triangles, range(side))
    assert lag(model_of(garment)) < 0.01 * step._LAGS


def test_small_triangles_that_hold_next_to_nothing_do_not_count():
    """A narrow column beside others, which bear what it does not."""
    even = np.linspace(0.0, 0.6, 13)
    fine = np.sort(np.concatenate([even, [0.299, 0.301]]))
    lags = []
    for across in (even, fine):
        vertices, triangles = extremes.woven(even, across - 0.3)
        sheet = extremes.garment(extremes.hanging(vertices), triangles, range(len(across)))
        lags.append(lag(model_of(sheet)))
    assert max(lags) < step._LAGS


@pytest.mark.parametrize(("ratio", "long"), [(1e4, 1.08), (1e6, 1.5)])
def test_heavy_particles_that_hang_by_light_ones_hang_no_longer(ratio, long, monkeypatch):
    def stretch():
        """The 95th percentile over edges, after the weight has come on them and swung out."""
        garment = graded(ratio)
        colliders, motion = extremes.curtain()[1:]
        simulation = Simulation(garment, colliders)
        poses = motion(5.0)
        simulation.reset(poses)
        for _ in range(60):
            simulation.step(poses, 1 / 60)
        ends, length = edges_of(model := model_of(garment))
        x = simulation[garment.name].positions[model.vertex].astype(float)
        return np.percentile(np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1) / length, 95)

    assert stretch() < 1.05
    monkeypatch.setattr(workspace, "lag", lambda model: 0.0)
    assert stretch() > long
