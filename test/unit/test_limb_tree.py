"""The tree of a body's joints, and what of it is a limb."""

import numpy as np
import pytest

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import transform_from
from garment_sim_ros.sim.limb_tree import LimbTree


def capsule(name, length):
    return Collider(
        name=name,
        kind="capsule",
        bone=name,
        geometry={"radius0": 0.04, "radius1": 0.04, "length": length},
    )


def tree_of(colliders, poses):
    return LimbTree.of(colliders, transform_from(poses.position, poses.orientation))


@pytest.mark.parametrize("height", [1.2, 1.75])
def test_limbs_of_a_body_are_head_arms_and_legs(height):
    body = load_body(f"mannequin:height={height}")
    colliders = fit_colliders(body)
    poses = ColliderPoser(colliders, body).poses(rest_transforms(body.rig))
    tree = tree_of(colliders, poses)
    count = len(tree.tip)
    ends = [colliders.colliders[k].bone for k in tree.carrier[-2 * count : -count]]
    assert ends[0] == "head"
    assert set(ends) == {"head", "leftHand", "rightHand", "leftToes", "rightToes"}
    # From the head to a foot by way of the trunk and the leg's joints, and nowhere else.
    bone = [colliders.colliders[k].bone for k in tree.carrier]
    node, way = int(tree.tip[ends.index("leftToes")]), []
    while node >= 0:
        way.append(bone[node])
        node = int(tree.before[node])
    legs = ["leftToes", "leftFoot", "leftLowerLeg", "leftUpperLeg"]
    trunk = ["hips", "spine", "chest", "upperChest", "neck", "head"]
    assert list(dict.fromkeys(way)) == legs + trunk


def test_tips_go_on_from_where_limbs_end_and_the_tree_moves_with_the_body():
    colliders = ColliderSet(colliders=(capsule("upper", 0.6), capsule("lower", 0.6)))
    poses = ColliderPoses.identity(2)
    poses.position[1] = [0.0, 0.0, -0.7]
    tree = tree_of(colliders, poses)
    nodes = tree.posed(poses)
    ends, tips = nodes[tree.tip - 2], nodes[tree.tip]
    assert np.linalg.norm(tips - ends, axis=1) == pytest.approx(tree.beyond)
    assert sorted(np.sign(tips[:, 2] - ends[:, 2])) == [-1.0, 1.0]
    moved = poses.copy()
    moved.position[:] += [1.0, 2.0, 3.0]
    np.testing.assert_allclose(tree.posed(moved), nodes + np.array([1.0, 2.0, 3.0]), atol=1e-12)


def test_one_bone_ends_on_both_sides_and_none_is_no_tree():
    alone = ColliderSet(colliders=(capsule("limb", 0.6),))
    assert len(tree_of(alone, ColliderPoses.identity(1)).tip) == 2
    unknown = np.full((1, 4, 4), np.nan)
    assert LimbTree.of(alone, unknown) is None
    sphere = Collider(name="ball", kind="sphere", bone="ball", geometry={"radius": 0.1})
    ball = ColliderSet(colliders=(sphere,))
    assert tree_of(ball, ColliderPoses.identity(1)) is None
