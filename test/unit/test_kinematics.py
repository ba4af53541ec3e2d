"""Channels that follow others."""

import numpy as np
import pytest

from garment_sim_ros.body.kinematics import ForwardKinematics, world_from_dofs
from garment_sim_ros.body.rig import ROTATION, Dofs, Rig
from garment_sim_ros.errors import GeometryError


def chain(mimic_source, multiplier, offset):
    """Three joints 1 m apart along x that turn about z."""
    n = len(mimic_source)
    T = np.tile(np.eye(4), (n, 1, 1))
    T[1:, 0, 3] = 1.0
    return Rig(
        joint_names=tuple("abcdef"[:n]),
        parent=np.arange(n) - 1,
        T_parent_joint=T,
        dofs=Dofs(
            names=tuple("abcdef"[:n]),
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
    T = world_from_dofs(rig, np.array([0.3, 99.0, np.nan]))
    angles = [0.3, 2 * 0.3 + 0.1, -(2 * 0.3 + 0.1) + 0.2]
    heading = np.arctan2(T[:, 1, 0], T[:, 0, 0])
    np.testing.assert_allclose(heading, np.cumsum(angles), atol=1e-12)


def test_channels_that_follow_each_other_are_refused():
    with pytest.raises(GeometryError, match="mimics itself"):
        ForwardKinematics(chain([1, 0], [1.0, 1.0], [0.0, 0.0]))
