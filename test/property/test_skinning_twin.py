"""Compiled skinning against plain numpy in float64, and what every method must keep."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.skin import Skin
from garment_sim_ros.body.skinning import METHODS, Skinner, skin_vertices
from garment_sim_ros.geometry.transforms import invert_transform


def random_transforms(rng, n, angle=np.pi):
    T = np.tile(np.eye(4), (n, 1, 1))
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turn = axis * rng.uniform(-angle, angle, size=(n, 1))
    T[:, :3, :3] = Rotation.from_rotvec(turn).as_matrix()
    T[:, :3, 3] = rng.normal(size=(n, 3))
    return T


def random_skin(rng, v=30, n=6, k=4):
    weight = rng.random((v, k)) * (rng.random((v, k)) < 0.7)
    weight[:, 0] += 0.1
    weight /= weight.sum(axis=1, keepdims=True)
    bone = np.array([rng.choice(n, k, replace=False) for _ in range(v)])
    bone[weight == 0.0] = 0
    return Skin(
        vertices=rng.normal(size=(v, 3)),
        triangles=np.array([[0, 1, 2]]),
        bone=bone,
        weight=weight,
        T_bone_bind=random_transforms(rng, n),
    )


def dual_product(p, q):
    def product(a, b):
        v = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
        return np.append(v, a[3] * b[3] - a[:3] @ b[:3])

    return np.concatenate([product(p[:4], q[:4]), product(p[:4], q[4:]) + product(p[4:], q[:4])])


def naive_skin(skin, T_world_bone, method, parent):
    A = T_world_bone @ skin.T_bone_bind
    q = Rotation.from_matrix(A[:, :3, :3]).as_quat()
    x = np.zeros_like(skin.vertices)
    if method == "bone_blend":
        return np.array([naive_bone_blend(skin, A, parent, v) for v in range(len(x))])
    for v, position in enumerate(skin.vertices):
        bone, weight = skin.bone[v], skin.weight[v].copy()
        blended = np.einsum("k,kij->ij", weight, A[bone])
        if method == "linear":
            x[v] = blended[:3, :3] @ position + blended[:3, 3]
            continue
        signed = np.where(q[bone] @ q[bone[0]] < 0.0, -weight, weight)
        total = np.zeros(8)
        for w, j in zip(signed, bone):
            translation = np.array([0, 0, 0, 1, *(0.5 * A[j, :3, 3]), 0])
            total += w * dual_product(translation, np.array([*q[j], 0, 0, 0, 0]))
        total /= np.linalg.norm(total[:4])
        conjugate = total * [-1, -1, -1, 1, 1, 1, 1, -1]
        point = np.array([0, 0, 0, 1, *position, 0])
        x[v] = dual_product(dual_product(total, point), conjugate)[4:7]
    return x


def naive_bone_blend(skin, A, parent, v):
    """The vertex turned by part of every joint's motion, lowest joint first."""
    origin = invert_transform(skin.T_bone_bind)[:, :3, 3]
    below = np.zeros(len(parent))
    for bone, weight in zip(skin.bone[v], skin.weight[v]):
        while bone >= 0:
            below[bone] += weight
            bone = parent[bone] if parent[bone] >= 0 or bone == 0 else 0
    x = skin.vertices[v]
    for j in range(len(parent) - 1, 0, -1):
        if not 1e-6 < below[j] < 1.0 - 1e-6:
            continue
        D = np.linalg.inv(A[max(parent[j], 0)]) @ A[j]
        q = Rotation.from_matrix(D[:3, :3]).as_quat()
        q = below[j] * q * (1.0 if q[3] >= 0.0 else -1.0) + (1.0 - below[j]) * np.array(
            [0, 0, 0, 1]
        )
        part = Rotation.from_quat(q / np.linalg.norm(q)).as_matrix()
        shift = D[:3, :3] @ origin[j] + D[:3, 3] - origin[j]
        x = part @ (x - origin[j]) + origin[j] + below[j] * shift
    carrier = max(j for j in range(len(parent)) if below[j] > 1.0 - 1e-6)
    return A[carrier, :3, :3] @ x + A[carrier, :3, 3]


@pytest.mark.parametrize("method", METHODS)
@settings(derandomize=True, deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_compiled_skinning_equals_plain_numpy(method, seed):
    rng = np.random.default_rng(seed)
    skin = random_skin(rng)
    parent = np.array([-1, *(rng.integers(-1, i) for i in range(1, 6))])
    T = random_transforms(rng, 6, angle=1.5)
    found = skin_vertices(skin, T, method, parent=parent)
    np.testing.assert_allclose(found, naive_skin(skin, T, method, parent), atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
@settings(derandomize=True, deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_bind_pose_and_rigid_motion_are_kept(method, seed):
    rng = np.random.default_rng(seed)
    skin = random_skin(rng)
    parent = np.array([-1, 0, 1, -1, 3, 0])
    T_world_root = random_transforms(rng, 1)[0]
    T = T_world_root @ invert_transform(skin.T_bone_bind)
    x = skin_vertices(skin, T, method, parent=parent)
    expected = skin.vertices @ T_world_root[:3, :3].T + T_world_root[:3, 3]
    np.testing.assert_allclose(x, expected, atol=1e-9)


def test_between_two_bones_a_vertex_turns_by_its_share_about_their_joint():
    T_bind = np.tile(np.eye(4), (3, 1, 1))
    T_bind[1, 0, 3], T_bind[2, 0, 3] = 1.0, 2.0
    skin = Skin(
        vertices=np.array([[1.0, 0.3, 0.0], [0.4, 0.0, 0.1], [1.5, 0.0, 0.2]]),
        triangles=np.array([[0, 1, 2]]),
        bone=np.array([[0, 1], [0, 0], [1, 2]]),
        weight=np.array([[0.5, 0.5], [1.0, 0.0], [0.5, 0.5]]),
        T_bone_bind=invert_transform(T_bind),
    )
    T = T_bind.copy()
    T[1:, :3, :3] = Rotation.from_rotvec([0.0, 0.0, 1.4]).as_matrix()
    T[2, :3, 3] = T[1, :3, 3] + T[1, :3, 0]
    x = Skinner(skin, "bone_blend", np.array([-1, 0, 1])).vertices(T)
    half = Rotation.from_rotvec([0.0, 0.0, 0.7]).as_matrix()
    np.testing.assert_allclose(x[0], [1, 0, 0] + half @ [0.0, 0.3, 0.0], atol=1e-12)
    np.testing.assert_allclose(x[1], [0.4, 0.0, 0.1], atol=1e-12)
    # The second joint did not bend: the third vertex moves rigidly with both its bones.
    np.testing.assert_allclose(x[2], [1, 0, 0] + T[1, :3, :3] @ [0.5, 0.0, 0.2], atol=1e-12)
