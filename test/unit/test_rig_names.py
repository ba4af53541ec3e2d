"""Real bodies whose joints are renamed as other programs call them are mapped alike."""

import numpy as np
import pytest

from garment_sim_ros.body.humanoid import humanoid_map
from garment_sim_ros.body.loaders.load import load_body

TRUNK = ("spine", "chest", "upperChest")
PARTS = (
    *("Shoulder", "UpperArm", "LowerArm", "Hand"),
    *("UpperLeg", "LowerLeg", "Foot", "Toes"),
)

# Names as the programs write them: hips; trunk, lowest first; neck; head; the parts of a left
# side; and what makes a right name of a left one.
SCHEMES = {
    "Mixamo": (
        "mixamorig:Hips",
        "mixamorig:Spine mixamorig:Spine1 mixamorig:Spine2",
        "mixamorig:Neck",
        "mixamorig:Head",
        "mixamorig:LeftShoulder mixamorig:LeftArm mixamorig:LeftForeArm mixamorig:LeftHand "
        "mixamorig:LeftUpLeg mixamorig:LeftLeg mixamorig:LeftFoot mixamorig:LeftToeBase",
        ("Left", "Right"),
    ),
    "HumanIK in a namespace": (
        "Bob:Character1_Hips",
        "Bob:Character1_Spine Bob:Character1_Spine1 Bob:Character1_Spine2",
        "Bob:Character1_Neck",
        "Bob:Character1_Head",
        "Bob:Character1_LeftShoulder Bob:Character1_LeftArm Bob:Character1_LeftForeArm "
        "Bob:Character1_LeftHand Bob:Character1_LeftUpLeg Bob:Character1_LeftLeg "
        "Bob:Character1_LeftFoot Bob:Character1_LeftToeBase",
        ("Left", "Right"),
    ),
    "Unity": (
        "Hips",
        "Spine Chest UpperChest",
        "Neck",
        "Head",
        "LeftShoulder LeftUpperArm LeftLowerArm LeftHand LeftUpperLeg LeftLowerLeg LeftFoot "
        "LeftToes",
        ("Left", "Right"),
    ),
    "VRoid": (
        "J_Bip_C_Hips",
        "J_Bip_C_Spine J_Bip_C_Chest J_Bip_C_UpperChest",
        "J_Bip_C_Neck",
        "J_Bip_C_Head",
        "J_Bip_L_Shoulder J_Bip_L_UpperArm J_Bip_L_LowerArm J_Bip_L_Hand J_Bip_L_UpperLeg "
        "J_Bip_L_LowerLeg J_Bip_L_Foot J_Bip_L_ToeBase",
        ("_L_", "_R_"),
    ),
    "Blender": (
        "spine",
        "spine.001 spine.002 spine.003",
        "spine.004",
        "spine.006",
        "shoulder.L upper_arm.L forearm.L hand.L thigh.L shin.L foot.L toe.L",
        (".L", ".R"),
    ),
    "Blender by name": (
        "hips",
        "spine chest upper_chest",
        "neck",
        "head",
        "shoulder.L upper_arm.L forearm.L hand.L thigh.L shin.L foot.L toe.L",
        (".L", ".R"),
    ),
    "Rigify, deforming": (
        "DEF-spine",
        "DEF-spine.001 DEF-spine.002 DEF-spine.003",
        "DEF-spine.004",
        "DEF-spine.006",
        "DEF-shoulder.L DEF-upper_arm.L DEF-forearm.L DEF-hand.L DEF-thigh.L DEF-shin.L "
        "DEF-foot.L DEF-toe.L",
        (".L", ".R"),
    ),
    "Rigify, original": (
        "ORG-spine",
        "ORG-spine.001 ORG-spine.002 ORG-spine.003",
        "ORG-spine.004",
        "ORG-spine.006",
        "ORG-shoulder.L ORG-upper_arm.L ORG-forearm.L ORG-hand.L ORG-thigh.L ORG-shin.L "
        "ORG-foot.L ORG-toe.L",
        (".L", ".R"),
    ),
    "Auto-Rig Pro": (
        "root.x",
        "spine_01.x spine_02.x spine_03.x",
        "neck.x",
        "head.x",
        "shoulder.l arm_stretch.l forearm_stretch.l hand.l thigh_stretch.l leg_stretch.l foot.l "
        "toes_01.l",
        (".l", ".r"),
    ),
    "Unreal": (
        "pelvis",
        "spine_01 spine_02 spine_03",
        "neck_01",
        "head",
        "clavicle_l upperarm_l lowerarm_l hand_l thigh_l calf_l foot_l ball_l",
        ("_l", "_r"),
    ),
    "Biped": (
        "Bip01 Pelvis",
        "Bip01 Spine;Bip01 Spine1;Bip01 Spine2",
        "Bip01 Neck",
        "Bip01 Head",
        "Bip01 L Clavicle;Bip01 L UpperArm;Bip01 L Forearm;Bip01 L Hand;Bip01 L Thigh;"
        "Bip01 L Calf;Bip01 L Foot;Bip01 L Toe0",
        (" L ", " R "),
    ),
    "Biped, numbered by an exporter": (
        "Bip01_Pelvis_04",
        "Bip01_Spine_05 Bip01_Spine1_06 Bip01_Spine2_07",
        "Bip01_Neck_08",
        "Bip01_Head_09",
        "Bip01_L_Clavicle_010 Bip01_L_UpperArm_011 Bip01_L_Forearm_012 Bip01_L_Hand_013 "
        "Bip01_L_Thigh_060 Bip01_L_Calf_061 Bip01_L_Foot_062 Bip01_L_Toe0_063",
        None,
    ),
    "Valve": (
        "ValveBiped.Bip01_Pelvis",
        "ValveBiped.Bip01_Spine ValveBiped.Bip01_Spine1 ValveBiped.Bip01_Spine2",
        "ValveBiped.Bip01_Neck1",
        "ValveBiped.Bip01_Head1",
        "ValveBiped.Bip01_L_Clavicle ValveBiped.Bip01_L_UpperArm ValveBiped.Bip01_L_Forearm "
        "ValveBiped.Bip01_L_Hand ValveBiped.Bip01_L_Thigh ValveBiped.Bip01_L_Calf "
        "ValveBiped.Bip01_L_Foot ValveBiped.Bip01_L_Toe0",
        ("_L_", "_R_"),
    ),
    "Character Creator": (
        "CC_Base_Hip",
        "CC_Base_Waist CC_Base_Spine01 CC_Base_Spine02",
        "CC_Base_NeckTwist01",
        "CC_Base_Head",
        "CC_Base_L_Clavicle CC_Base_L_Upperarm CC_Base_L_Forearm CC_Base_L_Hand CC_Base_L_Thigh "
        "CC_Base_L_Calf CC_Base_L_Foot CC_Base_L_ToeBase",
        ("_L_", "_R_"),
    ),
    "Daz Genesis 2": (
        "hip",
        "abdomen abdomen2 chest",
        "neck",
        "head",
        "lCollar lShldr lForeArm lHand lThigh lShin lFoot lToe",
        ("l", "r"),
    ),
    "Daz Genesis 8": (
        "hip",
        "abdomenLower abdomenUpper chestLower chestUpper",
        "neckLower",
        "head",
        "lCollar lShldrBend lForearmBend lHand lThighBend lShin lFoot lToe",
        ("l", "r"),
    ),
    "Daz Genesis 9": (
        "hip",
        "spine1 spine2 spine3 spine4",
        "neck1",
        "head",
        "l_shoulder l_upperarm l_forearm l_hand l_thigh l_shin l_foot l_toes",
        ("l_", "r_"),
    ),
    "Xsens BVH": (
        "Hips",
        "Chest Chest2 Chest3 Chest4",
        "Neck",
        "Head",
        "LeftCollar LeftShoulder LeftElbow LeftWrist LeftHip LeftKnee LeftAnkle LeftToe",
        ("Left", "Right"),
    ),
    "MVNX segments": (
        "Pelvis",
        "L5 L3 T12 T8",
        "Neck",
        "Head",
        "LeftShoulder LeftUpperArm LeftForeArm LeftHand LeftUpperLeg LeftLowerLeg LeftFoot "
        "LeftToe",
        ("Left", "Right"),
    ),
    "MVNX joints": (
        "Pelvis",
        "jL5S1 jL4L3 jL1T12 jT9T8",
        "jT1C7",
        "jC1Head",
        "jLeftT4Shoulder jLeftShoulder jLeftElbow jLeftWrist jLeftHip jLeftKnee jLeftAnkle "
        "jLeftBallFoot",
        ("Left", "Right"),
    ),
    "OptiTrack": (
        "Skeleton 001_Hip",
        "Skeleton 001_Ab;Skeleton 001_Chest",
        "Skeleton 001_Neck",
        "Skeleton 001_Head",
        "Skeleton 001_LShoulder;Skeleton 001_LUArm;Skeleton 001_LFArm;Skeleton 001_LHand;"
        "Skeleton 001_LThigh;Skeleton 001_LShin;Skeleton 001_LFoot;Skeleton 001_LToe",
        ("_L", "_R"),
    ),
    "Vicon": (
        "Subject1:Hips",
        "Subject1:Spine Subject1:Spine1 Subject1:Spine2",
        "Subject1:Neck",
        "Subject1:Head",
        "Subject1:LeftShoulder Subject1:LeftArm Subject1:LeftForeArm Subject1:LeftHand "
        "Subject1:LeftUpLeg Subject1:LeftLeg Subject1:LeftFoot Subject1:LeftToeBase",
        ("Left", "Right"),
    ),
    "Vicon, bones": (
        "root",
        "lowerback upperback thorax",
        "lowerneck",
        "head",
        "lclavicle lhumerus lradius lwrist lfemur ltibia lfoot ltoes",
        ("l", "r"),
    ),
    "SMPL": (
        "m_avg_Pelvis",
        "m_avg_Spine1 m_avg_Spine2 m_avg_Spine3",
        "m_avg_Neck",
        "m_avg_Head",
        "m_avg_L_Collar m_avg_L_Shoulder m_avg_L_Elbow m_avg_L_Wrist m_avg_L_Hip m_avg_L_Knee "
        "m_avg_L_Ankle m_avg_L_Foot",
        ("_L_", "_R_"),
    ),
    "SMPL-X": (
        "pelvis",
        "spine1 spine2 spine3",
        "neck",
        "head",
        "left_collar left_shoulder left_elbow left_wrist left_hip left_knee left_ankle left_foot",
        ("left", "right"),
    ),
    "Kinect": (
        "SpineBase",
        "SpineMid SpineShoulder",
        "Neck",
        "Head",
        "- ShoulderLeft ElbowLeft WristLeft HipLeft KneeLeft AnkleLeft -",
        ("Left", "Right"),
    ),
    "marked as joints": (
        "Hips_JNT",
        "Spine_JNT Spine1_JNT Spine2_JNT",
        "Neck_JNT",
        "Head_JNT",
        "LeftShoulder_JNT LeftArm_JNT LeftForeArm_JNT LeftHand_JNT LeftUpLeg_JNT LeftLeg_JNT "
        "LeftFoot_JNT LeftToeBase_JNT",
        ("Left", "Right"),
    ),
}
SCHEMES["Rigify, original"] = tuple(
    part.replace("DEF-", "ORG-") if isinstance(part, str) else part
    for part in SCHEMES["Rigify, deforming"]
)


def split(text):
    return text.split(";" if ";" in text else None)


def names_of(scheme):
    """Bone to the scheme's name, and the trunk's names."""
    hips, trunk, neck, head, left, sides = SCHEMES[scheme]
    names = {"hips": hips, "neck": neck, "head": head}
    for number, (part, name) in enumerate(zip(PARTS, split(left))):
        if name == "-":
            continue
        names[f"left{part}"] = name
        if sides is None:
            names[f"right{part}"] = name.replace("_L_", "_R_").rsplit("_", 1)[0] + f"_1{number}0"
        else:
            names[f"right{part}"] = name.replace(*sides, 1)
    return names, split(trunk)


def renamed(body, scheme):
    """The body's joints as the scheme calls them, others by a number; its bones' new names."""
    names, trunk = names_of(scheme)
    has = {bone: joint for bone, joint in body.humanoid.items() if bone in names}
    middle = [body.humanoid[bone] for bone in TRUNK if bone in body.humanoid]
    if len(middle) > len(trunk):
        middle = [middle[0], middle[-1]]
    expected = {bone: names[bone] for bone in has}
    new = {has[bone]: name for bone, name in expected.items()}
    new.update(zip(middle, trunk))
    bones = TRUNK if len(middle) == 3 else TRUNK[:2]
    expected.update(zip(bones, (new[joint] for joint in middle)))
    end = {"marked as joints": "_JNT", "Biped, numbered by an exporter": "_{}"}.get(scheme, "")
    joints = [
        new.get(name, f"extra{i}{end.format(1000 + i)}")
        for i, name in enumerate(body.rig.joint_names)
    ]
    return joints, expected


@pytest.fixture(scope="module", params=["mh_female_young.glb", "CesiumMan.glb"])
def body(request, data_file):
    return load_body(data_file("bodies", request.param))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_renamed_body_is_mapped_alike(body, scheme):
    joints, expected = renamed(body, scheme)
    assert len(set(joints)) == len(joints)
    assert humanoid_map(joints, body.rig.parent) == expected


def test_of_two_sets_of_joints_the_deforming_one_is_taken():
    """A whole Rigify rig: every bone thrice, under one another."""
    names, trunk = names_of("Blender")
    chain = [names["hips"], *trunk, names["neck"], names["head"]]
    arm = [names[f"left{part}"] for part in PARTS[:4]]
    leg = [names[f"left{part}"] for part in PARTS[4:]]
    joints, parent = [], []
    for row, above in ((chain, None), (arm, trunk[-1]), (leg, names["hips"])):
        for name in row:
            at = -1 if above is None else joints.index(f"DEF-{above}")
            for prefix in ("MCH-", "ORG-", "DEF-"):
                joints.append(prefix + name)
                parent.append(at)
                at = len(joints) - 1
            above = name
    found = humanoid_map(joints, np.array(parent))
    assert found["hips"] == "DEF-spine"
    assert len(found) == 14
    assert all(joint.startswith("DEF-") for joint in found.values())


def test_what_the_arms_hang_on_is_no_neck():
    """Rigify's spine of one more joint: its fifth is the upper chest, the neck begins above."""
    joints = ["spine", *(f"spine.00{n}" for n in range(1, 7))]
    parent = [-1, *range(6)]
    for side in "LR":
        for above, name in (
            ("spine.004", "shoulder"),
            (f"shoulder.{side}", "upper_arm"),
            (f"upper_arm.{side}", "forearm"),
            ("spine", "thigh"),
            (f"thigh.{side}", "shin"),
        ):
            parent.append(joints.index(above))
            joints.append(f"{name}.{side}")
    found = humanoid_map(joints, np.array(parent))
    assert (found["neck"], found["head"]) == ("spine.005", "spine.006")
    trunk = [found[bone] for bone in ("hips", "spine", "upperChest")]
    assert trunk == ["spine", "spine.001", "spine.004"]


def test_naming_many_joints_takes_time_in_proportion():
    """Counted, not timed: no name is spelled more often for standing among more of them."""
    from garment_sim_ros.body import humanoid

    def spelled(count):
        names = [f"a_b_c_{i}_d_e_left_{i}_arm" for i in range(count)]
        return sum(len(spelling) for _, spelling in humanoid._spellings(names)) / count

    assert spelled(4000) == spelled(400)
