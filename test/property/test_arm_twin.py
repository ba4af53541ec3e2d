"""Distances of arms from the trunk, and pushes out of it, against a naive twin."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_arms
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.arm_pushes import Trunk, find_gaps, push


@given(st.integers(0, 10**6), st.booleans())
@settings(derandomize=True, deadline=None, max_examples=60)
def test_pushes(seed, is_turned):
    """An arm beside boxes, some of which it is in; from its place, and turned before."""
    rng = np.random.default_rng(seed)
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    T = np.tile(np.eye(4), (3, 1, 1))
    T[:, :3, :3] = Rotation.random(3, random_state=seed).as_matrix()
    T[:, :3, 3] = np.array([0.5, 0.0, 0.0]) + rng.uniform(-0.3, 0.3, (3, 3))
    support = rng.uniform(0.05, 0.25, (3, 6))
    centre = np.linspace(0.2, 0.6, 5)[:, None] * rng.normal(size=3)
    radius = rng.uniform(0.02, 0.05, 5)
    shoulder = rng.uniform(-0.1, 0.1, 3)
    was = rng.uniform(-0.5, 0.5, 3) * is_turned
    home, farthest = rng.uniform(0.0, 0.1), rng.choice([0.05, 2.0])
    trunk = Trunk(T, np.ascontiguousarray(normals.T), support)
    apart = np.zeros((3, 1, 5))
    find_gaps(trunk, centre[None], shoulder, radius, apart)
    expected, _ = naive_arms.gaps(T, normals, support, shoulder + centre, radius)
    np.testing.assert_allclose(apart[:, 0], expected, atol=1e-12)
    pushed = push(trunk, centre, shoulder, radius, 0.03, was, home, farthest)
    rule = (0.03, was, home, farthest)
    expected = naive_arms.push(T, normals, support, centre, shoulder, radius, *rule)
    np.testing.assert_allclose(pushed, expected, atol=1e-9)
