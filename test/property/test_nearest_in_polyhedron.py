"""Nearest point of a polyhedron against scipy's quadratic programming."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize

from garment_sim_ros.geometry.nearest_in_polyhedron import nearest_in_polyhedron


@settings(derandomize=True, deadline=None, max_examples=60)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 30), shift=st.floats(-0.4, 1.0))
def test_it_is_the_optimum(seed, count, shift):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    planes = np.column_stack([normals, rng.uniform(shift - 0.5, shift + 0.5, count)])
    target = rng.normal(size=3) * 2
    x = np.full(3, np.inf)
    found = nearest_in_polyhedron(planes, count, target, 1e-9, x)
    lp = linprog(
        [0, 0, 0, 1],
        A_ub=np.column_stack([normals, -np.ones(count)]),
        b_ub=planes[:, 3],
        bounds=[(-50, 50)] * 3 + [(None, None)],
    )
    if abs(lp.fun) < 1e-6:
        return  # on the edge of having a solution at all
    assert found == (lp.fun < 0)
    if found:
        assert (normals @ x - planes[:, 3]).max() < 1e-7
        reference = minimize(
            lambda y: ((y - target) ** 2).sum(),
            lp.x[:3],
            jac=lambda y: 2 * (y - target),
            constraints={
                "type": "ineq",
                "fun": lambda y: planes[:, 3] - normals @ y,
                "jac": lambda y: -normals,
            },
            method="SLSQP",
            options={"maxiter": 500, "ftol": 1e-14},
        )
        assert np.linalg.norm(x - target) <= np.linalg.norm(reference.x - target) + 1e-5


def test_inside_is_kept_and_box_is_clamped():
    planes = np.array(
        [[s * (k == 0), s * (k == 1), s * (k == 2), 1] for k in range(3) for s in (1, -1)], float
    )
    x = np.empty(3)
    assert nearest_in_polyhedron(planes, 6, np.array([0.2, 0.3, -0.4]), 1e-12, x)
    np.testing.assert_array_equal(x, [0.2, 0.3, -0.4])
    assert nearest_in_polyhedron(planes, 6, np.array([5.0, -7.0, 0.5]), 1e-12, x)
    np.testing.assert_allclose(x, [1, -1, 0.5], atol=1e-12)
    planes[1, 3] = -1.5  # x >= 1.5 and x <= 1
    assert not nearest_in_polyhedron(planes, 6, np.zeros(3), 1e-12, x)


@pytest.mark.parametrize("normal", [[0, 0, -1.0], [0, 0, 1.0], [1e-9, 0, -1.0]])
def test_basis_at_the_poles(normal):
    n = np.asarray(normal) / np.linalg.norm(normal)
    planes = np.array([[1.0, 0, 0, 0.1], [*n, -0.5]])
    x = np.empty(3)
    assert nearest_in_polyhedron(planes, 2, np.array([3.0, 0.2, 0.0]), 1e-12, x)
    np.testing.assert_allclose(x, [0.1, 0.2, n[2] * -0.5], atol=1e-8)
