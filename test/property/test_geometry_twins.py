"""Small kernels of geometry against scipy and numpy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from garment_sim_ros.geometry.boxes import boxes_near, column_of, in_columns
from garment_sim_ros.geometry.principal_axes import principal_axes
from garment_sim_ros.geometry.transforms import (
    interpolate_poses,
    matrix_from_quaternion,
    quaternion_multiply,
    rotate,
    transform_from,
    unit_quaternion,
)
from garment_sim_ros.jit import lean_kernel


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


@given(st.integers(0, 10**6))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_ways_that_follow_each_other_meet_to_the_last_digit(seed):
    rng = np.random.default_rng(seed)
    p, q = rng.normal(size=(3, 6, 3)), rng.normal(size=(3, 6, 4))
    q /= np.linalg.norm(q, axis=2, keepdims=True)
    q[:, :3] = q[:, :3].astype(np.float32)  # as a message may have them
    ends = []
    for way, s in ((0, 1.0), (1, 0.0)):
        at, turned = np.zeros((6, 3)), np.zeros((6, 4))
        interpolate_poses(p[way], q[way], p[way + 1], q[way + 1], s, at, turned)
        ends.append((at, turned))
    for one, other in zip(*ends, strict=True):
        np.testing.assert_array_equal(one, other)


@given(st.integers(0, 10**6))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_rotations(seed):
    rng = np.random.default_rng(seed)
    a, b = Rotation.random(2, rng)
    v = rng.normal(size=3)
    product = Rotation.from_quat(quaternion_multiply(*a.as_quat(), *b.as_quat()))
    np.testing.assert_allclose(product.as_matrix(), (a * b).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rotate(*a.as_quat(), *v), a.apply(v), atol=1e-12)
    # Of whole turns and half turns about each axis, too: each has a formula of its own.
    for turn in (a, Rotation.identity(), *Rotation.from_rotvec(np.pi * np.eye(3))):
        q = np.array(unit_quaternion(turn.as_matrix()))
        assert q[3] >= 0.0
        np.testing.assert_allclose(Rotation.from_quat(q).as_matrix(), turn.as_matrix(), atol=1e-12)


@given(st.integers(0, 10**6), st.floats(-12.0, 0.0))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_principal_axes(seed, flatness):
    """As numpy has them, also where one is 1e-12 of the others."""
    rng = np.random.default_rng(seed)
    wanted = np.sort(rng.uniform(0.5, 2.0, 3) * [10.0**flatness, 1.0, 3.0])
    A = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    S = A @ np.diag(wanted) @ A.T
    S = 0.5 * (S + S.T)
    values, axes = S.copy(), np.empty((3, 3))
    principal_axes(values, axes)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(axes @ np.diag(np.diag(values)) @ axes.T, S, atol=1e-12)
    np.testing.assert_allclose(np.sort(np.diag(values)), np.linalg.eigvalsh(S), atol=1e-12)
    assert np.abs(values - np.diag(np.diag(values))).max() < 1e-12


@given(st.integers(0, 10**6))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_matrices_and_transforms_of_quaternions(seed):
    """Of one, of rows, of an array that cannot be written to, and of one turn for many places."""
    rng = np.random.default_rng(seed)
    q = Rotation.random(6, rng).as_quat()
    q.flags.writeable = False
    x = rng.normal(size=(6, 3))
    R = Rotation.from_quat(q).as_matrix()
    np.testing.assert_allclose(matrix_from_quaternion(q), R, atol=1e-12)
    np.testing.assert_allclose(matrix_from_quaternion(q[1]), R[1], atol=1e-12)
    np.testing.assert_allclose(
        matrix_from_quaternion(q.reshape(2, 3, 4)), R.reshape(2, 3, 3, 3), atol=1e-12
    )
    T = np.tile(np.eye(4), (6, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = R, x
    np.testing.assert_allclose(transform_from(x, q), T, atol=1e-12)
    np.testing.assert_allclose(transform_from(x[2], q[2]), T[2], atol=1e-12)
    T[:, :3, :3] = R[0]
    np.testing.assert_allclose(transform_from(x, q[0]), T, atol=1e-12)


@given(st.integers(0, 10**6), st.integers(1, 23), st.sampled_from([0.0, 0.05]))
@settings(derandomize=True, deadline=None, max_examples=40)
def test_boxes_near_a_box(seed, count, reach):
    """As one by one, with corners on a lattice, so that some boxes just touch."""
    rng = np.random.default_rng(seed)
    corners = rng.integers(-6, 7, (count + 1, 2, 3)) / np.float32(4.0)
    boxes = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1).astype(np.float32)
    box, others = boxes[0], boxes[1:]
    columns = np.zeros(6 * column_of(count), np.float32)
    found = np.zeros(count + 1, np.int32)
    many = _boxes_near(others, columns, box, np.float32(reach), found)
    near = (others[:, :3] <= box[3:] + reach) & (others[:, 3:] >= box[:3] - reach)
    assert found[:many].tolist() == np.flatnonzero(near.all(axis=1)).tolist()


@lean_kernel()
def _boxes_near(boxes, columns, box, reach, found):
    in_columns(boxes, columns)
    return boxes_near(columns, box[0], box[1], box[2], box[3], box[4], box[5], reach, found)
