"""Euler angles there and back, for every order and sign of the axes, and near gimbal lock."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from garment_sim_ros.mocap.euler import euler_near, quaternions_from_euler

ANGLE = st.floats(-7.0, 7.0)
MIDDLE = st.one_of(
    ANGLE,
    st.tuples(st.sampled_from((-0.5, 0.5, 1.5)), st.floats(-1e-5, 1e-5)).map(
        lambda p: p[0] * np.pi + p[1]
    ),
)


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
@settings(max_examples=60, derandomize=True, deadline=None)
@given(
    signs=st.tuples(*[st.sampled_from((-1.0, 1.0))] * 3),
    angles=st.tuples(ANGLE, MIDDLE, ANGLE),
    near=st.tuples(ANGLE, ANGLE, ANGLE),
)
def test_angles_give_the_rotation_back_near_the_wanted_ones(order, signs, angles, near):
    axes = np.eye(3)[list(order)] * np.array(signs)[:, None]
    q = quaternions_from_euler(axes, np.array([angles]))[0]
    expected = Rotation.identity()
    for axis, angle in zip(axes, angles):
        expected = expected * Rotation.from_rotvec(angle * axis)
    assert (Rotation.from_quat(q).inv() * expected).magnitude() < 1e-9
    found = np.zeros(3)
    euler_near(q, axes, np.array(near), found)
    again = quaternions_from_euler(axes, found[None])[0]
    assert abs(abs(q @ again) - 1.0) < 1e-12
    assert (np.abs(found - near) <= np.pi * (1 + 1e-9)).all() or np.abs(found - near).sum() <= (
        3 * np.pi
    )
    back = np.zeros(3)
    euler_near(q, axes, np.array(angles), back)  # its own angles are nearest to themselves
    if abs(np.cos(angles[1])) > 1e-4:
        np.testing.assert_allclose(back, angles, atol=1e-7)
