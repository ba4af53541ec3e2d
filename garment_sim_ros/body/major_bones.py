"""The few bones that matter for colliders and garments; all small ones belong to one of them.

In a human, these are hips, spine, chest, upper chest, neck, head, upper and lower arms, hands,
upper and lower legs and feet: twist joints, fingers, face, toes and collar bones move with the
bone above them. In any other rig, a joint is major if the skin that it carries is a fair share of
the whole.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.rig import ROTATION, Rig
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.geometry.triangles import vertex_areas

HUMAN_MAJOR: tuple[str, ...] = (
    *("hips", "spine", "chest", "upperChest", "neck", "head"),
    *("leftUpperArm", "leftLowerArm", "leftHand", "leftUpperLeg", "leftLowerLeg", "leftFoot"),
    *("rightUpperArm", "rightLowerArm", "rightHand"),
    *("rightUpperLeg", "rightLowerLeg", "rightFoot"),
)
"""Humanoid bones that are major; the others belong to the next major one above."""

_MIN_HUMAN_BONES = 8
"""A body with fewer of `HUMAN_MAJOR` named is divided by size instead."""

_MIN_SHARE = 0.015
"""Smallest share of the skin's area that makes a joint major where names say nothing."""

_SAME_PLACE = 1e-3
"""Joints closer than this [m] are one ball joint made of several axes."""

_ONE_JOINT = 0.03
"""So is a hinge whose axis passes its parent by less than this share of the rig's size."""


@dataclass(frozen=True, kw_only=True)
class MajorBones:
    """The major bones of a body, parents before children.

    Attributes:
        names: Joint name of each, length m.
        joint: Joint index of each, shape [m].
        first: Joint from which on each one turns, shape [m]: `joint`, which may be the last hinge
            of a robot's hip, or the first one of it.
        human: Humanoid bone that each one is, "" for none.
        parent: Major bone above each, -1 for the topmost, shape [m].
        owner: Index of the major bone that each joint of the rig belongs to, shape [n].
        root: Joint that the body as a whole moves with: the hips, whether they carry skin or not;
            the topmost major bone where no joint is known to be the hips.
    """

    names: tuple[str, ...]
    joint: IntArray
    first: IntArray
    human: tuple[str, ...]
    parent: IntArray
    owner: IntArray
    root: str

    def __len__(self) -> int:
        return len(self.names)


def major_bones(body: Body, *, also: tuple[str, ...] = ()) -> MajorBones:
    """The major bones of a body; every one carries skin, its own or of a joint it owns.

    Args:
        body: Rig and skin.
        also: Humanoid bones that are to be major besides `HUMAN_MAJOR`.
    """
    carried = joint_areas(body.skin)
    named = {body.rig.index(body.humanoid[b]) for b in (*HUMAN_MAJOR, *also) if b in body.humanoid}
    enough = len(named) >= _MIN_HUMAN_BONES
    last = _ends_of_ball_joints(body.rig, named, carried) if enough else {}
    chosen = set(last.values()) or _by_size(body.rig.parent, carried)
    within = _within_ball_joints(last, body.rig.parent)
    owner_joint = _nearest_chosen(body.rig.parent, chosen, within)
    # A bone that carries nothing at all is left to the bones around it.
    total = np.bincount(owner_joint, carried, minlength=len(carried))
    chosen = {j for j in chosen if total[j] > 0.0} or {int(np.argmax(carried))}
    owner_joint = _nearest_chosen(body.rig.parent, chosen, within)

    joint = np.array(sorted(chosen), dtype=np.int32)
    above = body.rig.parent[joint]
    for k in range(len(joint)):
        while above[k] >= 0 and owner_joint[above[k]] == joint[k]:
            above[k] = body.rig.parent[above[k]]
    parent = np.where(above >= 0, np.searchsorted(joint, owner_joint[above]), -1)
    parent[parent >= np.arange(len(joint))] = -1
    human = {body.rig.index(name): bone for bone, name in body.humanoid.items()}
    first = {last[j]: j for j in sorted(last, reverse=True)}
    human |= {end: human[j] for end, j in first.items()}
    root = joint[0]
    if "hips" in body.humanoid:
        hips = body.rig.index(body.humanoid["hips"])
        root = last.get(hips, hips)
    return MajorBones(
        names=tuple(body.rig.joint_names[j] for j in joint),
        joint=joint,
        first=np.array([first.get(j, j) for j in joint.tolist()], np.int32),
        human=tuple(human.get(j, "") for j in joint.tolist()),
        parent=parent.astype(np.int32),
        owner=np.searchsorted(joint, owner_joint).astype(np.int32),
        root=body.rig.joint_names[root],
    )


def joint_areas(skin: Skin) -> FloatArray:
    """Skin area that each joint carries by its weights [m^2], shape [n]."""
    share = vertex_areas(skin.vertices, skin.triangles)[:, None] * skin.weight
    carried = np.bincount(skin.bone.ravel(), share.ravel(), minlength=len(skin.T_bone_bind))
    return carried.astype(np.float64)


def _in_one_place(rig: Rig) -> NDArray[np.bool_]:
    """Whether each joint makes one ball joint with its parent, shape [n].

    Robots have the hinge by which a thigh turns about itself some way down; its axis goes through
    the hip all the same.
    """
    T = rest_transforms(rig)
    above = T[np.maximum(rig.parent, 0), :3, 3]
    off = above - T[:, :3, 3]
    same = np.linalg.norm(off, axis=1) < _SAME_PLACE
    dofs = rig.dofs
    hinges = np.bincount(dofs.joint, minlength=len(rig)) == 1
    near = _ONE_JOINT * float(np.ptp(T[:, :3, 3], axis=0).max())
    for j, kind, axis in zip(dofs.joint, dofs.kind, dofs.axis, strict=True):
        if hinges[j] and kind == ROTATION:
            same[j] |= bool(np.linalg.norm(np.cross(T[j, :3, :3] @ axis, off[j])) < near)
    return same & (rig.parent >= 0)


def _ends_of_ball_joints(rig: Rig, named: set[int], carried: FloatArray) -> dict[int, int]:
    """Of the joints in the place of each named one the last that has skin: it makes all turns.

    All named joints below hang on it, and where there are none most of the skin: a twist joint,
    or a cover, beside them is no end.
    """
    same = _in_one_place(rig)
    children: list[list[int]] = [[] for _ in range(len(rig))]
    bones = np.zeros(len(rig), np.int64)
    bones[list(named)] = 1
    skin = carried.copy()
    for j in range(len(rig) - 1, -1, -1):
        above = int(rig.parent[j])
        if above >= 0:
            children[above].append(j)
            bones[above] += bones[j]
            skin[above] += skin[j]

    def next_one(joint: int) -> int | None:
        below = bones[joint] - (joint in named)
        for child in children[joint]:
            if same[child] and child not in named and bones[child] == below:
                return child if below or skin[child] > 0.5 * skin[joint] else None
        return None

    ends = {}
    for joint in named:
        ends[joint] = joint
        candidate = next_one(joint)
        while candidate is not None:
            if carried[candidate] > 0.0:
                ends[joint] = candidate
            candidate = next_one(candidate)
    return ends


def _by_size(parent: IntArray, carried: FloatArray) -> set[int]:
    """Joints that carry a fair share of the skin, with that of the small joints below them."""
    gathered = carried.copy()
    chosen = set()
    for joint in range(len(parent) - 1, -1, -1):
        if gathered[joint] >= _MIN_SHARE * carried.sum():
            chosen.add(joint)
        elif parent[joint] >= 0:
            gathered[parent[joint]] += gathered[joint]
    return chosen


def _within_ball_joints(last: Mapping[int, int], parent: IntArray) -> dict[int, int]:
    """The joints of ball joints before the last one, which they belong to."""
    within = {}
    for first, end in last.items():
        joint = end
        while joint != first:
            joint = int(parent[joint])
            within[joint] = end
    return within


def _nearest_chosen(parent: IntArray, chosen: set[int], within: Mapping[int, int]) -> IntArray:
    """For each joint, the closest chosen one above, else the first one of its tree or of all.

    Args:
        parent: Parent of each joint, -1 at the top, shape [n].
        chosen: Joints.
        within: Joints that belong to one of them below, where that is chosen.
    """
    first = min(chosen)
    n = len(parent)
    root = np.arange(n)
    for joint in range(n):
        if parent[joint] >= 0:
            root[joint] = root[parent[joint]]
    first_of_tree: dict[int, int] = {}
    for joint in sorted(chosen):
        first_of_tree.setdefault(int(root[joint]), joint)
    nearest = np.zeros(n, dtype=np.int32)
    for joint in range(n):
        if joint in chosen:
            nearest[joint] = joint
        elif within.get(joint) in chosen:
            nearest[joint] = within[joint]
        elif parent[joint] >= 0:
            nearest[joint] = nearest[parent[joint]]
        else:
            nearest[joint] = first_of_tree.get(int(root[joint]), first)
    return nearest
