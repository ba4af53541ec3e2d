"""Random poses stay within the joints' range and keep the body together."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.random_poses import random_poses
from garment_sim_ros.geometry.transforms import invert_transform


@pytest.fixture(scope="module")
def mannequin():
    return load_body("mannequin:vertices=1500")


def local_turns(body, poses):
    """How far each joint is turned against its parent, from rest [degrees], shape [p, n]."""
    above = np.maximum(body.rig.parent, 0)
    rest = rest_transforms(body.rig)
    at_rest = invert_transform(rest[above]) @ rest
    now = invert_transform(poses[:, above]) @ poses
    turned = np.swapaxes(at_rest[:, :3, :3], 1, 2) @ now[..., :3, :3]
    angles = Rotation.from_matrix(turned.reshape(-1, 3, 3)).magnitude()
    return np.degrees(angles).reshape(len(poses), -1)


def test_bones_keep_their_lengths_and_hips_their_place(mannequin):
    poses = random_poses(mannequin, 20)
    rest = rest_transforms(mannequin.rig)
    parent = mannequin.rig.parent
    for j, above in enumerate(parent):
        if above >= 0:
            length = np.linalg.norm(rest[j, :3, 3] - rest[above, :3, 3])
            apart = np.linalg.norm(poses[:, j, :3, 3] - poses[:, above, :3, 3], axis=1)
            np.testing.assert_allclose(apart, length, atol=1e-9)
    np.testing.assert_allclose(poses[:, 0], np.broadcast_to(rest[0], (20, 4, 4)), atol=1e-12)
    R = poses[..., :3, :3]
    np.testing.assert_allclose(
        R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape), atol=1e-9
    )


def test_joints_turn_within_their_range_and_use_it(mannequin):
    turns = local_turns(mannequin, random_poses(mannequin, 200)).max(axis=0)
    of = {bone: turns[mannequin.rig.index(joint)] for bone, joint in mannequin.humanoid.items()}
    for bone, most, twist in (
        ("leftLowerLeg", 135.0, 0.0),
        ("rightUpperLeg", 120.0, 30.0),
        ("chest", 40.0, 15.0),
        ("upperChest", 45.0, 5.0),
        ("leftFoot", 50.0, 0.0),
        ("head", 22.0 * 2**0.5, 30.0),
    ):
        assert 0.3 * most < of[bone] < most + twist + 1e-6, bone
    # Arms reach up, from an A-pose.
    hand = mannequin.rig.index(mannequin.humanoid["leftLowerArm"])
    shoulder = mannequin.rig.index(mannequin.humanoid["leftUpperArm"])
    poses = random_poses(mannequin, 200)
    way = poses[:, hand, :3, 3] - poses[:, shoulder, :3, 3]
    up = way[:, 2] / np.linalg.norm(way, axis=1)
    assert up.max() > 0.8
    assert up.min() < -0.8


def test_other_seeds_are_other_poses_and_the_same_seed_the_same(mannequin):
    a, b, c = (random_poses(mannequin, 5, seed=s) for s in (0, 0, 1))
    np.testing.assert_array_equal(a, b)
    assert np.abs(a - c).max() > 0.05


def test_a_turn_is_shared_along_the_spine(data_file):
    body = load_body(data_file("bodies", "mh_female_young.glb"))
    turns = local_turns(body, random_poses(body, 30))
    chest, between = body.rig.index("spine03"), body.rig.index("spine04")
    assert turns[:, chest].max() > 5.0
    np.testing.assert_allclose(turns[:, chest], turns[:, between], atol=1e-6)
    assert turns[:, body.rig.index("upperleg02.L")].max() < 1e-5  # it moves with the bone above


def test_collar_bones_turn_up_and_down_forwards_and_backwards_alike(mannequin):
    poses = random_poses(mannequin, 200)
    for side, out in (("left", 1.0), ("right", -1.0)):
        collar, arm = (mannequin.rig.index(f"{side}{bone}") for bone in ("Shoulder", "UpperArm"))
        above = mannequin.rig.parent[collar]
        ways = poses[:, arm, :3, 3] - poses[:, collar, :3, 3]
        ways = np.einsum("pij,pi->pj", poses[:, above, :3, :3], ways)  # as the chest sees them
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        rest = rest_transforms(mannequin.rig)
        before = rest[arm, :3, 3] - rest[collar, :3, 3]
        up = np.degrees(np.arcsin(ways[:, 2]) - np.arcsin(before[2] / np.linalg.norm(before)))
        ahead = np.arctan2(ways[:, 0], out * ways[:, 1]) - np.arctan2(before[0], abs(before[1]))
        for turn in (up, np.degrees(ahead)):
            assert 8.0 < turn.max() < 11.0
            assert -11.0 < turn.min() < -8.0


def test_a_collar_bone_without_length_stays(mannequin):
    T = mannequin.rig.T_parent_joint.copy()
    T[mannequin.rig.index("leftUpperArm"), :3, 3] = 0.0
    body = dataclasses.replace(mannequin, rig=dataclasses.replace(mannequin.rig, T_parent_joint=T))
    turns = local_turns(body, random_poses(body, 20))
    assert turns[:, body.rig.index("leftShoulder")].max() < 1e-5
    assert turns[:, body.rig.index("rightShoulder")].max() > 5.0


def test_a_body_without_a_rig_stays_as_it_is(data_file):
    body = load_body(data_file("bodies", "mh_proxy_female1605.obj"))
    rest = rest_transforms(body.rig)
    np.testing.assert_allclose(random_poses(body, 3), np.broadcast_to(rest, (3, *rest.shape)))
