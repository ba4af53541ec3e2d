"""Bones of robots, by the names of their hinges."""

import numpy as np
import pytest
from robot import robot_urdf

from garment_sim_ros.body.humanoid import humanoid_map, humanoid_of_rig
from garment_sim_ros.body.loaders.assembly import upright_rotation
from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.body.robot_names import robot_bones
from garment_sim_ros.errors import ParameterError

LETTER = {"left": "l", "right": "r", "": ""}
SHORT = {"hip": "hp", "knee": "kn", "ankle": "ak", "shoulder": "sh", "elbow": "el", "wrist": "wr"}
AXIS = {"roll": "x", "pitch": "y", "yaw": "z"}
CUT = {"hip": "hip", "knee": "knee", "ankle": "ank", "shoulder": "sho", "elbow": "elb"}


def limb(part):
    return "leg" if part in ("hip", "knee", "ankle") else "arm"


def camel(side, part, turn, k):
    return f"{side}{part.title()}{turn.title()}" if side else f"torso{turn.title()}"


def glued(side, part, turn, k):
    if not side:
        return f"WAIST_{turn[0].upper()}"
    return f"{LETTER[side]}{limb(part)}_{part}_{turn[0]}".upper()


def short(side, part, turn, k):
    if not side:
        return f"back_bk{AXIS[turn]}"
    return f"{LETTER[side]}_{limb(part)}_{SHORT[part]}{AXIS[turn]}"


def numbered(side, part, turn, k):
    return f"{limb(part)}_{side}_{k + 1}_joint" if side else f"torso_{k + 1}_joint"


def counted(side, part, turn, k):
    if not side:
        return f"CHEST_JOINT{k}"
    return f"{LETTER[side]}{limb(part)}_JOINT{k}".upper()


def limb_first(side, part, turn, k):
    if not side:
        return f"torso_{turn}_joint"
    return f"{limb(part)}{LETTER[side]}_{CUT.get(part, 'wri')}{k}_joint"


CALLED = {
    "left_hip_pitch_joint": None,
    "LHipPitch": lambda s, p, t, k: f"{LETTER[s].upper()}{p.title()}{t.title()}",
    "leftHipPitch": camel,
    "LEFT_HIP_Y": lambda s, p, t, k: f"{s}_{p}_{AXIS[t]}".strip("_").upper(),
    "l_hip_pitch": lambda s, p, t, k: f"{LETTER[s]}_{p}_{t}".strip("_"),
    "left-leg/hip-pitch": lambda s, p, t, k: f"{s}-{limb(p)}/{p}-{t}" if s else f"waist-{t}",
    "LLEG_HIP_P": glued,
    "l_leg_hpy": short,
    "l_hpy": lambda s, p, t, k: f"{LETTER[s]}_{SHORT[p]}{AXIS[t]}" if s else f"back_bk{AXIS[t]}",
    "leg_left_1_joint": numbered,
    "LLEG_JOINT0": counted,
    "legl_hip0_joint": limb_first,
}


@pytest.mark.parametrize("name", CALLED.values(), ids=CALLED)
def test_names_of_hinges_tell_all_limbs(name):
    rig = parse_urdf(robot_urdf(name))
    bones = humanoid_of_rig(rig)
    # Root, pelvis, waist, chest, then six links of a leg and five of an arm on each side.
    expected = {
        "hips": 1,
        "spine": 2,
        "chest": 3,
        **{"leftUpperLeg": 5, "leftLowerLeg": 7, "leftFoot": 8},
        **{"leftUpperArm": 11, "leftLowerArm": 13, "leftHand": 14},
        **{"rightUpperLeg": 16, "rightLowerLeg": 18, "rightFoot": 19},
        **{"rightUpperArm": 22, "rightLowerArm": 24, "rightHand": 25},
    }
    numbered_links = {bone: f"link{k}" for bone, k in expected.items()}
    assert bones == {"head": "head_link"} | numbered_links


def bones_with(knee):
    """The bones of a robot whose left knee is called so."""

    def name(side, part, turn, k):
        if side == "left" and part == "knee":
            return knee
        return f"{side}_{part}_{turn}".strip("_")

    rig = parse_urdf(robot_urdf(name))
    return {bone: rig.joint_names[j] for bone, j in robot_bones(rig).items()}


@pytest.mark.parametrize(
    "knee",
    ["knee_r_left", "torso_left_knee", "left_hip_to_knee", "hip_to_left_knee", "lknee"],
)
def test_words_that_say_more_than_one_thing(knee):
    assert bones_with(knee)["leftLowerLeg"] == "link7"


@pytest.mark.parametrize(
    "knee", ["kneel_joint", "left_kneepad", "knee", "any_left_joint", "rank_2", "left_leg_pitch"]
)
def test_words_that_only_look_like_parts(knee):
    """Without its knee a left leg is none, and legs are told on both sides or not at all."""
    bones = bones_with(knee)
    assert "hips" not in bones
    assert not any("Leg" in bone and bone.startswith("left") for bone in bones)


def test_more_hinges_than_robots_have_are_left_alone():
    links = "".join(f'<link name="l{k}"/>' for k in range(400))
    joints = "".join(
        f'<joint name="left_hip_{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint>'
        for k in range(399)
    )
    assert robot_bones(parse_urdf(f'<robot name="x">{links}{joints}</robot>')) == {}


def test_a_part_is_where_its_axes_meet():
    """The hinge by which a thigh turns about itself is half-way down to the knee."""
    rig = parse_urdf(robot_urdf())
    bones = robot_bones(rig)
    hinge = {int(j): name for j, name in zip(rig.dofs.joint, rig.dofs.names, strict=True)}
    assert hinge[bones["leftUpperLeg"]] == "left_hip_roll_joint"
    assert hinge[bones["rightUpperArm"]] == "right_shoulder_roll_joint"


@pytest.mark.parametrize(
    "name",
    [
        lambda s, p, t, k: f"motor_{s}{p[::-1]}{k}",  # words that say nothing
        lambda s, p, t, k: f"{p}_{t}_{k}" + "ab"[s == "left"],  # parts without a side
        lambda s, p, t, k: f"leg_{s}_{p[::-1]}{k}",  # limbs of more hinges than legs have
    ],
)
def test_nothing_is_guessed(name):
    assert robot_bones(parse_urdf(robot_urdf(name))) == {}


def test_a_name_on_the_other_limb_does_not_count():
    """A knee that hangs on no hip of its side is none; and without knees there are no legs."""

    def swapped(side, part, turn, k):
        other = {"left": "right", "right": "left"}
        return f"{other[side] if part == 'knee' else side}_{part}_{turn}".strip("_")

    bones = robot_bones(parse_urdf(robot_urdf(swapped)))
    assert not any("Leg" in bone for bone in bones)
    assert {"leftUpperArm", "rightLowerArm"} <= bones.keys()


def test_overrides_win():
    rig = parse_urdf(robot_urdf())
    bones = humanoid_of_rig(rig, {"leftUpperLeg": "link6", "head": None})
    assert bones["leftUpperLeg"] == "link6"
    assert "head" not in bones
    assert bones["rightUpperLeg"] == "link16"
    with pytest.raises(ParameterError, match="found 'thigh', which is no joint of the rig"):
        humanoid_of_rig(rig, {"leftUpperLeg": "thigh"})


def test_names_that_a_convention_explains_are_left_to_it(data_file):
    """ROS4HRI calls links, not hinges."""
    rig = parse_urdf(data_file("urdf", "human_1m65.urdf").read_text())
    bones = humanoid_of_rig(rig)
    assert bones == humanoid_map(rig.joint_names, rig.parent)
    assert bones["leftUpperLeg"] == "l_hip_human"


def test_up_is_where_arms_are_if_the_head_is_fixed_to_the_hips():
    origins = {"hips": [0, 0, 0], "head": [0, 0, 0], "leftUpperLeg": [0, 0, 0.1]}
    origins |= {"rightUpperLeg": [0, 0, -0.1]}
    origins |= {"leftUpperArm": [0, 0.5, 0.2], "rightUpperArm": [0, 0.5, -0.2]}
    R = upright_rotation({bone: np.array(x, float) for bone, x in origins.items()})
    np.testing.assert_array_equal(
        R, [[1, 0, 0], [0, 0, 1], [0, 1, 0]] * np.array([[-1], [1], [1]])
    )
