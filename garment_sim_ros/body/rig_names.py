"""What the joints of common rigs are called: one table per naming convention, nothing else.

Names stand here without case, separators, what all joints of a rig begin or end with
(``mixamorig:``, ``DEF-``, ``CC_Base_``, ``Bip01``, ``_<id>``) and their side. Where several names
stand for one bone, the first one that a rig has counts.
"""

from dataclasses import dataclass

SIDES = {"left": ("left", "l"), "right": ("right", "r")}
"""What stands for a side, before or after a joint's name, or in place of ``{s}`` in it."""

MIDDLE = ("", "c", "x")
"""What may stand before or after the name of a joint in the middle."""

PREFERRED = ("def", "org")
"""Beginnings of names, by which of several sets of joints that say as much is taken."""

ARM = ("Shoulder", "UpperArm", "LowerArm", "Hand")
LEG = ("UpperLeg", "LowerLeg", "Foot", "Toes")


@dataclass(frozen=True)
class Convention:
    """Joint names of one kind of rig; several for one bone are apart by spaces.

    Attributes:
        hips: The pelvis.
        trunk: The joints between pelvis and neck, from any of which a rig may leave some out. With
            ``name=bone`` they are certain bones, else they are shared out.
        neck: The neck's joints, lowest first.
        head: The head.
        arm: Collar bone, upper arm, forearm, hand; "-" where the rig has none.
        leg: Thigh, shank, foot, toes; likewise.
        single: Joints whose two sides are called differently: bone to its names.
    """

    hips: str
    trunk: str
    neck: str
    head: str
    arm: tuple[str, str, str, str]
    leg: tuple[str, str, str, str]
    single: tuple[tuple[str, str], ...] = ()


CONVENTIONS: dict[str, Convention] = {
    # VRM, VRoid and Unity's Humanoid.
    "VRM": Convention(
        hips="hips",
        trunk="spine=spine chest=chest upperchest=upperChest",
        neck="neck",
        head="head",
        arm=("shoulder", "upperarm", "lowerarm", "hand"),
        leg=("upperleg", "lowerleg", "foot", "toes toebase"),
    ),
    # Mixamo, HumanIK, Rokoko, OptiTrack's and Vicon's FBX, FAIR, LAFAN and the CMU conversions
    # that call the thigh LeftUpLeg.
    "Mixamo": Convention(
        hips="hips",
        trunk="lowerback spine spine1 spine2 spine3 spine4",
        neck="neck neck1",
        head="head",
        arm=("shoulder", "arm", "forearm", "hand"),
        leg=("upleg thigh", "leg shin", "foot", "toebase toe"),
    ),
    # Joints called after the anatomical joint, as in DeepMimic, Xsens' BVH and the other CMU
    # conversions: here LeftShoulder is the upper arm.
    "anatomical": Convention(
        hips="hips hip pelvis spinebase root",
        trunk="lowerback torso spine spinemid spineshoulder chest chest2 chest3 chest4",
        neck="lowerneck neck",
        head="head",
        arm=("collar clavicle", "shoulder", "elbow", "wrist"),
        leg=("hip", "knee", "ankle", "toe toes"),
    ),
    "MakeHuman": Convention(
        hips="root",
        trunk="spine05 spine04 spine03 spine02 spine01",
        neck="neck01 neck02 neck03",
        head="head",
        arm=("clavicle", "upperarm01", "lowerarm01", "wrist"),
        # The default rig has no joint for all toes; the big toe's would move only itself.
        leg=("upperleg01", "lowerleg01", "foot", "-"),
    ),
    # REP-155; head_<id> is fixed to p_head_<id>, where it turns.
    "ROS4HRI": Convention(
        hips="body",
        trunk="waist torso",
        neck="-",
        head="phead",
        arm=("-", "shoulder", "elbow", "wrist"),
        leg=("hip", "knee", "ankle", "-"),
    ),
    "CesiumMan": Convention(
        hips="torsojoint1",
        trunk="torsojoint2 torsojoint3",
        neck="neckjoint1",
        head="neckjoint2",
        arm=("-", "-", "-", "-"),
        leg=("legjoint{s}1", "legjoint{s}2", "legjoint{s}3", "legjoint{s}5"),
        single=(  # the two arms are numbered in opposite directions
            ("leftUpperArm", "armjointl4"),
            ("leftLowerArm", "armjointl3"),
            ("leftHand", "armjointl2"),
            ("rightUpperArm", "armjointr"),
            ("rightLowerArm", "armjointr2"),
            ("rightHand", "armjointr3"),
        ),
    ),
    "Unreal": Convention(
        hips="pelvis",
        trunk="spine01 spine02 spine03 spine04 spine05",
        neck="neck01 neck02",
        head="head",
        arm=("clavicle", "upperarm", "lowerarm", "hand"),
        leg=("thigh", "calf", "foot", "ball"),
    ),
    "SMPL": Convention(  # and SMPL-H, SMPL-X
        hips="pelvis",
        trunk="spine1 spine2 spine3",
        neck="neck",
        head="head",
        arm=("collar", "shoulder", "elbow", "wrist"),
        leg=("hip", "knee", "ankle", "foot"),
    ),
    # Blender's rigs; Rigify's spine counts through from the pelvis to the head.
    "Blender": Convention(
        hips="hips pelvis spine",
        trunk="spine spine001 spine002 spine003 spine004 chest upperchest",
        neck="neck spine004 spine005",
        head="head spine006",
        arm=("shoulder clavicle", "upperarm", "forearm lowerarm", "hand"),
        leg=("thigh upperleg", "shin calf lowerleg", "foot", "toe toes"),
    ),
    "Auto-Rig Pro": Convention(
        hips="root",
        trunk="spine01 spine02 spine03 spine04 spine05",
        neck="neck",
        head="head",
        arm=("shoulder", "armstretch", "forearmstretch", "hand"),
        leg=("thighstretch", "legstretch", "foot", "toes01"),
    ),
    # 3ds Max's Biped, and Valve's.
    "Biped": Convention(
        hips="pelvis",
        trunk="spine spine1 spine2 spine3 spine4",
        neck="neck neck1",
        head="head head1",
        arm=("clavicle", "upperarm", "forearm", "hand"),
        leg=("thigh", "calf", "foot", "toe0"),
    ),
    "Character Creator": Convention(
        hips="hip",
        trunk="waist spine01 spine02",
        neck="necktwist01 necktwist02",
        head="head",
        arm=("clavicle", "upperarm", "forearm", "hand"),
        leg=("thigh", "calf", "foot", "toebase"),
    ),
    "Daz Genesis 1 and 2": Convention(  # Poser, too
        hips="hip",
        trunk="abdomen abdomen2 chest",
        neck="neck",
        head="head",
        arm=("collar", "shldr", "forearm", "hand"),
        leg=("thigh", "shin", "foot", "toe"),
    ),
    "Daz Genesis 3 and 8": Convention(
        hips="hip",
        trunk="abdomenlower abdomenupper chestlower chestupper",
        neck="necklower neckupper",
        head="head",
        arm=("collar", "shldrbend", "forearmbend", "hand"),
        leg=("thighbend", "shin", "foot", "toe"),
    ),
    "Daz Genesis 9": Convention(
        hips="hip",
        trunk="spine1 spine2 spine3 spine4",
        neck="neck1 neck2",
        head="head",
        arm=("shoulder", "upperarm", "forearm", "hand"),
        leg=("thigh", "shin", "foot", "toes"),
    ),
    "Xsens": Convention(  # MVNX: segments
        hips="pelvis",
        trunk="l5 l3 t12 t8",
        neck="neck",
        head="head",
        arm=("shoulder", "upperarm", "forearm", "hand"),
        leg=("upperleg", "lowerleg", "foot", "toe"),
    ),
    "MVNX": Convention(  # MVNX: joints
        hips="pelvis",
        trunk="jl5s1 jl4l3 jl1t12 jt9t8",
        neck="jt1c7",
        head="jc1head",
        arm=("j{s}t4shoulder j{s}c7shoulder", "j{s}shoulder", "j{s}elbow", "j{s}wrist"),
        leg=("j{s}hip", "j{s}knee", "j{s}ankle", "j{s}ballfoot"),
    ),
    "OptiTrack": Convention(
        hips="hip",
        trunk="ab chest",
        neck="neck",
        head="head",
        arm=("shoulder", "uarm", "farm", "hand"),
        leg=("thigh", "shin", "foot", "toe"),
    ),
    "Vicon": Convention(  # and the CMU data base's own ASF
        hips="pelvis root",
        trunk="lowerback upperback thorax",
        neck="lowerneck neck upperneck",
        head="head",
        arm=("clavicle", "humerus", "radius", "wrist hand"),
        leg=("femur", "tibia", "foot", "toes"),
    ),
    "Plug-in Gait": Convention(
        hips="pel pelvis",
        trunk="trx thorax",
        neck="-",
        head="hed head",
        arm=("cl", "hu", "ra", "hn"),
        leg=("fe", "ti", "fo", "to"),
    ),
}
