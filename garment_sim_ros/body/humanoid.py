"""Which joint of a rig is which bone of a human, decided by joint names and hierarchy.

Names are compared whole, after lower-casing and dropping separators and what all joints of the rig
begin or end with, with one table per naming convention (`rig_names`); the convention that explains
most joints wins. Where none explains all limbs, the words in the names of a robot's hinges may
(`robot_names`). A joint that neither names stays unmapped: nothing is guessed from its position.
"""

import functools
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.body.rig import Rig
from garment_sim_ros.body.rig_names import ARM, CONVENTIONS, LEG, MIDDLE, PREFERRED, SIDES
from garment_sim_ros.body.robot_names import TRUNK_LINK, robot_bones
from garment_sim_ros.body.skin import HUMANOID_BONES
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.plain_data import read_yaml

_MAX_OVERRIDE_BYTES = 100_000


_SEPARATORS = re.compile(r"[\s_.:|\-]+")
_PREFIX = re.compile(r"^(?:.*[:|])?(?:mixamorig\d*_?|skeleton_)?", re.IGNORECASE)
_NUMBERED = re.compile(r"_\d+$")
_FEWEST = 8
"""So many joints with the same beginning or end may be called so for what they belong to."""
_MOST_TRIED = 6
_DEEPEST = 4
"""Separators from a name's end within which a shared beginning or end may stop."""


def _normalise(name: str) -> str:
    return _SEPARATORS.sub("", name).lower()


def _shared(parts: Iterable[list[str]], total: int, least: float) -> list[str]:
    """Beginnings or ends that many names share, the most common first; "" always."""
    count = Counter(part for some in parts for part in some)
    enough = max(_FEWEST, least * total)
    common = [part for part, n in count.most_common(_MOST_TRIED) if n >= enough]
    return ["", *common]


def _spellings(joint_names: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """The names without what they share: the beginning left out, and a name per joint.

    The name is empty for joints that do not begin, or end, with what is left out.
    """
    joint_names = [_PREFIX.sub("", name) for name in joint_names]
    numbers = {m.group() for m in map(_NUMBERED.search, joint_names) if m}
    if len(numbers) > 0.9 * len(joint_names):  # a number of its own for each, from an exporter
        joint_names = [_NUMBERED.sub("", name) for name in joint_names]
    cuts = [[m.span() for m in _SEPARATORS.finditer(name)] for name in joint_names]
    begins = _shared(
        ([name[:e] for _, e in at[:_DEEPEST]] for name, at in zip(joint_names, cuts)),
        len(joint_names),
        0.1,
    )
    ends = _shared(
        ([name[b:] for b, _ in at[-_DEEPEST:]] for name, at in zip(joint_names, cuts)),
        len(joint_names),
        0.5,
    )
    for begin in begins:
        for end in ends:
            yield (
                _normalise(begin),
                [
                    _normalise(name[len(begin) : len(name) - len(end)])
                    if name.startswith(begin) and name.endswith(end)
                    else ""
                    for name in joint_names
                ],
            )


def _ancestors(joint: int, parent: Sequence[int] | NDArray[np.int32]) -> list[int]:
    """The joint and everything above it, lowest first."""
    path = [joint]
    while (joint := int(parent[joint])) >= 0:
        path.append(joint)
    return path


def _trunk_bones(joints: list[int], names: list[str], certain: dict[str, str]) -> dict[str, int]:
    """Share spine, chest and upperChest out among the trunk's joints, lowest first."""
    if certain:
        return {certain[name]: joint for joint, name in zip(joints, names)}
    if not joints:
        return {}
    if len(joints) == 1:
        return {"chest": joints[0]}
    if len(joints) == 2:
        return {"spine": joints[0], "chest": joints[1]}
    return {"spine": joints[0], "chest": joints[len(joints) // 2], "upperChest": joints[-1]}


def _sided(names: str, side: str) -> list[str]:
    """All that one side's joint may be called."""
    spelled = []
    for name in names.split():
        if "{s}" in name:
            spelled += [name.format(s=word) for word in SIDES[side]]
        elif name != "-":
            spelled += [f"{word}{name}" for word in SIDES[side]]
            spelled += [f"{name}{word}" for word in SIDES[side]]
    return spelled


def _central(names: str) -> list[str]:
    """All that a joint in the middle may be called."""
    return [
        spelled
        for name in names.split()
        for word in MIDDLE
        for spelled in dict.fromkeys((f"{word}{name}", f"{name}{word}"))
    ]


@functools.cache
def _names_of(convention: str) -> tuple[dict[str, list[str]], dict[str, str], bool]:
    """A convention spelled out.

    Returns:
        Bone to joint names; the trunk's joint names to bones; whether these are certain.
    """
    table = CONVENTIONS[convention]
    names = {"hips": _central(table.hips), "neck": _central(table.neck)}
    names["head"] = _central(table.head)
    for part, called in zip((*ARM, *LEG), (*table.arm, *table.leg)):
        for side in SIDES:
            names[f"{side}{part}"] = _sided(called, side)
    names.update((bone, called.split()) for bone, called in table.single)
    trunk = {}
    for entry in table.trunk.split():
        name, _, bone = entry.partition("=")
        trunk.update(dict.fromkeys(_central(name), bone))
    return names, trunk, all(trunk.values())


def _match(
    convention: str, spelled: list[str], parent: Sequence[int] | NDArray[np.int32]
) -> dict[str, int]:
    """Bones that one convention finds: bone name to joint index."""
    names, trunk, certain = _names_of(convention)
    joint_of: dict[str, int] = {}
    for joint, name in enumerate(spelled):
        joint_of.setdefault(name, joint)
    joint_of.pop("", None)
    found = {}
    for bone, called in names.items():
        at = next((joint_of[name] for name in called if name in joint_of), None)
        if at is not None:
            found[bone] = at
    # Rigs that count through from the pelvis to the head begin the neck at one number or another;
    # what the arms hang on is trunk.
    arms = ("leftShoulder", "leftUpperArm", "rightShoulder", "rightUpperArm")
    carrying = {
        above for bone in arms if bone in found for above in _ancestors(found[bone], parent)
    }
    called_neck = [joint_of[name] for name in names["neck"] if name in joint_of]
    if free := [joint for joint in called_neck if joint not in carrying]:
        found["neck"] = free[0]
    ends = ("neck", "head", *arms)
    above = next((found[bone] for bone in ends if bone in found), None)
    if above is not None:
        path = _ancestors(above, parent)[:0:-1]
        if found.get("hips") in path:
            path = path[path.index(found["hips"]) + 1 :]
        between = [joint for joint in path if spelled[joint] in trunk]
        called = [spelled[joint] for joint in between]
        found.update(_trunk_bones(between, called, trunk if certain else {}))
    return _consistent(found, parent)


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
    best: dict[str, int] = {}
    rank = (0, 0)
    for begin, spelled in _spellings(joint_names):
        liked = len(PREFERRED) - PREFERRED.index(begin) if begin in PREFERRED else 0
        for convention in CONVENTIONS:
            found = _match(convention, spelled, parent)
            if (len(found), liked) > rank:
                best, rank = found, (len(found), liked)
    mapping = {bone: joint_names[joint] for bone, joint in best.items()}
    return overridden(mapping, joint_names, overrides or {})


_LIMBS = frozenset(
    f"{side}{part}" for side in SIDES for part in ("UpperLeg", "LowerLeg", "UpperArm", "LowerArm")
)


def humanoid_of_rig(rig: Rig, overrides: Mapping[str, str | None] | None = None) -> dict[str, str]:
    """`humanoid_map` of a rig, by the names of its hinges where those of its joints say less.

    Args:
        rig: The rig; that of a URDF, whose channels have names of their own.
        overrides: As for `humanoid_map`.

    Raises:
        ParameterError: An override names an unknown bone or joint.
    """
    mapping = humanoid_map(rig.joint_names, rig.parent)
    if not {"hips", *_LIMBS} <= mapping.keys():
        told = robot_bones(rig)
        trunk = [told.pop(bone) for bone in list(told) if bone.startswith(TRUNK_LINK)]
        told.update(_trunk_bones(trunk, [], {}))
        if len(told) > len(mapping):
            mapping = {bone: rig.joint_names[joint] for bone, joint in told.items()}
    return overridden(mapping, rig.joint_names, overrides or {})


def overridden(
    mapping: Mapping[str, str], joint_names: Sequence[str], overrides: Mapping[str, str | None]
) -> dict[str, str]:
    """A mapping with `overrides` as for `humanoid_map`.

    Raises:
        ParameterError: An override names an unknown bone or joint.
    """
    mapping = dict(mapping)
    for bone, joint in overrides.items():
        if bone not in HUMANOID_BONES:
            raise ParameterError(
                "bone names",
                f"found the unknown bone {bone!r}",
                f"allowed: {', '.join(HUMANOID_BONES)}",
            )
        if joint is None:
            mapping.pop(bone, None)
        elif joint in joint_names:
            mapping[bone] = joint
        else:
            raise ParameterError(
                f"bone names: {bone}",
                f"found {joint!r}, which is no joint of the rig",
                f"allowed: {', '.join(joint_names)}",
            )
    return {bone: mapping[bone] for bone in HUMANOID_BONES if bone in mapping}


def load_humanoid_overrides(path: str | Path) -> dict[str, str | None]:
    """Read a YAML file of ``bone: joint`` lines, ``bone: null`` for a bone the rig lacks.

    Raises:
        InputFileError: The file is missing, too large or is not such a mapping.
    """
    allowed = "a YAML mapping of humanoid bone to joint name or null"
    content = read_yaml(path, limit=_MAX_OVERRIDE_BYTES)
    if not isinstance(content, dict):
        raise InputFileError(path, f"holds a {type(content).__name__}", f"allowed: {allowed}")
    for bone, joint in content.items():
        if bone not in HUMANOID_BONES or not (joint is None or isinstance(joint, str)):
            raise InputFileError(
                path,
                f"entry {str(bone)[:60]!r}: {str(joint)[:60]!r} is not allowed",
                f"allowed: {allowed}; bones: {', '.join(HUMANOID_BONES)}",
            )
    return content
