"""A rig that turns and moves as joints do whose rotations and places are known."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Dofs, Rig
from garment_sim_ros.errors import GeometryError

_STILL = 1e-6
"""Turns of a joint [rad] that are none."""
_SLIDES = 2e-3
"""From which share of the skeleton's size on a joint moves against the one above it."""
_ORDER = "ZXY"


@dataclass(frozen=True, kw_only=True)
class Turned:
    """The joints of a skeleton over time.

    Attributes:
        rest: Positions in the rest pose, shape [n, 3].
        rotation: Rotations since the rest pose, in the axes of the world, shape [n, f, 3, 3].
        position: Positions, shape [n, f, 3].
    """

    rest: FloatArray
    rotation: FloatArray
    position: FloatArray


def rig_of(names: Sequence[str], parent: IntArray, turned: Turned) -> tuple[Rig, FloatArray]:
    """A rig and its channel values [f, d], which put joints where they are.

    Bones are as long as they are in the motion, where they keep their length. Joints that slide
    have three positions, joints that turn three angles after them, others none; the first of
    those that do either has both.

    Args:
        names: Of the joints, parents first.
        parent: Of the joints, -1 for roots.
        turned: What they do.

    Raises:
        GeometryError: No joint moves.
    """
    rest, rotation, position = turned.rest, turned.rotation, turned.position
    size = float(np.linalg.norm(np.ptp(rest, axis=0))) or 1.0
    T = np.tile(np.eye(4), (len(names), 1, 1))
    dof_names: list[str] = []
    joint: list[int] = []
    kind: list[int] = []
    axis: list[FloatArray] = []
    columns: list[FloatArray] = []

    def add(j: int, what: int, along: int, values: FloatArray) -> None:
        word = "rotation" if what == ROTATION else "position"
        dof_names.append(f"{names[j]}_{'XYZ'[along]}{word}")
        joint.append(j)
        kind.append(what)
        axis.append(np.eye(3)[along])
        columns.append(values)

    for j, above in enumerate(parent):
        if above < 0:
            offset, own, T[j, :3, 3] = position[j], rotation[j], rest[j]
        else:
            back = rotation[above].transpose(0, 2, 1)
            offset = np.einsum("fij,fj->fi", back, position[j] - position[above])
            own = back @ rotation[j]
            T[j, :3, 3] = np.median(offset, axis=0)
        turns = _angle(own) > _STILL
        slid = offset - T[j, :3, 3]
        slides = np.abs(slid).max() > _SLIDES * size
        if not columns and (turns or slides):
            turns = slides = True  # what carries the body along
        if slides:
            if above >= 0:
                T[j, :3, 3] = rest[j] - rest[above]
            slid = offset - T[j, :3, 3]
            for k in range(3):
                add(j, TRANSLATION, k, slid[:, k])
        if turns:
            angles = np.unwrap(_euler(own), axis=0)
            for k, letter in enumerate(_ORDER):
                add(j, ROTATION, "XYZ".index(letter), angles[:, k])
    if not columns:
        raise GeometryError("has an animation in which no joint moves")
    dofs = Dofs.free(dof_names, joint, kind, axis)
    rig = Rig(
        joint_names=tuple(names), parent=np.array(parent, np.int32), T_parent_joint=T, dofs=dofs
    )
    return rig, np.stack(columns, axis=1)


def _angle(R: FloatArray) -> float:
    """The largest of some rotations [rad]."""
    sine = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]])
    cosine = np.trace(R, axis1=1, axis2=2) - 1.0
    return float(np.arctan2(np.linalg.norm(sine, axis=0), cosine).max())


def _euler(R: FloatArray) -> FloatArray:
    """Angles [rad] about z, x, y, in this order, each about the axis as it is then, [f, 3]."""
    middle = np.arcsin(np.clip(R[:, 2, 1], -1.0, 1.0))
    locked = np.abs(R[:, 2, 1]) > 1.0 - 1e-12
    first = np.where(
        locked, np.arctan2(R[:, 1, 0], R[:, 0, 0]), np.arctan2(-R[:, 0, 1], R[:, 1, 1])
    )
    last = np.where(locked, 0.0, np.arctan2(-R[:, 2, 0], R[:, 2, 2]))
    return np.stack([first, middle, last], axis=1)
