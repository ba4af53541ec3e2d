"""Forward kinematics against plain matrix products in float64."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import ForwardKinematics, world_from_local
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Dofs, Rig


def random_transforms(rng, n):
    T = np.tile(np.eye(4), (n, 1, 1))
    T[:, :3, :3] = Rotation.random(n, random_state=rng).as_matrix()
    T[:, :3, 3] = rng.normal(size=(n, 3))
    return T


def random_rig(rng, n, d):
    """A tree with d channels; about half of them follow channels before them."""
    axis = rng.normal(size=(d, 3))
    source = np.full(d, -1)
    for i in range(1, d):
        if rng.random() < 0.5:
            source[i] = rng.integers(i)
    return Rig(
        joint_names=tuple(f"j{i}" for i in range(n)),
        parent=np.array([rng.integers(-1, i) if i else -1 for i in range(n)]),
        T_parent_joint=random_transforms(rng, n),
        dofs=Dofs(
            names=tuple(f"d{i}" for i in range(d)),
            joint=np.sort(rng.integers(n, size=d)).astype(np.int32),
            kind=rng.choice([ROTATION, TRANSLATION], size=d).astype(np.int8),
            axis=axis / np.linalg.norm(axis, axis=1, keepdims=True),
            lower=np.full(d, -np.inf),
            upper=np.full(d, np.inf),
            mimic_source=source.astype(np.int32),
            mimic_multiplier=rng.normal(size=d),
            mimic_offset=rng.normal(size=d),
        ),
    )


def naive_world_from_dofs(rig, q, T_world_root):
    def value(i):
        source = rig.dofs.mimic_source[i]
        if source < 0:
            return q[i]
        return rig.dofs.mimic_multiplier[i] * value(source) + rig.dofs.mimic_offset[i]

    world = []
    for j in range(len(rig)):
        above = T_world_root if rig.parent[j] < 0 else world[rig.parent[j]]
        T = above @ rig.T_parent_joint[j]
        for i in np.flatnonzero(rig.dofs.joint == j):
            M = np.eye(4)
            if rig.dofs.kind[i] == ROTATION:
                M[:3, :3] = Rotation.from_rotvec(rig.dofs.axis[i] * value(i)).as_matrix()
            else:
                M[:3, 3] = rig.dofs.axis[i] * value(i)
            T = T @ M
        world.append(T)
    return np.array(world)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(1, 40), st.integers(0, 60), st.integers(0, 2**32 - 1))
def test_compiled_pass_equals_matrix_products(n, d, seed):
    rng = np.random.default_rng(seed)
    rig = random_rig(rng, n, d)
    q = rng.normal(size=d)
    T_world_root = random_transforms(rng, 1)[0]
    expected = naive_world_from_dofs(rig, q, T_world_root)
    found = ForwardKinematics(rig).from_dofs(q, T_world_root)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_local_transforms_chain(n, seed):
    rng = np.random.default_rng(seed)
    rig = random_rig(rng, n, 0)
    T_local = random_transforms(rng, n)
    T_world_root = random_transforms(rng, 1)[0]
    found = world_from_local(rig, T_local, T_world_root)
    for j in range(n):
        above = T_world_root if rig.parent[j] < 0 else found[rig.parent[j]]
        np.testing.assert_allclose(found[j], above @ T_local[j], atol=1e-10)


def test_zero_values_give_the_rest_pose_and_buffers_are_reused():
    rng = np.random.default_rng(3)
    rig = random_rig(rng, 5, 0)
    kinematics = ForwardKinematics(rig)
    rest = kinematics.from_dofs(np.zeros(0))
    assert rest is kinematics.from_local(rig.T_parent_joint)
    np.testing.assert_allclose(rest, world_from_local(rig, rig.T_parent_joint))
