"""How far the joints of a human turn: rotations to test colliders at.

Angles are rounded normal ranges of the American Academy of Orthopaedic Surgeons (1965, "Joint
motion: method of measuring and recording"), the trunk's shared between its two joints. They count
from the anatomical position; for an A-pose's upper arm they are taken from where it is.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray

_RANGES: dict[str, tuple[float, float, float]] = {
    "spine": (40.0, 15.0, 18.0),
    "chest": (40.0, 15.0, 18.0),
    "upperChest": (16.0, 16.0, 16.0),
    "neck": (22.0, 22.0, 22.0),
    "head": (22.0, 22.0, 22.0),
    "UpperArm": (90.0, 50.0, 60.0),
    "LowerArm": (145.0, 0.0, 0.0),
    "Hand": (70.0, 70.0, 25.0),
    "UpperLeg": (120.0, 30.0, 45.0),
    "LowerLeg": (0.0, 135.0, 0.0),
    "Foot": (20.0, 50.0, 20.0),
    "Toes": (50.0, 25.0, 5.0),
}
"""Degrees forward, backward and to each side, by humanoid bone without its side."""

_UNKNOWN = (45.0, 45.0, 45.0)
_DIRECTIONS = 8
_SHARES = (0.5, 1.0)
"""Shares of the full range that are tested."""


def joint_rotations(humanoid_bone: str, along: FloatArray) -> FloatArray:
    """Rotations of a bone against the one above it, about their joint.

    Args:
        humanoid_bone: Key of `HUMANOID_BONES`, or another text for an unknown bone.
        along: Unit direction of the bone in the bind pose, x forward, z up, shape [3].

    Returns:
        Rotation matrices in the bind pose's root frame, without the identity, shape [k, 3, 3].
    """
    rotations = []
    for azimuth in 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS:
        limit = swing_limit(humanoid_bone, azimuth)
        for share in _SHARES:
            if limit * share > 3.0:
                axis = swing_axis(along, azimuth)
                rotations.append(Rotation.from_rotvec(axis * limit * share, degrees=True))
    return np.array([r.as_matrix() for r in rotations]).reshape(-1, 3, 3)


def swing_limit(humanoid_bone: str, azimuth: float) -> float:
    """How far a bone swings to a side [degrees].

    Args:
        humanoid_bone: Key of `HUMANOID_BONES`, or another text for an unknown bone.
        azimuth: From forward to the bone's side [rad].
    """
    part = humanoid_bone.removeprefix("left").removeprefix("right")
    forward, backward, aside = _RANGES.get(part, _UNKNOWN)
    to_front, to_side = np.cos(azimuth), np.sin(azimuth)
    return float(np.hypot(to_front * (forward if to_front > 0.0 else backward), to_side * aside))


def swing_axis(along: FloatArray, azimuth: float) -> FloatArray:
    """The axis about which a bone along a unit direction swings to a side, shape [3]."""
    ahead, beside = across(along)
    axis: FloatArray = np.cross(along, np.cos(azimuth) * ahead + np.sin(azimuth) * beside)
    return axis


def across(along: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit directions that a bone along a unit direction swings to: forward, and to its side.

    Both are across the bone; "forward" of a bone that points forward is up.
    """
    ahead = np.array([0.0, 0.0, 1.0]) if abs(along[0]) > 0.95 else np.array([1.0, 0.0, 0.0])
    ahead = ahead - along * (along @ ahead)
    ahead /= np.linalg.norm(ahead)
    return ahead, np.cross(along, ahead)
