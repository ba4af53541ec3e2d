"""Exact orientation against rational arithmetic."""

from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.geometry.exact import orientation


def rational_sign(a, b, c, p):
    m = [[Fraction(float(x)) - Fraction(float(y)) for x, y in zip(q, p)] for q in (a, b, c)]
    value = (
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    )
    return (value > 0) - (value < 0)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(seed=st.integers(0, 10**6), ulps=st.integers(-3, 3))
def test_points_next_to_the_plane(seed, ulps):
    rng = np.random.default_rng(seed)
    a, b, c = rng.normal(size=(3, 3))
    weights = rng.dirichlet(np.ones(3))
    p = weights @ np.array([a, b, c])
    p[2] += ulps * np.spacing(p[2])
    got = orientation(a[None], b[None], c[None], p[None])[0, 0]
    assert got == rational_sign(a, b, c, p)


def test_the_side_is_the_one_documented():
    a, b, c = np.eye(3)[None, 0] * 0, np.array([[1.0, 0, 0]]), np.array([[0, 1.0, 0]])
    signs = orientation(a, b, c, np.array([[0, 0, 1.0], [0.3, 0.3, 0], [0, 0, -1.0]]))
    np.testing.assert_array_equal(signs, [[-1, 0, 1]])
