"""Channels that follow others."""

import numpy as np
import pytest

from garment_sim_ros.body.kinematics import (
    ForwardKinematics,
    followed_channels,
)
from garment_sim_ros.body.rig import ROTATION, Dofs, Rig
from garment_sim_ros.errors import GeometryError


def chain(mimic_source, multiplier, offset):
    """Three joints 1 m apart along x that turn about z."""
    n = len(mimic_source)
    T = np.tile(np.eye(4), (n, 1, 1))
    T[1:, 0, 3] = 1.0
    return Rig(
        joint_names=tuple(f"channel_{i}" for i in range(n)),
        parent=np.arange(n) - 1,
        T_parent_joint=T,
        dofs=Dofs(
            names=tuple(f"channel_{i}" for i in range(n)),
            joint=np.arange(n, dtype=np.int32),
            kind=np.full(n, ROTATION, np.int8),
            axis=np.tile([0.0, 0.0, 1.0], (n, 1)),
            lower=np.full(n, -np.inf),
            upper=np.full(n, np.inf),
            mimic_source=np.array(mimic_source, np.int32),
            mimic_multiplier=np.array(multiplier, float),
            mimic_offset=np.array(offset, float),
        ),
    )


def test_a_follower_of_a_follower_composes_and_ignores_its_own_value():
    rig = chain([-1, 0, 1], [1.0, 2.0, -1.0], [0.0, 0.1, 0.2])
    T = ForwardKinematics(rig).from_dofs(np.array([0.3, 99.0, np.nan]))
    angles = [0.3, 2 * 0.3 + 0.1, -(2 * 0.3 + 0.1) + 0.2]
    heading = np.arctan2(T[:, 1, 0], T[:, 0, 0])
    np.testing.assert_allclose(heading, np.cumsum(angles), atol=1e-12)


def test_channels_that_follow_each_other_are_refused():
    with pytest.raises(GeometryError, match="mimics itself"):
        ForwardKinematics(chain([1, 0], [1.0, 1.0], [0.0, 0.0]))


def test_any_forest_of_followers_is_followed_to_its_roots():
    random = np.random.default_rng(0)
    for _ in range(20):
        n = 12
        order = random.permutation(n)
        leader = np.full(n, -1)
        for k in range(1, n):
            if random.random() < 0.7:
                leader[order[k]] = order[random.integers(k)]
        multiplier, offset = random.uniform(-2, 2, n), random.uniform(-1, 1, n)
        source, m, o = followed_channels(chain(leader, multiplier, offset).dofs)
        value = random.uniform(-1, 1, n)
        expected = value.copy()
        for i in order:
            if leader[i] >= 0:
                expected[i] = multiplier[i] * expected[leader[i]] + offset[i]
        assert (leader[source] < 0).all()
        np.testing.assert_allclose(m * value[source] + o, expected, atol=1e-12)


def test_a_long_chain_of_followers_is_walked_once():
    looked = 0

    class Counted(np.ndarray):
        def __getitem__(self, key):
            nonlocal looked
            looked += 1
            return super().__getitem__(key)

    n = 4000
    rig = chain([*range(1, n), -1], [1.0] * n, [0.5] * n)
    object.__setattr__(rig.dofs, "mimic_source", rig.dofs.mimic_source.view(Counted))
    source, _, offset = followed_channels(rig.dofs)
    assert (source == n - 1).all()
    assert offset[0] == 0.5 * (n - 1)
    assert looked < 10 * n
