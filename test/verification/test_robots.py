"""Robots as bodies: hinges, loose parts, forearms that point ahead, a head fixed anywhere."""

import re

import numpy as np
import pytest
from robot import robot_urdf
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import garment_sim_ros as gs
from garment_sim_ros.avatar import Avatar
from garment_sim_ros.body.arms import Arms, skin_of_bones
from garment_sim_ros.body.kinematics import ForwardKinematics, rest_transforms
from garment_sim_ros.body.loaders.urdf import body_from_urdf, parse_urdf
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.mannequin.mannequin import mannequin
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.random_poses import random_poses
from garment_sim_ros.contact.pierced import PiercedMeter
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.tshirt import tshirt
from garment_sim_ros.geometry.topology import boundary_loops
from garment_sim_ros.mocap.clip_poses import retargeter
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.params import ColliderNodeParameters, ColliderOptions
from garment_sim_ros.ros.posed_avatar import read_skeleton


@pytest.fixture(scope="module")
def robot():
    return body_from_urdf(robot_urdf())


@pytest.fixture(scope="module")
def avatar(robot):
    return Avatar(robot, fit_colliders(robot, ColliderOptions()))


@pytest.mark.parametrize("asked", [{}, {"head": ""}, {"head": "", "facing": np.pi / 2}])
def test_a_robots_own_joint_states_move_its_colliders(robot, asked):
    """As its description has it: not turned, and its head with the chest."""
    text = robot_urdf(**asked)
    p = ColliderNodeParameters(body="", cache=False)
    skeleton = read_skeleton(text, None, p, _Quiet(), bone_names=None, body_bone_names=None)
    q = np.zeros(len(skeleton.rig.dofs))
    q[skeleton.rig.dofs.names.index("waist_pitch_joint")] = 0.4
    joints = skeleton.world_joints(q, 0.0)
    poses, _ = skeleton.avatar.posed(joints, 0)
    skin = skin_vertices(skeleton.avatar.body.skin, joints)
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    R = turned if "facing" in asked else np.eye(3)
    assert cKDTree(skin).query(_leaning(robot) @ R.T)[0].max() < 1e-6
    head = next(k for k, c in enumerate(skeleton.avatar.colliders.colliders) if "head" in c.bone)
    top = skin[np.argmax(skin[:, 2])]
    assert np.linalg.norm(poses.position[head] - top) < 0.3


class _Quiet:
    def info(self, message):
        pass

    warning = info


@pytest.mark.parametrize(("facing", "lying"), [(np.pi, 0.0), (-np.pi / 2, 0.0), (0.0, np.pi / 2)])
def test_a_robot_that_faces_elsewhere_is_turned(robot, facing, lying):
    body = body_from_urdf(robot_urdf(facing=facing, lying=lying))
    assert any("turned" in note for note in body.notes)
    np.testing.assert_allclose(
        rest_transforms(body.rig)[:, :3, 3], rest_transforms(robot.rig)[:, :3, 3], atol=1e-6
    )
    np.testing.assert_allclose(body.skin.vertices, robot.skin.vertices, atol=1e-6)
    assert not robot.notes


def test_colliders_follow_the_last_hinge_of_a_part(robot, avatar):
    """Driven by its own joint states, a thigh turns about itself below the hip."""
    bones = major_bones(robot)
    names = dict(zip(robot.rig.dofs.names, robot.rig.dofs.joint.tolist(), strict=True))
    yaw = robot.rig.joint_names[names["left_hip_yaw_joint"]]
    assert yaw in bones.names
    on_it = [c.name for c in avatar.colliders.colliders if c.bone == yaw]
    assert on_it
    q = np.zeros(len(robot.rig.dofs))
    kinematics = ForwardKinematics(robot.rig)
    before = kinematics.from_dofs(q, np.eye(4)).copy()
    q[robot.rig.dofs.names.index("left_hip_yaw_joint")] = 0.5
    after = kinematics.from_dofs(q, np.eye(4))
    j = robot.rig.index(yaw)
    np.testing.assert_allclose(before[j, :3, 3], after[j, :3, 3], atol=1e-9)
    assert abs(after[j, 0, 0] - np.cos(0.5)) < 1e-9


def test_limbs_are_known_by_their_colliders_bones(robot):
    """A thigh begins at its first hinge, its collider is on the last one: both are the thigh."""
    bones = major_bones(robot)
    assert set(bones.human) == set(robot.humanoid)
    assert bones.names[bones.human.index("leftUpperLeg")] != robot.humanoid["leftUpperLeg"]
    z = {bone: np.ptp(skin[:, 2]) for bone, skin in skin_of_bones(robot).items()}
    assert z["leftUpperLeg"] == pytest.approx(z["rightUpperLeg"]) == pytest.approx(0.37, abs=0.01)


def test_garments_are_beside_the_arms(avatar):
    """A skirt knows the colliders of arms, which are on the last hinge of a shoulder."""
    bones = major_bones(avatar.body)
    hands = [side + part for side in ("left", "right") for part in ("LowerArm", "Hand")]
    outside = {
        "tshirt": {"head", *hands},
        "skirt": {"head", *hands, "leftUpperArm", "rightUpperArm"},
    }
    for garment in avatar.dress("tshirt_short_skirt").garments:
        expected = {bones.names[bones.human.index(bone)] for bone in outside[garment.name]}
        assert set(garment.passed_by) == expected


def test_all_links_of_a_ball_joint_turn_in_random_poses(robot):
    poses = random_poses(robot, 3)
    bones = major_bones(robot)
    m = bones.human.index("leftUpperLeg")
    first, last, hips = (poses[:, j] for j in (bones.first[m], bones.joint[m], bones.joint[0]))
    between, at_hips = (np.linalg.inv(T) @ last for T in (first, hips))
    assert np.ptp(between, axis=0).max() < 1e-9
    assert np.ptp(at_hips, axis=0).max() > 0.1


def test_arms_of_robots_go_where_arms_do_in_random_poses(robot):
    poses = random_poses(robot, 200)
    elbow, shoulder = (
        poses[:, robot.rig.index(robot.humanoid[f"left{part}"]), :3, 3]
        for part in ("LowerArm", "UpperArm")
    )
    knee, hip = (
        poses[:, robot.rig.index(robot.humanoid[f"left{part}"]), :3, 3]
        for part in ("LowerLeg", "UpperLeg")
    )
    arm, thigh = (
        (a - b) / np.linalg.norm(a - b, axis=1)[:, None]
        for a, b in ((elbow, shoulder), (knee, hip))
    )
    assert np.mean(arm[:, 0] < -0.65) < 0.06  # behind the back
    assert np.mean(arm[:, 1] < -0.75) < 0.06  # across the chest
    assert np.mean(thigh[:, 0] > 0.55) > 0.05 > np.mean(thigh[:, 0] < -0.55)


def test_hands_of_a_robot_are_kept_off_its_thighs(robot):
    """A clip puts them 2 cm into the side of the thighs."""
    thigh, hand = (skin_of_bones(robot)[bone] for bone in ("leftUpperLeg", "leftHand"))
    arms = Arms(robot)
    T = rest_transforms(robot.rig)
    below = robot.rig.below(robot.rig.index(robot.humanoid["leftUpperArm"]))
    wanted = np.array([thigh[:, 0].mean(), thigh[:, 1].max() + 0.01, thigh[:, 2].mean()])
    T[below, :3, 3] += wanted - hand.mean(axis=0)
    moved = T.copy()
    arms.clear(moved, 0.0)
    joint = robot.rig.index(robot.humanoid["leftHand"])
    assert moved[joint, 1, 3] > T[joint, 1, 3] + 0.04


def test_a_robot_does_not_lean_back_where_it_runs(robot, data_file):
    """Its thighs are beside its pelvis, and partly in it, by design."""
    clip = gs.load_clip(data_file("mocap", "deepmimic_run.bvh"))
    to_body = retargeter(clip, robot)
    sampler = ClipSampler(clip, "once")
    for t in np.linspace(0.0, clip.duration, 30):
        to_body.world_joints(sampler.sample(t), t)
        assert to_body.tucks.bend == 0.0


@pytest.mark.parametrize("turn", ["pitch", "roll", "yaw"])
def test_an_avatar_makes_all_turns_of_a_robot_that_drives_it(turn):
    source, target = parse_urdf(robot_urdf()), mannequin()
    retargeter = Retargeter(source, target)
    thigh = target.rig.index(target.humanoid["leftUpperLeg"])
    q = np.zeros(len(source.dofs))
    before = retargeter.world_joints(q)[thigh, :3, :3].copy()
    q[source.dofs.names.index(f"left_hip_{turn}_joint")] = 0.4
    after = retargeter.world_joints(q)[thigh, :3, :3]
    axis = {"pitch": [0, 1, 0], "roll": [1, 0, 0], "yaw": [0, 0, 1]}[turn]
    turned = Rotation.from_rotvec(0.4 * np.array(axis)).as_matrix()
    np.testing.assert_allclose(after, turned @ before, atol=1e-6)


@pytest.mark.parametrize("head", ["", "logo"])
def test_a_head_that_no_name_tells_gets_a_joint_of_its_own(head):
    """The neck is a capsule from 0.225 to 0.375 m over the waist, of 4.5 cm; the head a box."""
    robot = body_from_urdf(robot_urdf(head=head))
    assert robot.humanoid["head"] == "head" == robot.rig.joint_names[-1]
    assert robot.rig.joint_names[robot.rig.parent[-1]] == robot.humanoid["chest"]
    assert "head taken to begin at 0.3" in robot.notes[0]
    x = robot.skin.vertices
    on_head = robot.skin.bone[:, 0] == len(robot.rig) - 1
    assert 0.30 < x[on_head, 2].min() < 0.40
    np.testing.assert_allclose(x[on_head].max(axis=0), [0.1, 0.07, 0.61], atol=1e-6)
    moved = [_leaning(body) for body in (robot, body_from_urdf(robot_urdf()))]
    for a, b in (moved, moved[::-1]):
        assert cKDTree(a).query(b)[0].max() < 1e-9


def _leaning(body):
    q = np.zeros(len(body.rig.dofs))
    q[body.rig.dofs.names.index("waist_pitch_joint")] = 0.4
    return skin_vertices(body.skin, ForwardKinematics(body.rig).from_dofs(q, np.eye(4)))


def test_a_head_that_turns_is_told_whatever_it_is_called(robot):
    body = body_from_urdf(robot_urdf(head="camera", head_axis="z"))
    assert body.humanoid["head"] == "camera"
    assert len(body.rig) == len(robot.rig)
    assert body.notes == ("no bone called neck or head: 'camera' taken as the head",)


def test_a_chest_that_no_name_tells_is_no_head(robot):
    """Nor is the first hinge of a shoulder, however high what is on it."""
    text = robot_urdf(head="").replace("waist_pitch_joint", "upper_body_pitch")
    ball = '<visual><origin xyz="0 0 0.3"/><geometry><sphere radius="0.05"/></geometry></visual>'
    for side in ("left", "right"):
        child = re.search(f'{side}_shoulder_pitch.*?<child link="(.*?)"', text).group(1)
        assert f'<link name="{child}"></link>' in text
        text = text.replace(f'<link name="{child}"></link>', f'<link name="{child}">{ball}</link>')
    body = body_from_urdf(text)
    assert body.humanoid["head"] == "head"
    assert body.rig.joint_names[body.rig.parent[-1]] == robot.humanoid["chest"]


def test_a_gap_is_a_neck_and_an_antenna_is_no_head():
    neck = r'<visual><origin xyz="0 0 0\.3".*?</visual>'
    body = body_from_urdf(re.sub(neck, "", robot_urdf(head="")))
    z = rest_transforms(body.rig)[body.rig.index("head"), 2, 3]
    assert 0.36 < z < 0.44  # between the chest, up to 0.37, and the head, from 0.43 on
    antenna = "".join(
        f'<visual><origin xyz="0 0 {z}"/><geometry>{shape}</geometry></visual>'
        for z, shape in (
            (0.55, '<cylinder radius="0.002" length="0.12"/>'),
            (0.62, '<sphere radius="0.01"/>'),
        )
    )
    plain, more = (
        body_from_urdf(
            robot_urdf(head="").replace('size="0.16 0.14 0.18"/></geometry></visual>', tail)
        )
        for tail in (
            'size="0.16 0.14 0.18"/></geometry></visual>',
            'size="0.16 0.14 0.18"/></geometry></visual>' + antenna,
        )
    )
    heads = [rest_transforms(b.rig)[b.rig.index("head"), 2, 3] for b in (plain, more)]
    assert abs(heads[1] - heads[0]) < 0.02


def test_a_rig_that_is_said_to_have_no_head_gets_none():
    body = body_from_urdf(robot_urdf(head=""), humanoid_overrides={"head": None})
    assert "head" not in body.humanoid
    assert not body.notes


def test_a_cover_at_the_chests_origin_is_not_the_chest(robot):
    cover = (
        '<link name="cover"><visual><geometry><sphere radius="0.05"/></geometry></visual></link>'
        f'<joint name="cover" type="fixed"><parent link="{robot.humanoid["chest"]}"/>'
        '<child link="cover"/></joint></robot>'
    )
    body = body_from_urdf(robot_urdf(head="").replace("</robot>", cover))
    bones = major_bones(body)
    assert bones.names[bones.human.index("chest")] == robot.humanoid["chest"]
    assert np.count_nonzero(bones.parent < 0) == 1
    assert np.isfinite(random_poses(body, 2)).all()


def test_of_a_head_on_several_hinges_the_first_is_its_joint():
    text = robot_urdf(head="camera", head_axis="z").replace(
        '<child link="camera"/>', '<child link="mast"/>'
    )
    tilt = (
        '<link name="mast"/><joint name="tilt" type="revolute"><parent link="mast"/>'
        '<child link="camera"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint></robot>'
    )
    assert body_from_urdf(text.replace("</robot>", tilt)).humanoid["head"] == "mast"


def test_without_a_head_the_neck_begins_at_the_chest():
    """The chest ends at 0.1 + 0.27 m; above it is the neck, down to a rounded end."""
    text = re.sub(r'<visual><origin xyz="0\.02 0\.0 0\.42".*?</visual>', "", robot_urdf(head=""))
    body = body_from_urdf(text)
    T = rest_transforms(body.rig)[body.rig.index("head"), :3, 3]
    np.testing.assert_allclose(T, [0.0, 0.0, 0.37], atol=0.01)


def test_a_robot_without_anything_over_its_shoulders():
    """Its head, which nothing is on, begins between the shoulders, at 0.1 + 0.22 m."""
    text = re.sub(r'<visual><origin xyz="0\.02 0\.0 0\.42".*?</visual>', "", robot_urdf(head=""))
    text = re.sub(r'<visual><origin xyz="0 0 0\.3".*?</visual>', "", text)
    text = text.replace(
        'xyz="0.0 0.0 0.14"', 'xyz="0.0 0.0 0.09"'
    )  # the chest up to the shoulders
    body = body_from_urdf(text)
    T = rest_transforms(body.rig)[body.rig.index("head"), :3, 3]
    np.testing.assert_allclose(T, [0.0, 0.0, 0.32], atol=1e-6)
    assert (body.skin.bone < len(body.rig) - 1).all()


def test_measures_of_a_robot(robot):
    measures = Measures(robot).with_arms_away()
    # The head's joint is in the chest's origin; its skin begins 0.33 above that, the neck at 0.27.
    assert 0.40 < measures.neck < 0.45
    assert 0.36 < measures.neck_base.centre[2] < 0.40
    assert measures.neck_base.half_width < 0.1
    for arm in measures.arms:
        assert arm.radius < 0.06  # of the upper arm, without the forearm that points ahead


def test_a_shirt_around_a_robot_has_its_four_openings(robot):
    shirt = tshirt(Measures(robot).with_arms_away(), vertices=1500, length=0.5, ease=0.025)
    loops = boundary_loops(shirt.triangles)
    assert len(loops) == 4
    sides = sorted(float(shirt.vertices[loop, 1].mean()) for loop in loops)
    np.testing.assert_array_equal(np.sign(np.round(sides, 1)), [-1, 0, 0, 1])


def test_wide_sleeves_leave_wide_hips_whole():
    """A sleeve of 10 cm radius, made longer, goes through hips of 42 cm."""
    text = robot_urdf()
    for old, new in (
        ('<box size="0.14 0.22 0.12"/>', '<box size="0.2 0.42 0.12"/>'),
        ('<capsule radius="0.035" length="0.1"/>', '<capsule radius="0.1" length="0.1"/>'),
    ):
        assert old in text
        text = text.replace(old, new)
    measures = Measures(body_from_urdf(text)).with_arms_away()
    shirt = tshirt(measures, vertices=1500, length=0.8, ease=0.025)
    assert len(boundary_loops(shirt.triangles)) == 4


def test_garments_stay_on_a_robot_that_walks(avatar):
    _walk(avatar)


def test_garments_stay_on_a_robot_without_a_head_of_its_own():
    """Its colliders have the head apart: one hull of chest and head would fill the neck's hole."""
    robot = body_from_urdf(robot_urdf(head=""))
    avatar = Avatar(robot, fit_colliders(robot, ColliderOptions()))
    assert "head" in {c.bone for c in avatar.colliders.colliders}
    _walk(avatar)


def _walk(avatar):
    outfit = avatar.dress("tshirt_short_skirt")
    simulation = gs.Simulation(outfit, avatar.colliders)
    meter = PiercedMeter(avatar.colliders)
    for n, pose in enumerate(avatar.play("walk", rate=60)):
        simulation.step(pose, dt=1 / 60)
        meter.add(
            pose, {g.name: (simulation.positions(g.name), g.triangles) for g in outfit.garments}
        )
        if n == 120:
            break
    for garment in outfit.garments:
        health = simulation.health(garment.name)
        assert health.resets == health.recovered == 0
        assert simulation.positions(garment.name)[:, 2].min() > 0.3
    assert meter.result().pierced == 0
