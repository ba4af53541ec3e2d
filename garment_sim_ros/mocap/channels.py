"""Which channels of a rig turn one ball joint together."""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.rig import ROTATION, Rig
from garment_sim_ros.mocap.euler import quaternions_from_euler

_COINCIDENT = 1e-9


@dataclass(frozen=True)
class BallJoints:
    """Triples of successive rotation channels about axes at right angles.

    Attributes:
        channels: Channel indices, shape [b, 3].
        axes: Axes of each triple, in the frame of its first joint, shape [b, 3, 3].
        single: All other channels, shape [d - 3 b].
    """

    channels: IntArray
    axes: FloatArray
    single: IntArray


def ball_joints(rig: Rig) -> BallJoints:
    """Find the ball joints of a rig.

    In a BVH rig the three channels belong to one joint; in a rig read from a URDF they belong to
    three joints that follow each other at the same place.
    """
    dofs = rig.dofs
    children = np.bincount(rig.parent[rig.parent >= 0], minlength=len(rig))

    def continues(a: int, b: int) -> bool:
        """Whether channel b turns on where channel a left off."""
        if dofs.kind[b] != ROTATION or dofs.mimic_source[b] >= 0:
            return False
        ja, jb = int(dofs.joint[a]), int(dofs.joint[b])
        if ja == jb:
            return True
        last_of_a = a + 1 == len(dofs) or dofs.joint[a + 1] != ja
        first_of_b = dofs.joint[b - 1] != jb
        return bool(
            last_of_a
            and first_of_b
            and rig.parent[jb] == ja
            and children[ja] == 1
            and np.abs(rig.T_parent_joint[jb] - np.eye(4)).max() < _COINCIDENT
        )

    channels: list[list[int]] = []
    single: list[int] = []
    i = 0
    while i < len(dofs):
        triple = dofs.axis[i : i + 3]
        if (
            len(triple) == 3
            and dofs.kind[i] == ROTATION
            and dofs.mimic_source[i] < 0
            and continues(i, i + 1)
            and continues(i + 1, i + 2)
            and np.abs(triple @ triple.T - np.eye(3)).max() < _COINCIDENT
        ):
            channels.append([i, i + 1, i + 2])
            i += 3
        else:
            single.append(i)
            i += 1
    index = np.array(channels, np.int32).reshape(-1, 3)
    return BallJoints(index, np.ascontiguousarray(dofs.axis[index]), np.array(single, np.int32))


def local_rotations(rig: Rig, values: FloatArray) -> FloatArray:
    """Quaternions of all ball joints, shape [f, b, 4], for channel values of shape [f, d]."""
    joints = ball_joints(rig)
    rotations = np.empty((len(values), len(joints.channels), 4))
    for b, (channels, axes) in enumerate(zip(joints.channels, joints.axes)):
        rotations[:, b] = quaternions_from_euler(axes, values[:, channels])
    return rotations
