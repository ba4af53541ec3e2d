"""The figure that walks the built-in walk: proportions, skeleton, channels.

Proportions: R. Drillis, R. Contini, Body Segment Parameters (1966), as fractions of the height.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Dofs, Rig

SIDES = (("left", 1.0), ("right", -1.0))

THIGH, SHANK, ANKLE = 0.245, 0.246, 0.039
HEEL, BALL, TOE = 0.035, 0.075, 0.110
"""Behind and before the ankle, on the ground."""
HIP_WIDTH, SHOULDER_WIDTH = 0.050, 0.110
UPPER_ARM, FOREARM, HAND = 0.186, 0.146, 0.108
TRUNK, NECK, HEAD = 0.288, 0.052, 0.130
"""From the hip joints to the shoulders, on to the head's joint, on to the top of the head."""


_HINGES = ("LowerArm", "LowerLeg", "Toes")
_CHANNELS = ("Xposition", "Yposition", "Zposition", "Zrotation", "Yrotation", "Xrotation")


def _skeleton(height: float) -> list[tuple[str, str, tuple[float, float, float]]]:
    """Name, parent and offset of each joint."""
    joints = [
        ("hips", "", (0.0, 0.0, 0.0)),
        ("spine", "hips", (0.0, 0.0, 0.25 * TRUNK)),
        ("chest", "spine", (0.0, 0.0, 0.25 * TRUNK)),
        ("neck", "chest", (0.0, 0.0, 0.50 * TRUNK)),
        ("head", "neck", (0.0, 0.0, NECK)),
    ]
    for side, sign in SIDES:
        joints += [
            (f"{side}UpperArm", "chest", (0.0, sign * SHOULDER_WIDTH, 0.46 * TRUNK)),
            (f"{side}LowerArm", f"{side}UpperArm", (0.0, 0.0, -UPPER_ARM)),
            (f"{side}Hand", f"{side}LowerArm", (0.0, 0.0, -FOREARM)),
        ]
    for side, sign in SIDES:
        joints += [
            (f"{side}UpperLeg", "hips", (0.0, sign * HIP_WIDTH, 0.0)),
            (f"{side}LowerLeg", f"{side}UpperLeg", (0.0, 0.0, -THIGH)),
            (f"{side}Foot", f"{side}LowerLeg", (0.0, 0.0, -SHANK)),
            (f"{side}Toes", f"{side}Foot", (BALL, 0.0, -ANKLE)),
        ]
    return [
        (name, above, (height * x, height * y, height * z)) for name, above, (x, y, z) in joints
    ]


def _channels_of(joint: str) -> tuple[str, ...]:
    if joint == "hips":
        return _CHANNELS
    return ("Yrotation",) if joint.endswith(_HINGES) else _CHANNELS[3:]


def walker_rig(height: float) -> Rig:
    """The skeleton of a walker of a height [m], z up, x forward, arms and legs hanging."""
    joints = _skeleton(height)
    names = [name for name, _, _ in joints]
    T = np.tile(np.eye(4), (len(joints), 1, 1))
    T[:, :3, 3] = [offset for _, _, offset in joints]
    channels = [(j, c) for j, name in enumerate(names) for c in _channels_of(name)]
    return Rig(
        joint_names=tuple(names),
        parent=np.array([names.index(above) if above else -1 for _, above, _ in joints], np.int32),
        T_parent_joint=T,
        dofs=Dofs.free(
            [f"{names[j]}_{c}" for j, c in channels],
            [j for j, _ in channels],
            [TRANSLATION if c.endswith("position") else ROTATION for _, c in channels],
            [np.eye(3)["XYZ".index(c[0])] for _, c in channels],
        ),
    )


def channel_values(figure: dict[str, FloatArray], root: FloatArray) -> FloatArray:
    """Channel values of a posed walker, without jumps by full turns.

    Args:
        figure: World rotations of every joint, shape [f, 3, 3].
        root: Position of the hips [m], shape [f, 3].

    Returns:
        Values [m or rad], shape [f, d].
    """
    columns = [root]
    for name, above, _ in _skeleton(1.0):
        R = figure[name]
        if above:
            R = np.swapaxes(figure[above], 1, 2) @ R
        if name.endswith(_HINGES):
            angles = np.arctan2(R[:, 0, 2], R[:, 0, 0])[:, None]
        else:
            angles = Rotation.from_matrix(R).as_euler("ZYX")
        columns.append(np.unwrap(angles, axis=0))
    return np.concatenate(columns, axis=1)
