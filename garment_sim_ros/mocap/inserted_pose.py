"""Poses that a program inserted before the motion, for calibration."""

from collections.abc import Mapping

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.anatomy import SIDES, Landmarks, SourceReference, find_landmarks
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.rig import ROTATION, Rig
from garment_sim_ros.mocap.channels import local_rotations

_MAX_INSERTED = 5
_JUMP = np.radians(20.0)
_CALM = np.radians(1.0)
_STRAIGHT = np.cos(np.radians(15.0))


def inserted_frames(rig: Rig, mapping: Mapping[str, str], values: FloatArray) -> int:
    """Number of leading frames that hold a pose from which the motion then jumps away.

    The pose must be the zero pose or have straight, symmetric arms; the jump must be far larger
    than the motion's own steps.

    Args:
        rig: The skeleton.
        mapping: Humanoid bone to joint name.
        values: Channel values, shape [f, d].
    """
    window = values[: _MAX_INSERTED + 61]
    if len(window) < 3:
        return 0
    rotations = local_rotations(rig, window)
    cosine = np.abs((rotations[1:] * rotations[:-1]).sum(axis=-1)).clip(0.0, 1.0)
    turn = 2.0 * np.arccos(cosine)  # of each joint, between successive frames
    step = turn.max(axis=1, initial=0.0)
    # One noisy joint must not hide the jump: the motion's own steps are those of most joints.
    typical = np.percentile(turn, 90.0, axis=1)
    for k in range(1, min(_MAX_INSERTED, len(step) - 1) + 1):
        calm_before = bool((step[: k - 1] < _CALM).all())
        own_steps = float(np.median(typical[k:]))
        if calm_before and step[k - 1] > _JUMP and typical[k - 1] > max(10.0 * own_steps, 0.05):
            return k if _is_drawn(rig, mapping, values[0]) else 0
    return 0


def _is_drawn(rig: Rig, mapping: Mapping[str, str], q: FloatArray) -> bool:
    """Whether a pose looks drawn, not acted: no angles at all, or straight symmetric arms."""
    root = rig.parent[rig.dofs.joint] < 0
    if (np.abs(q[(rig.dofs.kind == ROTATION) & ~root]) < 1e-3).all():
        return True
    marks = find_landmarks(rig, mapping, ForwardKinematics(rig).from_dofs(q), SourceReference())
    return all(_straight_arm(marks, side) for side in SIDES)


def _straight_arm(marks: Landmarks, side: str) -> bool:
    upper = marks.between(f"{side}UpperArm", f"{side}LowerArm")
    lower = marks.between(f"{side}LowerArm", f"{side}Hand")
    return upper is not None and lower is not None and float(upper @ lower) > _STRAIGHT
