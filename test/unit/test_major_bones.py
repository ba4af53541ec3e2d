"""Which joints are major, and who owns the rest."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.major_bones import joint_areas, major_bones
from garment_sim_ros.body.rig import Dofs, Rig
from garment_sim_ros.body.skin import Body, Skin


@pytest.mark.parametrize(
    ("file", "count"),
    [("mh_female_young.glb", 18), ("CesiumMan.glb", 17)],  # without an upper chest
)
def test_bones_of_a_human(data_file, file, count):
    body = load_body(data_file("bodies", file))
    bones = major_bones(body)
    assert len(bones) == count
    for bone in ("hips", "head", "leftHand", "rightLowerLeg"):
        assert body.humanoid[bone] in bones.names
    assert bones.parent[0] == -1
    assert (bones.parent[1:] >= 0).all()
    assert (bones.parent < np.arange(count)).all()


def test_small_joints_follow_the_bone_above(data_file):
    body = load_body(data_file("bodies", "mh_female_young.glb"))
    bones = major_bones(body)

    def owner(joint):
        return bones.names[bones.owner[body.rig.index(joint)]]

    assert owner("finger2-3.L") == "wrist.L"
    assert owner("upperarm02.R") == "upperarm01.R"
    assert owner("jaw") == "head"
    assert owner("clavicle.L") == body.humanoid["upperChest"]
    assert owner("pelvis.R") == "root"
    area = joint_areas(body.skin)
    assert area.sum() == pytest.approx(1.465, abs=2e-3)
    assert (np.bincount(bones.owner, area) > 0.01 * area.sum()).all()


def rigid_chain(offsets, carried, humanoid=None):
    """Joints j0, j1, ... in a row along x; each in `carried` has a triangle pair of its own."""
    n = len(offsets)
    T = np.tile(np.eye(4), (n, 1, 1))
    T[:, 0, 3] = offsets
    x = np.cumsum(offsets)
    vertices, triangles, bone = [], [], []
    for joint, size in carried.items():
        base = len(vertices)
        vertices += [[x[joint], y * size, z * size] for y, z in ((0, 0), (1, 0), (1, 1), (0, 1))]
        triangles += [[base, base + 1, base + 2], [base, base + 2, base + 3]]
        bone += [joint] * 4
    T_bone_bind = np.tile(np.eye(4), (n, 1, 1))
    T_bone_bind[:, 0, 3] = -x
    return Body(
        name="chain",
        rig=Rig(
            joint_names=tuple(f"j{i}" for i in range(n)),
            parent=np.arange(n) - 1,
            T_parent_joint=T,
            dofs=Dofs.none(),
        ),
        skin=Skin(
            vertices=np.array(vertices),
            triangles=np.array(triangles),
            bone=np.array(bone)[:, None],
            weight=np.ones((len(bone), 1)),
            T_bone_bind=T_bone_bind,
        ),
        humanoid=humanoid or {},
    )


def test_without_names_size_decides_and_bare_joints_own_nothing():
    body = rigid_chain([0, 1, 1, 1, 0.1], {1: 1.0, 3: 0.8, 4: 0.05})
    bones = major_bones(body)
    assert bones.names == ("j1", "j3")
    assert bones.owner.tolist() == [0, 0, 0, 1, 1]
    assert bones.parent.tolist() == [-1, 0]


def test_of_joints_at_one_place_the_last_is_major():
    names = ("hips", "spine", "chest", "neck", "head", "leftUpperArm", "leftLowerArm", "leftHand")
    body = rigid_chain(
        [0, 1, 1, 1, 1, 1, 0, 0, 1, 1],
        {0: 1.0, 1: 1.0, 2: 1.0, 3: 1.0, 4: 1.0, 7: 1.0, 8: 1.0, 9: 1.0},
        dict(zip(names, ("j0", "j1", "j2", "j3", "j4", "j5", "j8", "j9"))),
    )
    bones = major_bones(body)
    assert bones.names == ("j0", "j1", "j2", "j3", "j4", "j7", "j8", "j9")
    assert bones.owner.tolist() == [0, 1, 2, 3, 4, 5, 5, 5, 6, 7]
    assert bones.parent.tolist() == [-1, 0, 1, 2, 3, 4, 5, 6]
    assert bones.first.tolist() == [0, 1, 2, 3, 4, 5, 8, 9]
    assert bones.human == names


@pytest.mark.parametrize("twist_first", [True, False])
def test_a_twist_joint_beside_a_bone_is_no_end_of_its_joint(twist_first):
    """It turns nothing below, so that the bone's own joint has the collider, and its skin."""
    names = ("hips", "spine", "chest", "neck", "leftUpperArm", "leftLowerArm", "leftHand", "head")
    body = rigid_chain([0, 1, 1, 1, 1, 1, 1, 1, 0], dict.fromkeys(range(9), 1.0))
    parent = np.array([-1, 0, 1, 2, 2, 4, 5, 3, 4])
    order = [*range(5), 8, 5, 6, 7] if twist_first else [*range(9)]
    place = {j: k for k, j in enumerate(order)}
    T = body.rig.T_parent_joint.copy()
    T[8] = np.eye(4)
    rig = dataclasses.replace(
        body.rig,
        joint_names=tuple(f"j{j}" for j in order),
        parent=np.array([place.get(int(parent[j]), -1) for j in order]),
        T_parent_joint=T[order],
    )
    humanoid = dict(zip(names, ("j0", "j1", "j2", "j3", "j4", "j5", "j6", "j7")))
    bones = major_bones(dataclasses.replace(body, rig=rig, humanoid=humanoid))
    assert sorted(bones.names) == [f"j{j}" for j in range(8)]
    above = {name: bones.names[p] if p >= 0 else "" for name, p in zip(bones.names, bones.parent)}
    assert [above[j] for j in ("j5", "j4", "j0")] == ["j4", "j2", ""]
    np.testing.assert_array_equal(bones.first, bones.joint)


@pytest.mark.parametrize(("spinner", "last"), [(0.2, "j4"), (3.0, "j5")])
def test_a_head_ends_where_most_of_it_is(spinner, last):
    """A small thing that spins on it is not it; the second hinge of a neck is."""
    names = ("hips", "spine", "chest", "neck", "head")
    arms = ("leftUpperArm", "leftLowerArm", "leftHand")
    body = rigid_chain([0, 1, 1, 1, 1, 0], {**dict.fromkeys(range(5), 1.0), 5: spinner})
    joint_names = (*body.rig.joint_names, "a0", "a1", "a2")
    skin = body.skin
    T = np.concatenate([body.rig.T_parent_joint, np.repeat(body.rig.T_parent_joint[1:2], 3, 0)])
    rig = dataclasses.replace(
        body.rig,
        joint_names=joint_names,
        parent=np.append(body.rig.parent, [2, 6, 7]),
        T_parent_joint=T,
    )
    more = np.repeat(skin.T_bone_bind[:1], 3, axis=0)
    skin = dataclasses.replace(skin, T_bone_bind=np.concatenate([skin.T_bone_bind, more]))
    humanoid = dict(zip((*names, *arms), ("j0", "j1", "j2", "j3", "j4", "a0", "a1", "a2")))
    bones = major_bones(dataclasses.replace(body, rig=rig, skin=skin, humanoid=humanoid))
    assert bones.names[bones.human.index("head")] == last


def test_bones_of_a_long_row_of_joints_at_one_place_are_found_at_once():
    """A robot with 4,000 fixed links at its hips."""
    names = ("hips", "spine", "chest", "neck", "head", "leftUpperArm", "leftLowerArm", "leftHand")
    n = 4000
    body = rigid_chain([0] * (n + 1) + [1] * 7, {n + k: 1.0 for k in range(8)})
    humanoid = {name: f"j{n + k}" for k, name in enumerate(names)} | {"hips": "j0"}
    bones = major_bones(dataclasses.replace(body, humanoid=humanoid))
    assert bones.names[0] == f"j{n}"
    assert bones.first[0] == 0


def test_a_named_bone_without_skin_is_left_out():
    names = ("hips", "spine", "chest", "neck", "head", "leftUpperArm", "leftLowerArm", "leftHand")
    carried = dict.fromkeys(range(1, 7), 1.0)
    body = rigid_chain(
        [0, 1, 1, 1, 1, 1, 1, 1], carried, dict(zip(names, map("j{}".format, range(8))))
    )
    bones = major_bones(body)
    assert bones.names == tuple(f"j{i}" for i in range(1, 7))
    assert bones.owner.tolist() == [0, 0, 1, 2, 3, 4, 5, 5]
    only_root = dataclasses.replace(body, humanoid={})
    assert major_bones(only_root).names == tuple(f"j{i}" for i in range(1, 7))
