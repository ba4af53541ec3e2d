"""What the joints of robots are called: after the joint of a person that they are part of.

A robot's hip is two or three hinges, one after the other, called ``left_hip_pitch_joint``,
``LHipRoll``, ``l_hip_yaw``, ``LLEG_HIP_Y`` or ``leftHipYaw``; or those of a limb are numbered from
the trunk on, as ``leg_left_1_joint`` is. Words of a name say the side and the part; others, such
as those of the axis, say nothing here. The bone is the link of the hinge where the axes of a part
meet, the first one where they meet in one place: that is where a person has the joint.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.rig import ROTATION, Rig

_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}
_PARTS = {
    "hip": "hip hp",
    "knee": "knee kne kn",
    "ankle": "ankle ank an ak",
    "collar": "clavicle collar scapula",
    "shoulder": "shoulder shldr sho shl sh",
    "elbow": "elbow elb el",
    "wrist": "wrist wri wr",
    "trunk": "waist torso chest trunk spine back bk lumbar abdomen thorax",
    "neck": "neck cervical",
    "head": "head",
    "leg": "leg",
    "arm": "arm",
}
_PART_OF = {word: part for part, words in _PARTS.items() for word in words.split()}
_MIDDLE = ("trunk", "neck", "head")
_AXES = "xyz"
_WITH_AXIS = ("hp", "kn", "ak", "sh", "el", "wr", "bk")
"""Words that the letter of an axis may follow."""
_GLUED = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist", "leg", "arm")
"""Words that a side may precede; those of limbs may also have it after them."""
_LIMBS = {
    "leg": {6: "hip hip hip knee ankle ankle"},
    "arm": {
        4: "shoulder shoulder shoulder elbow",
        5: "shoulder shoulder shoulder elbow wrist",
        6: "shoulder shoulder shoulder elbow wrist wrist",
        7: "shoulder shoulder shoulder elbow wrist wrist wrist",
    },
}
"""Parts of the hinges of a limb that are only numbered, by how many there are."""
_NEAR = 0.01
"""Distance within which hinges are in one place, as a share of the rig's size."""
_LITTLE = 1e-3
"""Weight of the hinges' origins against their axes, which say nothing along parallel ones."""
_MOST_HINGES = 256
"""A robot with more has no names that are worth the time."""
_ENDS = {
    "hand": "hand wrist palm gripper",
    "foot": "foot sole ankle",
    "head": "head",
    "neck": "neck",
}
"""What links that do not turn are called where a robot has no hinge there."""
_BONES = {
    "hip": "UpperLeg",
    "knee": "LowerLeg",
    "ankle": "Foot",
    "collar": "Shoulder",
    "shoulder": "UpperArm",
    "elbow": "LowerArm",
    "wrist": "Hand",
}

TRUNK_LINK = "trunk"
"""What the links of a trunk are called, before their number from the hips up."""


class _Called(NamedTuple):
    """What a name says: a side, or "", and a part, or ""."""

    side: str
    part: str


def robot_bones(rig: Rig) -> dict[str, int]:
    """The joint of each humanoid bone that the names of a rig's hinges tell.

    Args:
        rig: A rig with channels, at most one for each joint.

    Returns:
        Bone, without those of the trunk, to joint; and the links of the trunk that turn, from the
        hips up, as ``trunk0``, ``trunk1`` ... Empty unless hips and knees, or shoulders and
        elbows, of both sides are told.
    """
    called = _all_called(rig)
    rows = _rows(rig, called)
    T = rest_transforms(rig)
    found = {bone: _middle(rig, T, joints) for bone, joints in rows.items()}
    for side in ("left", "right"):
        _ends(found, rig, side)
    tops = {}
    for part in ("hip", "shoulder"):
        first = [joints[0] for bone, joints in rows.items() if bone.endswith(_BONES[part])]
        if len(first) == 2:
            tops[part] = _common(rig, first)
    if not tops:
        return {}
    if "hip" in tops:
        found["hips"] = tops["hip"]
    found.update(_trunk(rig, tops, called))
    found.update(_head(rig, tops, called))
    return found


def last_hinges(rig: Rig) -> dict[int, int]:
    """The last hinge of the part of each bone of `robot_bones`: it makes all the part's turns.

    Args:
        rig: As for `robot_bones`.

    Returns:
        Joint of a bone to joint of that hinge.
    """
    T = rest_transforms(rig)
    rows = _rows(rig, _all_called(rig)).values()
    return {_middle(rig, T, joints): joints[-1] for joints in rows}


def _all_called(rig: Rig) -> dict[int, _Called]:
    """What the name of each hinge says; nothing where there are too many."""
    moved_by = _names_of_hinges(rig)
    if len(moved_by) > _MOST_HINGES:
        return {}
    called = {j: _called(name) for j, name in moved_by.items()}
    _number(called, rig)
    return called


def _rows(rig: Rig, called: Mapping[int, _Called]) -> dict[str, list[int]]:
    """The hinges of each part of the limbs in a row, by the part's bone."""
    rows: dict[str, list[int]] = {}
    for side in ("left", "right"):
        for limb in (("hip", "knee", "ankle"), ("collar", "shoulder", "elbow", "wrist")):
            parts = {part: [j for j, c in called.items() if c == (side, part)] for part in limb}
            row = _in_a_row(parts, rig)
            if {"knee", "elbow"} & row.keys():
                rows.update((side + _BONES[part], joints) for part, joints in row.items())
    return rows


def _names_of_hinges(rig: Rig) -> dict[int, str]:
    """Name of the channel that turns each joint; none where one has several."""
    dofs = rig.dofs
    names: dict[int, str] = {}
    for j in np.unique(dofs.joint).tolist():
        of = np.flatnonzero(dofs.joint == j)
        if len(of) > 1:
            return {}
        if dofs.kind[of[0]] == ROTATION:
            names[int(j)] = dofs.names[int(of[0])]
    return names


def _words(name: str) -> list[str]:
    """``LHipYaw``, ``l_hip_yaw`` and ``L-HIP-YAW`` in three words each."""
    return [word.lower() for word in _WORDS.findall(name)]


def _called(name: str) -> _Called:
    """What the name of a hinge says."""
    words = _words(name)
    said = [_read(word) for word in words]
    # A word for a side goes before a letter; of those the first counts: a later R is a roll.
    sides = [_SIDES[word] for word in words if word in ("left", "right")]
    side = next((s for s in (*sides, *(of.side for of in said)) if s), "")
    if "to" in words:  # of a hinge between two, the second one is what it turns
        said = said[words.index("to") + 1 :]
    numbered = any(word.isdigit() for word in words)
    limb = [of.part for of in said if of.part in _BONES]
    limb += [of.part for of in said if of.part in _LIMBS and numbered]
    if side and limb:
        return _Called(side, limb[0])
    return _Called("", next((of.part for of in said if of.part in _MIDDLE), ""))


def _read(word: str) -> _Called:
    """Side and part that one word stands for."""
    if word in _SIDES:
        return _Called(_SIDES[word], "")
    if word in _PART_OF:
        return _Called("", _PART_OF[word])
    if word[:-1] in _WITH_AXIS and word[-1] in _AXES:
        return _Called("", _PART_OF[word[:-1]])
    for spelled, side in _SIDES.items():
        before, after = word.removeprefix(spelled), word.removesuffix(spelled)
        if before != word and before in _GLUED:
            return _Called(side, _PART_OF[before])
        if after != word and after in _LIMBS:
            return _Called(side, after)
    return _Called("", "")


def _number(called: dict[int, _Called], rig: Rig) -> None:
    """Tell the parts of limbs whose hinges are only numbered."""
    for limb, parts in _LIMBS.items():
        for side in ("left", "right"):
            row = [j for j, c in called.items() if c == (side, limb)]
            names = parts.get(len(row), "").split()
            for k, j in enumerate(row):
                if names and (k == 0 or row[k - 1] in _above(rig, j)):
                    called[j] = _Called(side, names[k])
                else:
                    called[j] = _Called("", "")


def _above(rig: Rig, joint: int) -> list[int]:
    """The joint and all that it hangs on, lowest first."""
    path = [joint]
    while (joint := int(rig.parent[joint])) >= 0:
        path.append(joint)
    return path


def _in_a_row(parts: Mapping[str, Sequence[int]], rig: Rig) -> dict[str, list[int]]:
    """Of the parts of a limb, from the trunk on, those that hang on each other."""
    row: dict[str, list[int]] = {}
    last: int | None = None
    for part, joints in parts.items():
        here = [j for j in joints if last is None or last in _above(rig, j)[1:]]
        if here:
            # Where a part branches, as into fingers, the branch of its first joint counts.
            here = [j for j in here if here[0] in _above(rig, j)]
            row[part], last = here, here[-1]
    return row


def _middle(rig: Rig, T: FloatArray, joints: Sequence[int]) -> int:
    """Of the hinges of a part, the first one near the place that is nearest to all their axes.

    Args:
        rig: The rig.
        T: Poses of its joints at rest, shape [n, 4, 4].
        joints: The hinges in a row.
    """
    origin = T[joints, :3, 3]
    of = [int(np.flatnonzero(rig.dofs.joint == j)[0]) for j in joints]
    axis = np.einsum("kij,kj->ki", T[joints, :3, :3], rig.dofs.axis[of])
    across = np.eye(3) - axis[:, :, None] * axis[:, None, :]
    # Parallel axes meet nowhere: along them the mean of the origins counts.
    weight = across.sum(axis=0) + _LITTLE * np.eye(3)
    place = np.linalg.solve(
        weight,
        np.einsum("kij,kj->i", across, origin) + _LITTLE * origin.mean(axis=0),
    )
    away = np.linalg.norm(origin - place, axis=1)
    size = float(np.ptp(T[:, :3, 3], axis=0).max())
    return joints[int(np.flatnonzero(away <= away.min() + _NEAR * size)[0])]


def _ends(found: dict[str, int], rig: Rig, side: str) -> None:
    """Hands and feet that no hinge turns: links on forearm or shank that are called so."""
    for end, bone, above in (("hand", "Hand", "LowerArm"), ("foot", "Foot", "LowerLeg")):
        if side + bone in found or side + above not in found:
            continue
        below = np.flatnonzero(rig.below(found[side + above])).tolist()
        named = _first_called(rig, (j for j in below if j != found[side + above]), _ENDS[end])
        if named is not None:
            found[side + bone] = named


def _first_called(rig: Rig, joints: Iterable[int], words: str) -> int | None:
    """The first of some joints that has one of these words in its own name."""
    for j in joints:
        if set(_words(rig.joint_names[j])) & set(words.split()):
            return j
    return None


def _common(rig: Rig, joints: Sequence[int]) -> int:
    """What several joints hang on, the lowest; the root where there is nothing else."""
    paths = [_above(rig, j)[1:] or [j] for j in joints]
    return next((j for j in paths[0] if all(j in path for path in paths)), paths[0][-1])


def _trunk(rig: Rig, tops: Mapping[str, int], called: Mapping[int, _Called]) -> dict[str, int]:
    """Links of the trunk that turn, from the hips up."""
    if "shoulder" not in tops:
        return {}
    path = _above(rig, tops["shoulder"])
    if tops.get("hip") in path:
        path = path[: path.index(tops["hip"])]
    turning = [j for j in reversed(path) if called.get(j, _Called("", "")).part == "trunk"]
    if not turning and path and "hip" in tops:
        turning = path[:1]  # what carries the arms, fixed to the hips
    return {f"{TRUNK_LINK}{k}": j for k, j in enumerate(turning)}


def _head(rig: Rig, tops: Mapping[str, int], called: Mapping[int, _Called]) -> dict[str, int]:
    """Neck and head: the first and the last hinge, or links that are called so."""
    top = tops.get("shoulder", tops.get("hip"))
    below = rig.below(top) if top is not None else np.zeros(len(rig), bool)
    of = {part: [j for j, c in called.items() if c.part == part] for part in ("neck", "head")}
    turning = [j for j in (*of["neck"], *of["head"]) if below[j]]
    turning = [j for j in turning if turning[0] in _above(rig, j)]
    if len(turning) > 1:
        return {"neck": turning[0], "head": turning[-1]}
    if turning:
        return {"head": turning[0]}  # whatever it is called, it carries the head
    ends = {
        bone: _first_called(rig, np.flatnonzero(below).tolist(), _ENDS[bone])
        for bone in ("neck", "head")
    }
    return {bone: j for bone, j in ends.items() if j is not None}
