"""Which joint of a rig is which bone of a human, decided by joint names and hierarchy.

Names are compared whole, after lower-casing and dropping separators, with one table per naming
convention; the convention that explains most joints wins. A joint that no table names stays
unmapped: nothing is guessed from its position.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from garment_sim_ros.body.skin import HUMANOID_BONES
from garment_sim_ros.errors import InputFileError, ParameterError

_MAX_OVERRIDE_BYTES = 100_000


@dataclass(frozen=True)
class _Convention:
    """Joint names of one kind of rig, normalised as by `_normalise`.

    Attributes:
        hips: Names of the pelvis joint.
        trunk: Names of the joints between pelvis and neck, from any of which the rig may leave
            some out.
        neck: Names of the neck's joints, lowest first; the first one present is the neck.
        head: Names of the head joint.
        limbs: Part name (as in ``left<Part>``) to joint names in which ``{s}`` is the side, or
            one side's bone to its joint names.
        sides: What stands for left and right.
    """

    hips: tuple[str, ...]
    trunk: tuple[str, ...]
    neck: tuple[str, ...]
    head: tuple[str, ...]
    limbs: dict[str, tuple[str, ...]]
    sides: tuple[str, str] = ("l", "r")


_CONVENTIONS: dict[str, _Convention] = {
    "VRM": _Convention(
        hips=("hips", "jbipchips"),
        trunk=("spine", "chest", "upperchest", "jbipcspine", "jbipcchest", "jbipcupperchest"),
        neck=("neck", "jbipcneck"),
        head=("head", "jbipchead"),
        limbs={
            part: (f"{{s}}{part.lower()}", f"jbip{{s[0]}}{vroid}")
            for part, vroid in (
                ("Shoulder", "shoulder"),
                ("UpperArm", "upperarm"),
                ("LowerArm", "lowerarm"),
                ("Hand", "hand"),
                ("UpperLeg", "upperleg"),
                ("LowerLeg", "lowerleg"),
                ("Foot", "foot"),
                ("Toes", "toebase"),
            )
        },
        sides=("left", "right"),
    ),
    # Mixamo, Rokoko, FAIR, LAFAN and the CMU conversions that call the thigh LeftUpLeg.
    "Mixamo": _Convention(
        hips=("hips",),
        trunk=("lowerback", "spine", "spine1", "spine2", "spine3", "spine4"),
        neck=("neck", "neck1"),
        head=("head",),
        limbs={
            "Shoulder": ("{s}shoulder",),
            "UpperArm": ("{s}arm",),
            "LowerArm": ("{s}forearm",),
            "Hand": ("{s}hand",),
            "UpperLeg": ("{s}upleg",),
            "LowerLeg": ("{s}leg",),
            "Foot": ("{s}foot",),
            "Toes": ("{s}toebase", "{s}toe"),
        },
        sides=("left", "right"),
    ),
    # Joints called after the anatomical joint, as in DeepMimic and the other CMU conversions:
    # here LeftShoulder is the upper arm.
    "anatomical": _Convention(
        hips=("hips", "hip", "root", "pelvis"),
        trunk=("lowerback", "torso", "spine", "chest", "chest2", "chest3", "chest4"),
        neck=("lowerneck", "neck"),
        head=("head",),
        limbs={
            "Shoulder": ("{s}collar", "{s}clavicle"),
            "UpperArm": ("{s}shoulder",),
            "LowerArm": ("{s}elbow",),
            "Hand": ("{s}wrist",),
            "UpperLeg": ("{s}hip",),
            "LowerLeg": ("{s}knee",),
            "Foot": ("{s}ankle",),
            "Toes": ("{s}toe", "{s}toes"),
        },
        sides=("left", "right"),
    ),
    "MakeHuman": _Convention(
        hips=("root",),
        trunk=("spine05", "spine04", "spine03", "spine02", "spine01"),
        neck=("neck01", "neck02", "neck03"),
        head=("head",),
        limbs={
            "Shoulder": ("clavicle{s}",),
            "UpperArm": ("upperarm01{s}",),
            "LowerArm": ("lowerarm01{s}",),
            "Hand": ("wrist{s}",),
            "UpperLeg": ("upperleg01{s}",),
            "LowerLeg": ("lowerleg01{s}",),
            "Foot": ("foot{s}",),
            # The default rig has no joint for all toes; the big toe's would move only itself.
        },
    ),
    # REP-155 links without their _<id>; head_<id> is fixed to p_head_<id>, where it turns.
    "ROS4HRI": _Convention(
        hips=("body",),
        trunk=("waist", "torso"),
        neck=(),
        head=("phead",),
        limbs={
            "UpperArm": ("{s}shoulder",),
            "LowerArm": ("{s}elbow",),
            "Hand": ("{s}wrist",),
            "UpperLeg": ("{s}hip",),
            "LowerLeg": ("{s}knee",),
            "Foot": ("{s}ankle",),
        },
    ),
    "CesiumMan": _Convention(
        hips=("torsojoint1",),
        trunk=("torsojoint2", "torsojoint3"),
        neck=("neckjoint1",),
        head=("neckjoint2",),
        limbs={
            # The two arms are numbered in opposite directions.
            "leftUpperArm": ("armjointl4",),
            "leftLowerArm": ("armjointl3",),
            "leftHand": ("armjointl2",),
            "rightUpperArm": ("armjointr",),
            "rightLowerArm": ("armjointr2",),
            "rightHand": ("armjointr3",),
            "UpperLeg": ("legjoint{s}1",),
            "LowerLeg": ("legjoint{s}2",),
            "Foot": ("legjoint{s}3",),
            "Toes": ("legjoint{s}5",),
        },
    ),
    "Unreal": _Convention(
        hips=("pelvis",),
        trunk=("spine01", "spine02", "spine03", "spine04", "spine05"),
        neck=("neck01", "neck02"),
        head=("head",),
        limbs={
            "Shoulder": ("clavicle{s}",),
            "UpperArm": ("upperarm{s}",),
            "LowerArm": ("lowerarm{s}",),
            "Hand": ("hand{s}",),
            "UpperLeg": ("thigh{s}",),
            "LowerLeg": ("calf{s}",),
            "Foot": ("foot{s}",),
            "Toes": ("ball{s}",),
        },
    ),
    "SMPL": _Convention(
        hips=("pelvis",),
        trunk=("spine1", "spine2", "spine3"),
        neck=("neck",),
        head=("head",),
        limbs={
            "Shoulder": ("{s}collar",),
            "UpperArm": ("{s}shoulder",),
            "LowerArm": ("{s}elbow",),
            "Hand": ("{s}wrist",),
            "UpperLeg": ("{s}hip",),
            "LowerLeg": ("{s}knee",),
            "Foot": ("{s}ankle",),
            "Toes": ("{s}foot",),
        },
    ),
}

_PREFIX = re.compile(r"^(?:.*[:|])?(?:mixamorig\d*_?|skeleton_)?", re.IGNORECASE)
_SEPARATORS = re.compile(r"[\s_.\-]+")


def _normalise(name: str) -> str:
    return _SEPARATORS.sub("", _PREFIX.sub("", name)).lower()


def _without_person_id(names: Sequence[str]) -> list[str]:
    """REP-155 names end in ``_<id>``, the same for all links of a person: left out here."""
    for name in names:
        if name.startswith("body_") and f"torso_{name[5:]}" in names:
            return [other.removesuffix(name[4:]) for other in names]
    return list(names)


def _ancestors(joint: int, parent: Sequence[int] | NDArray[np.int32]) -> list[int]:
    """The joint and everything above it, lowest first."""
    path = [joint]
    while (joint := int(parent[joint])) >= 0:
        path.append(joint)
    return path


def _trunk_bones(joints: list[int], convention: str, normalised: list[str]) -> dict[str, int]:
    """Share spine, chest and upperChest out among the trunk's joints, lowest first."""
    if convention == "VRM":  # its names are those of the bones, however many there are
        keys = {"spine": "spine", "upperchest": "upperChest", "chest": "chest"}
        return {keys[normalised[j].removeprefix("jbipc")]: j for j in joints}
    if not joints:
        return {}
    if len(joints) == 1:
        return {"chest": joints[0]}
    if len(joints) == 2:
        return {"spine": joints[0], "chest": joints[1]}
    return {"spine": joints[0], "chest": joints[len(joints) // 2], "upperChest": joints[-1]}


def _match(
    convention: str, normalised: list[str], parent: Sequence[int] | NDArray[np.int32]
) -> dict[str, int]:
    """Bones that one convention finds: bone name to joint index."""
    table = _CONVENTIONS[convention]
    joint_of: dict[str, int] = {}
    for joint, name in enumerate(normalised):
        joint_of.setdefault(name, joint)

    def first(names: Sequence[str]) -> int | None:
        return next((joint_of[name] for name in names if name in joint_of), None)

    found: dict[str, int | None] = {
        "hips": first(table.hips),
        "neck": first(table.neck),
        "head": first(table.head),
    }
    for part, names in table.limbs.items():
        if part in HUMANOID_BONES:
            found[part] = first(names)
            continue
        for side, word in zip(("left", "right"), table.sides):
            found[side + part] = first([name.format(s=word) for name in names])
    ends = ("neck", "head", "leftShoulder", "leftUpperArm", "rightShoulder", "rightUpperArm")
    above = next((found[bone] for bone in ends if found.get(bone) is not None), None)
    if above is not None:
        path = _ancestors(above, parent)[::-1]
        trunk = [joint for joint in path if normalised[joint] in table.trunk]
        found.update(_trunk_bones(trunk, convention, normalised))
    return _consistent({b: j for b, j in found.items() if j is not None}, parent)


_CHAINS: tuple[tuple[str, ...], ...] = (
    ("hips", "spine", "chest", "upperChest", "neck", "head"),
    ("hips", "spine", "chest", "leftShoulder", "leftUpperArm", "leftLowerArm", "leftHand"),
    ("hips", "spine", "chest", "rightShoulder", "rightUpperArm", "rightLowerArm", "rightHand"),
    ("hips", "leftUpperLeg", "leftLowerLeg", "leftFoot", "leftToes"),
    ("hips", "rightUpperLeg", "rightLowerLeg", "rightFoot", "rightToes"),
)


def _consistent(
    found: dict[str, int], parent: Sequence[int] | NDArray[np.int32]
) -> dict[str, int]:
    """Leave out bones whose joint does not hang below the joint of the bone before it."""
    kept = dict(found)
    for chain in _CHAINS:
        last: int | None = None
        for bone in chain:
            if bone not in kept:
                continue
            if last is not None and last not in _ancestors(kept[bone], parent)[1:]:
                del kept[bone]
            else:
                last = kept[bone]
    return kept


def humanoid_map(
    joint_names: Sequence[str],
    parent: Sequence[int] | NDArray[np.int32],
    overrides: Mapping[str, str | None] | None = None,
) -> dict[str, str]:
    """Joint name of each humanoid bone that a rig has.

    Args:
        joint_names: The rig's joints.
        parent: Parent of each joint, -1 for roots; parents precede their children.
        overrides: Humanoid bone to joint name, or to None for "has no such bone"; these win over
            the tables and are not checked against the hierarchy.

    Returns:
        Bone (a key of `HUMANOID_BONES`, in that order) to joint name. Bones that neither the
        tables nor the overrides name are absent.

    Raises:
        ParameterError: An override names an unknown bone or joint.
    """
    normalised = [_normalise(name) for name in _without_person_id(joint_names)]
    best: dict[str, int] = {}
    for convention in _CONVENTIONS:
        found = _match(convention, normalised, parent)
        if len(found) > len(best):
            best = found
    mapping = {bone: joint_names[joint] for bone, joint in best.items()}
    for bone, joint in (overrides or {}).items():
        if bone not in HUMANOID_BONES:
            raise ParameterError(
                "humanoid override",
                f"unknown bone {bone!r}",
                f"known: {', '.join(HUMANOID_BONES)}",
            )
        if joint is None:
            mapping.pop(bone, None)
        elif joint in joint_names:
            mapping[bone] = joint
        else:
            raise ParameterError(
                f"humanoid override {bone}",
                f"the rig has no joint {joint!r}",
                f"its joints: {', '.join(joint_names)}",
            )
    return {bone: mapping[bone] for bone in HUMANOID_BONES if bone in mapping}


def load_humanoid_overrides(path: str | Path) -> dict[str, str | None]:
    """Read a YAML file of ``bone: joint`` lines, ``bone: null`` for a bone the rig lacks.

    Raises:
        InputFileError: The file is missing, too large or is not such a mapping.
    """
    allowed = "a YAML mapping of humanoid bone to joint name or null"
    try:
        with open(path, "rb") as file:
            data = file.read(_MAX_OVERRIDE_BYTES + 1)
    except OSError as error:
        raise InputFileError(path, f"cannot be read ({error.strerror})", allowed) from error
    if len(data) > _MAX_OVERRIDE_BYTES:
        raise InputFileError(path, "is too large", f"up to {_MAX_OVERRIDE_BYTES} bytes")
    try:
        content = yaml.safe_load(data)
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise InputFileError(
            path, f"is not plain YAML ({type(error).__name__})", allowed
        ) from error
    if not isinstance(content, dict):
        raise InputFileError(path, f"holds a {type(content).__name__}", allowed)
    for bone, joint in content.items():
        if bone not in HUMANOID_BONES or not (joint is None or isinstance(joint, str)):
            raise InputFileError(
                path,
                f"entry {str(bone)[:60]!r}: {str(joint)[:60]!r} is not allowed",
                f"{allowed}; bones: {', '.join(HUMANOID_BONES)}",
            )
    return content
