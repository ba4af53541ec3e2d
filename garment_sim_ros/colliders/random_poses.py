"""Poses within the range of a body's joints, drawn at random: what fits are made and judged over.

All joints turn at once. What a bone does is its own turn and those of all above it. In the trunk,
the neck and the forearm the joints between two major bones share a turn, as retargeting has it.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.major_bones import MajorBones, major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.range_of_motion import across, swing_limit
from garment_sim_ros.colliders.regions import bone_weights

_ALSO = ("leftToes", "rightToes")
_SHARING = ("spine", "chest", "upperChest", "neck", "head")
_TWIST = {
    "spine": 15.0,
    "chest": 15.0,
    "upperChest": 5.0,
    "neck": 30.0,
    "head": 30.0,
    "UpperArm": 45.0,
    "LowerArm": 45.0,
    "UpperLeg": 30.0,
}
"""Degrees that a bone turns about itself to each side, by humanoid bone without its side."""
_USED = {"spine": 0.7, "chest": 0.7}
"""Share of their range that joints of the trunk use, as all turn at once."""
_COLLAR = 10.0
"""Degrees that a collar bone turns up and down, forwards and backwards."""
_BEHIND = 0.6
"""How far an upper arm points backwards at most: the part of its unit direction."""
_ACROSS = 0.7
"""How far an upper arm points to the other side at most."""


def random_poses(body: Body, count: int, *, seed: int = 0) -> FloatArray:
    """World transforms of a rig's joints in poses within its range, shape [count, n, 4, 4].

    Args:
        body: Rig and skin; its hips stay where they are.
        count: Number of poses.
        seed: Other numbers give other poses.
    """
    rng = np.random.default_rng(seed)
    bones = major_bones(body, also=_ALSO)
    rest = rest_transforms(body.rig)
    along = _along(body, bones, rest)
    turn: dict[int, FloatArray] = {}
    for m, bone in enumerate(bones.human):
        if bones.parent[m] < 0:
            continue
        joint = int(bones.first[m])
        chain = [joint]
        above = int(body.rig.parent[joint])
        while bone in _SHARING and above not in (-1, bones.joint[bones.parent[m]]):
            chain.append(above)
            above = int(body.rig.parent[above])
        turns = _turns(bone, along[m], count, rng)
        turn |= {j: Rotation.from_rotvec(turns / len(chain)).as_matrix() for j in chain}
    for side in ("left", "right"):
        if {f"{side}Shoulder", f"{side}UpperArm"} <= body.humanoid.keys():
            joint, arm = (
                body.rig.index(body.humanoid[side + b]) for b in ("Shoulder", "UpperArm")
            )
            along_collar = rest[arm, :3, 3] - rest[joint, :3, 3]
            if np.linalg.norm(along_collar) > 1e-6:
                turn[joint] = _shrugged(along_collar, count, rng)
    motion = np.tile(np.eye(4), (count, len(rest), 1, 1))
    for j, above in enumerate(body.rig.parent):
        if above >= 0:
            motion[:, j] = motion[:, above]
        if j in turn:
            local = np.tile(np.eye(4), (count, 1, 1))
            local[:, :3, :3] = turn[j]
            local[:, :3, 3] = rest[j, :3, 3] - turn[j] @ rest[j, :3, 3]
            motion[:, j] = motion[:, j] @ local
    poses: FloatArray = motion @ rest
    return poses


def _along(body: Body, bones: MajorBones, rest: FloatArray) -> FloatArray:
    """Unit directions of major bones: from the joint to the middle of its skin, shape [m, 3]."""
    owner = bone_weights(body.skin, bones).argmax(axis=1)
    along = np.tile([0.0, 0.0, 1.0], (len(bones), 1))
    for m, joint in enumerate(bones.first):
        own = body.skin.vertices[owner == m]
        way = own.mean(axis=0) - rest[joint, :3, 3] if len(own) else np.zeros(3)
        length = float(np.linalg.norm(way))
        if length > 1e-6:
            along[m] = way / length
    return along


def _turns(bone: str, along: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Random turns of a bone that points along a unit direction, as rotation vectors [rad]."""
    part = bone.removeprefix("left").removeprefix("right")
    most = np.radians(_TWIST.get(part, 0.0))
    twist, swing = np.empty((count, 3)), np.empty((count, 3))
    limit, share = np.empty((count, 1)), np.empty((count, 1))
    ahead, beside = across(along)
    for i in range(count):
        twist[i] = along * rng.uniform(-most, most)
        if part == "UpperArm":
            swing[i] = _raised(bone.startswith("left"), along, rng)
        else:
            azimuth = rng.uniform(0.0, 2.0 * np.pi)
            swing[i] = np.cos(azimuth) * ahead + np.sin(azimuth) * beside
            limit[i] = np.radians(swing_limit(part, azimuth)) * _USED.get(part, 1.0)
            share[i] = rng.uniform()
    if part != "UpperArm":
        swing = np.cross(along, swing) * limit * share
    turns: FloatArray = (Rotation.from_rotvec(swing) * Rotation.from_rotvec(twist)).as_rotvec()
    return turns


def _shrugged(along: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Random turns of a collar bone that lies along a direction, shape [count, 3, 3]."""
    axes = np.cross(along / np.linalg.norm(along), [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    angles = np.radians(rng.uniform(-_COLLAR, _COLLAR, (count, 2)))
    return Rotation.from_rotvec(angles @ axes).as_matrix()


def _raised(left: bool, along: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A turn of an upper arm to any direction that a shoulder reaches."""
    while True:
        to = rng.normal(size=3)
        to /= np.linalg.norm(to)
        aside = to[1] if left else -to[1]
        if to[0] < -_BEHIND or aside < -_ACROSS or (aside < 0.0 and to[0] < 0.3):
            continue
        axis = np.cross(along, to)
        length = float(np.linalg.norm(axis))
        if length < 1e-6:
            continue
        swing: FloatArray = axis / length * np.arctan2(length, float(along @ to))
        return swing
