"""Minimum volume enclosing ellipsoids: containment, optimality, equivariance, degenerate sets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.mvee import Ellipsoid, mvee

SETTINGS = settings(derandomize=True, deadline=None, max_examples=30)
seeds = st.integers(0, 2**32 - 1)


def cloud(seed: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    spread = 10.0 ** rng.uniform(-3.0, 0.0, 3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return rng.normal(size=(count, 3)) * spread @ turn + rng.normal(size=3)


@SETTINGS
@given(seeds, st.integers(1, 400))
def test_contains_every_point(seed, count):
    points = cloud(seed, count)
    e = mvee(points)
    offset = points - e.centre
    assert (e.zeta(points) <= 1.0).all()
    assert (np.einsum("ni,ij,nj->n", offset, e.Q, offset) <= 1.0 + 1e-9).all()
    assert np.allclose(e.axes.T @ e.axes, np.eye(3), atol=1e-9)
    assert np.linalg.det(e.axes) > 0.0
    assert (np.diff(e.radii) <= 0.0).all()


@SETTINGS
@given(seeds, st.integers(8, 200))
def test_is_optimal(seed, count):
    """John's conditions: weights on the touching points reproduce centre and shape."""
    from scipy.optimize import nnls

    points = cloud(seed, count)
    e = mvee(points, tolerance=1e-9)
    local = (points - e.centre) @ e.to_ball.T
    touching = local[np.linalg.norm(local, axis=1) > 1.0 - 1e-4]
    # sum w = 3, sum w u = 0, sum w u u^T = identity, w >= 0
    rows = [np.ones(len(touching)), *touching.T]
    rows += [touching[:, i] * touching[:, j] for i in range(3) for j in range(i, 3)]
    wanted = np.array([3.0, 0, 0, 0, 1, 0, 0, 1, 0, 1])
    _, residual = nnls(np.array(rows), wanted)
    assert residual < 2e-3


@SETTINGS
@given(seeds, st.integers(8, 100))
def test_affine_equivariance(seed, count):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    A = rng.normal(size=(3, 3)) + 2.0 * np.eye(3)
    shift = rng.normal(size=3)
    if abs(np.linalg.det(A)) < 0.1:
        return
    plain, mapped = mvee(points, tolerance=1e-9), mvee(points @ A.T + shift, tolerance=1e-9)
    inverse = np.linalg.inv(A)
    assert np.allclose(mapped.centre, A @ plain.centre + shift, atol=1e-4)
    expected = inverse.T @ plain.Q @ inverse
    assert np.allclose(mapped.Q, expected, rtol=1e-3, atol=1e-4 * np.abs(expected).max())


@SETTINGS
@given(seeds)
def test_recovers_an_ellipsoid(seed):
    rng = np.random.default_rng(seed)
    radii = np.sort(rng.uniform(0.05, 1.0, 3))[::-1]
    u = rng.normal(size=(600, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    e = mvee(u * radii, tolerance=1e-5)
    assert np.allclose(e.radii, radii, rtol=0.02)
    assert e.volume <= 4.0 / 3.0 * np.pi * np.prod(radii) * 1.0001
    assert e.radial_error(u * radii).max() < 0.03 * radii[0]


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_cube_and_degenerate_sets(scale):
    cube = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T * scale
    assert np.allclose(mvee(cube, tolerance=1e-9).radii, np.sqrt(3.0) * scale)
    flat = mvee(cube * [1.0, 1.0, 0.0])
    assert np.allclose(flat.radii[:2], np.sqrt(2.0) * scale, rtol=2e-3)
    assert flat.radii[2] < 2e-3 * scale + 2e-4
    needle = mvee(cube * [1.0, 0.0, 0.0])
    assert needle.radii[0] == pytest.approx(scale, rel=2e-3)
    for points in (cube[:1], cube[:2], cube[:3], np.repeat(cube[:2], 5, axis=0)):
        e = mvee(points)
        assert np.isfinite(e.radii).all()
        assert (e.radii > 0.0).all()
        assert (e.zeta(points) <= 1.0).all()


@pytest.mark.parametrize("aspect", [1e-2, 1e-4, 1e-6, 1e-8, 1e-12])
def test_nearly_flat(aspect):
    points = np.random.default_rng(1).normal(size=(100, 3)) * [1.0, 0.7, aspect]
    e = mvee(points)
    assert (e.zeta(points) <= 1.0).all()
    assert e.radii[2] < max(40.0 * aspect, 1.1e-3)


def test_refuses_nothing_and_nan():
    for bad in (np.zeros((0, 3)), np.array([[0.0, np.nan, 0.0]])):
        with pytest.raises(GeometryError):
            mvee(bad)


def test_radial_error_of_a_point_at_the_centre_is_finite():
    e = Ellipsoid(np.zeros(3), np.eye(3), np.array([3.0, 2.0, 1.0]))
    assert e.radial_error(np.array([[0.0, 0, 0], [6.0, 0, 0]])) == pytest.approx([1.0, 3.0])
