"""The data set's clips on its bodies: limbs point the same way, knees bend forward, feet stand."""

import numpy as np
import pytest

from garment_sim_ros.body.humanoid import humanoid_map
from garment_sim_ros.body.kinematics import ForwardKinematics, rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.mocap import clip_poses
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.source_urdf import reference_from_urdf, urdf_from_clip

BODIES = {
    "mh_female_young": ("bodies", "mh_female_young.glb"),
    "CesiumMan": ("bodies", "CesiumMan.glb"),
    "human": ("urdf", "human_1m65.urdf"),
    "mannequin": None,
}
CLIPS = (
    *("walk", "deepmimic_walk", "deepmimic_run", "deepmimic_jump", "deepmimic_cartwheel"),
    *("deepmimic_spinkick", "deepmimic_dance_a", "cmu_131_03_hop_spin"),
    *("cmu_14_14_jumping_jacks_30fps", "fair_wave_hello", "rokoko_jesse_dance"),
)
SIDES = ("left", "right")


def _bone(T, index, a, b):
    v = T[index[b], :3, 3] - T[index[a], :3, 3]
    return v / np.linalg.norm(v)


@pytest.fixture(scope="module")
def bodies(data_file):
    return {
        name: load_body("mannequin" if path is None else data_file(*path))
        for name, path in BODIES.items()
    }


@pytest.fixture(params=CLIPS)
def clip(request, data_file):
    if request.param == "walk":
        return load_clip("walk")
    return load_clip(data_file("mocap", f"{request.param}.bvh"))


@pytest.mark.parametrize("name", BODIES)
def test_the_body_does_what_the_clip_does(clip, bodies, name):
    body = bodies[name]
    retargeter = clip_poses.retargeter(clip, body)
    assert not retargeter.notes
    kinematics = ForwardKinematics(clip.rig)
    source = {
        bone: clip.rig.index(joint)
        for bone, joint in humanoid_map(clip.rig.joint_names, clip.rig.parent).items()
    }
    target = {bone: body.rig.index(joint) for bone, joint in body.humanoid.items()}
    rest = rest_transforms(body.rig)
    for q in clip.values[:: max(1, len(clip.values) // 12)]:
        T_source = kinematics.from_dofs(q, clip.T_world_file).copy()
        T = retargeter.world_joints(q)
        assert np.isfinite(T).all()
        np.testing.assert_allclose(np.linalg.det(T[:, :3, :3]), 1.0, atol=1e-9)
        for side in SIDES:
            for a, b in (
                *(("UpperArm", "LowerArm"), ("LowerArm", "Hand")),
                *(("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot")),
            ):
                if side + b not in source or side + b not in target:
                    continue
                ours = _bone(T, target, side + a, side + b)
                theirs = _bone(T_source, source, side + a, side + b)
                assert np.degrees(np.arccos(min(ours @ theirs, 1.0))) < 1.0
            thigh = _bone(T, target, f"{side}UpperLeg", f"{side}LowerLeg")
            shank = _bone(T, target, f"{side}LowerLeg", f"{side}Foot")
            hinge = np.cross(thigh, shank)
            if np.linalg.norm(hinge) > np.sin(np.radians(20)):
                j = target[f"{side}UpperLeg"]
                outward = T[j, :3, :3] @ rest[j, :3, :3].T @ [0.0, 1.0, 0.0]
                assert hinge @ outward / np.linalg.norm(hinge) > np.cos(np.radians(25))
        up = T[target["chest"], :3, :3] @ rest[target["chest"], :3, :3].T @ [0.0, 0.0, 1.0]
        trunk = T_source[source["neck"], :3, 3] - T_source[source["hips"], :3, 3]
        assert up @ trunk / np.linalg.norm(trunk) > np.cos(np.radians(30))


@pytest.mark.parametrize(
    ("name", "depth"), [("mh_female_young", 0.025), ("mannequin", 0.04), ("CesiumMan", 0.075)]
)
def test_feet_touch_the_ground_and_do_not_sink(clip, bodies, name, depth):
    """The skin's lowest point, as a share of the height; CesiumMan has large shoes and hands."""
    body = bodies[name]
    retargeter = clip_poses.retargeter(clip, body)
    tall = np.ptp(body.skin.vertices[:, 2])
    lowest = np.array(
        [
            skin_vertices(body.skin, retargeter.world_joints(q))[:, 2].min()
            for q in clip.values[:: max(1, len(clip.values) // 40)]
        ]
    )
    assert -depth < lowest.min() / tall < 0.01
    assert np.percentile(lowest, 10) > -0.025 * tall


def test_the_way_through_a_urdf_gives_the_same(clip, bodies):
    body = bodies["mh_female_young"]
    text = urdf_from_clip(clip)
    rig = parse_urdf(text)
    direct = clip_poses.retargeter(clip, body)
    online = Retargeter(rig, body, reference=reference_from_urdf(text))
    for q in clip.values[:: max(1, len(clip.values) // 5)]:
        np.testing.assert_allclose(online.world_joints(q), direct.world_joints(q), atol=1e-9)
    assert set(online.unmapped_source) == set(direct.unmapped_source)


def test_a_person_model_drives_another_body(bodies, data_file):
    """A REP-155 URDF as source: its root has no place of its own, so the feet give the ground."""
    rig = parse_urdf(data_file("urdf", "human_1m65.urdf").read_text())
    body = bodies["mannequin"]
    retargeter = Retargeter(rig, body)
    assert not retargeter.notes
    q = np.zeros(len(rig.dofs))
    q[rig.dofs.names.index("l_elbow_human")] = 1.2
    x = skin_vertices(body.skin, retargeter.world_joints(q))
    assert abs(x[:, 2].min()) < 0.02
    T = retargeter.world_joints(q)
    index = {bone: body.rig.index(joint) for bone, joint in body.humanoid.items()}
    np.testing.assert_allclose(
        _bone(T, index, "leftUpperArm", "leftLowerArm"), [0, 0, -1], atol=1e-6
    )
    forward = _bone(T, index, "leftLowerArm", "leftHand")
    np.testing.assert_allclose(forward, [np.sin(1.2), 0, -np.cos(1.2)], atol=1e-6)


def test_bones_of_the_bodies(bodies):
    """Names by table, for every body of the data set."""
    limbs = {
        "mh_female_young": {
            **{"Shoulder": "clavicle.{S}", "UpperArm": "upperarm01.{S}"},
            **{"LowerArm": "lowerarm01.{S}", "Hand": "wrist.{S}", "UpperLeg": "upperleg01.{S}"},
            **{"LowerLeg": "lowerleg01.{S}", "Foot": "foot.{S}"},
        },
        "CesiumMan": {
            **{"UpperLeg": "leg_joint_{S}_1", "LowerLeg": "leg_joint_{S}_2"},
            **{"Foot": "leg_joint_{S}_3", "Toes": "leg_joint_{S}_5"},
        },
        "human": {
            **{"UpperArm": "{s}_shoulder_human", "LowerArm": "{s}_elbow_human"},
            **{"Hand": "{s}_wrist_human", "UpperLeg": "{s}_hip_human"},
            **{"LowerLeg": "{s}_knee_human", "Foot": "{s}_ankle_human"},
        },
    }
    middle = {
        "mh_female_young": {
            **{"hips": "root", "spine": "spine05", "chest": "spine03", "upperChest": "spine01"},
            **{"neck": "neck01", "head": "head"},
        },
        "CesiumMan": {
            **{"hips": "Skeleton_torso_joint_1", "spine": "Skeleton_torso_joint_2"},
            **{"chest": "torso_joint_3", "neck": "Skeleton_neck_joint_1"},
            **{"head": "Skeleton_neck_joint_2"},
            **{"leftUpperArm": "Skeleton_arm_joint_L__4_"},
            **{"leftLowerArm": "Skeleton_arm_joint_L__3_"},
            **{"leftHand": "Skeleton_arm_joint_L__2_"},
            **{"rightUpperArm": "Skeleton_arm_joint_R"},
            **{"rightLowerArm": "Skeleton_arm_joint_R__2_"},
            **{"rightHand": "Skeleton_arm_joint_R__3_"},
        },
        "human": {
            **{"hips": "body_human", "spine": "waist_human", "chest": "torso_human"},
            **{"head": "p_head_human"},
        },
    }
    for name, expected in middle.items():
        for side in SIDES:
            letter = side[0]
            for part, joint in limbs[name].items():
                expected[side + part] = joint.format(S=letter.upper(), s=letter)
        assert bodies[name].humanoid == expected
        rest = rest_transforms(bodies[name].rig)
        left = rest[bodies[name].rig.index(expected["leftUpperLeg"])]
        assert left[1, 3] > 0.0  # left is left
