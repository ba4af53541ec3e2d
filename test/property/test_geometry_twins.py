"""Small kernels of geometry against scipy and numpy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from garment_sim_ros.geometry.transforms import interpolate_poses


@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.3, 1.0]))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_interpolated_poses(seed, s):
    """Straight and along the shorter arc, whichever of its two quaternions a rotation has."""
    rng = np.random.default_rng(seed)
    p, q = rng.normal(size=(2, 6, 3)), rng.normal(size=(2, 6, 4))
    q[1, 0] = q[0, 0] + 1e-9
    q[1, 1] = q[0, 1]
    q /= np.linalg.norm(q, axis=2, keepdims=True)
    q[1, 2] = -q[0, 2]
    at, turned = np.zeros((6, 3)), np.zeros((6, 4))
    interpolate_poses(p[0], q[0], p[1], q[1], s, at, turned)
    np.testing.assert_allclose(at, (1.0 - s) * p[0] + s * p[1], atol=1e-12)
    for k in range(6):
        expected = Slerp([0.0, 1.0], Rotation.from_quat(q[:, k]))(s)
        apart = (expected.inv() * Rotation.from_quat(turned[k])).magnitude()
        assert apart == pytest.approx(0.0, abs=1e-7)
