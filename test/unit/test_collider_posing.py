"""Collider poses against matrix products."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.rig import Dofs, Rig
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.transforms import transform_from


def two_bone_body():
    T = np.tile(np.eye(4), (2, 1, 1))
    rig = Rig(
        joint_names=("a", "b"),
        parent=np.array([-1, 0], np.int32),
        T_parent_joint=T,
        dofs=Dofs.none(),
    )
    skin = Skin(
        vertices=np.eye(3),
        triangles=np.array([[0, 1, 2]], np.int32),
        bone=np.zeros((3, 1), np.int32),
        weight=np.ones((3, 1)),
        T_bone_bind=T,
    )
    return Body(name="two", rig=rig, skin=skin)


def random_set(rng, count):
    return ColliderSet(
        colliders=tuple(
            Collider(
                name=f"c{i}",
                kind="sphere",
                bone="ab"[i % 2],
                position=rng.normal(size=3),
                orientation=Rotation.random(random_state=rng.integers(10**6)).as_quat(),
                geometry={"radius": 1.0},
            )
            for i in range(count)
        )
    )


def test_poses_are_joint_transform_times_local_pose():
    rng = np.random.default_rng(0)
    colliders = random_set(rng, 200)
    poser = ColliderPoser(colliders, two_bone_body())
    half_turns = [Rotation.from_rotvec(np.pi * axis) for axis in np.eye(3)]
    rotations = [*half_turns, *Rotation.random(50, random_state=1)]
    out = ColliderPoses.identity(200)
    for r in rotations:
        T_world_joint = np.stack([transform_from(rng.normal(size=3), r.as_quat()), np.eye(4)])
        poses = poser.poses(T_world_joint, out=out)
        assert poses is out
        got = transform_from(poses.position, poses.orientation)
        local = transform_from(
            np.stack([c.position for c in colliders.colliders]),
            np.stack([c.orientation for c in colliders.colliders]),
        )
        expected = T_world_joint[np.arange(200) % 2] @ local
        np.testing.assert_allclose(got, expected, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(poses.orientation, axis=1), 1.0)


def test_unknown_bone_is_named():
    with pytest.raises(GeometryError, match="elbow"):
        ColliderPoser(
            ColliderSet(colliders=(Collider(name="x", kind="frame", bone="elbow"),)),
            two_bone_body(),
        )


def test_a_share_of_the_rotation_turns_about_the_joint():
    rng = np.random.default_rng(2)
    body = two_bone_body()
    hull = {"vertices": np.zeros((4, 3)), "faces": np.zeros((4, 3), np.int32), "share": 0.25}
    position = rng.normal(size=3)
    colliders = ColliderSet(
        colliders=(
            Collider(name="at_b", kind="hull", bone="b", position=position, geometry=hull),
            Collider(name="at_root", kind="hull", bone="a", position=position, geometry=hull),
        )
    )
    rotvec = np.array([0.3, -0.8, 0.5])
    T_world_a = transform_from(rng.normal(size=3), Rotation.random(random_state=3).as_quat())
    T_a_b = transform_from(np.zeros(3), Rotation.from_rotvec(rotvec).as_quat())
    poses = ColliderPoser(colliders, body).poses(np.stack([T_world_a, T_world_a @ T_a_b]))
    quarter = transform_from(position, [0, 0, 0, 1])
    turned = T_world_a @ transform_from(np.zeros(3), Rotation.from_rotvec(rotvec / 4).as_quat())
    got = transform_from(poses.position, poses.orientation)
    np.testing.assert_allclose(got[0], turned @ quarter, atol=1e-9)
    np.testing.assert_allclose(got[1], T_world_a @ quarter, atol=1e-12)
