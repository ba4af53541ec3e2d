"""What a clip's poses tell about its body: how joints bend, how feet stand, when it is calm."""

from collections.abc import Mapping

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.anatomy import SIDES, Landmarks, leg_length, unit
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.mocap.clip import NamedVector

_LIFTED = 10.0
"""Score that a reference pose loses for each leg length that a foot is off the ground."""
_BENT = np.sin(np.radians(20.0))
"""Sine of the bend from which on an elbow or knee shows its axis."""
_STANDING = 0.03
"""Share of an ankle's range of heights, at its bottom, in which its foot stands flat."""
_ON_GROUND = (-0.04, 0.2)
"""Heights of the lowest joint of a body on the ground, in leg lengths."""
_MIN_SAMPLES = 5
_AGREEMENT = np.cos(np.radians(20.0))


def upward(marks: Landmarks) -> FloatArray | None:
    """From the feet (or hips) to the shoulders (or head); None where unknown."""
    top, bottom = marks.middle("UpperArm"), marks.middle("Foot")
    if top is None:
        top = marks.joint.get("head", marks.joint.get("neck"))
    if bottom is None:
        bottom = marks.joint.get("hips")
    return None if top is None or bottom is None else unit(top - bottom)


def calmest(poses: list[Landmarks], up: FloatArray) -> int:
    """Index of the pose that shows best which way the bones are."""
    scores = np.array([_calmness(marks, up) for marks in poses])
    return int(np.argmax(scores - _LIFTED * _lifted(poses, up)))


def _calmness(marks: Landmarks, up: FloatArray) -> float:
    """How well a pose shows which way the bones are: upright, arms low, elbows slightly bent."""
    score = 0.0

    def add(weight: float, direction: FloatArray | None, wanted: FloatArray) -> None:
        nonlocal score
        if direction is not None:
            score += weight * float(direction @ wanted)

    add(2.0, upward(marks), up)
    hips, shoulders = marks.lateral("UpperLeg"), marks.lateral("UpperArm")
    if hips is not None and shoulders is not None:
        add(2.0, hips, shoulders)
        score -= 2.0 * (abs(float(hips @ up)) + abs(float(shoulders @ up)))
    if "head" in marks.tip:
        add(1.0, unit(marks.tip["head"] - marks.joint["head"]), up)
    for side in SIDES:
        add(2.0, marks.between(f"{side}UpperLeg", f"{side}LowerLeg"), -up)
        add(2.0, marks.between(f"{side}LowerLeg", f"{side}Foot"), -up)
        arm = marks.between(f"{side}UpperArm", f"{side}LowerArm")
        forearm = marks.between(f"{side}LowerArm", f"{side}Hand")
        add(1.0, arm, -up)
        if arm is not None and forearm is not None:
            bend = float(np.degrees(np.arccos(np.clip(arm @ forearm, -1.0, 1.0))))
            score -= max(0.0, 20.0 - bend, bend - 50.0) / 40.0
    return score


def _lifted(poses: list[Landmarks], up: FloatArray) -> FloatArray:
    """How far the feet are off the ground in each pose, in leg lengths; 0 where unknown."""
    height = np.zeros(len(poses))
    for side in SIDES:
        if all(f"{side}Foot" in marks.joint for marks in poses):
            ankle = np.array([marks.joint[f"{side}Foot"] @ up for marks in poses])
            length = max(leg_length(marks) or 0.0 for marks in poses) or 1.0
            height += (ankle - ankle.min()) / length
    return height


def hinge_axes(
    rig: Rig, mapping: Mapping[str, str], T: FloatArray, poses: list[Landmarks]
) -> tuple[NamedVector, ...]:
    """Mean axis of each elbow and knee in its upper bone's frame, where it is a hinge at all."""
    found: list[NamedVector] = []
    for side in SIDES:
        for upper, lower in (("UpperArm", "LowerArm"), ("UpperLeg", "LowerLeg")):
            if f"{side}{upper}" not in mapping:
                continue
            joint = rig.joint_names.index(mapping[f"{side}{upper}"])
            axes = np.zeros((len(poses), 3))
            for k, marks in enumerate(poses):
                bone, beyond = marks.between(side + upper, side + lower), marks.lower(side, lower)
                if bone is not None and beyond is not None:
                    axes[k] = T[k, joint, :3, :3].T @ np.cross(bone, beyond)
            axes = axes[np.linalg.norm(axes, axis=1) > _BENT]
            found += _agreed(mapping[f"{side}{upper}"], axes)
    return tuple(found)


def sole_directions(
    rig: Rig, mapping: Mapping[str, str], T: FloatArray, up: FloatArray
) -> tuple[NamedVector, ...]:
    """What is up in each foot's frame while its ankle is as low as ankles go in this clip."""
    feet = [mapping[foot] for foot in ("leftFoot", "rightFoot") if foot in mapping]
    joints = [rig.joint_names.index(name) for name in feet]
    if not joints:
        return ()
    heights = T[:, :, :3, 3][:, joints] @ up
    low = heights < heights.min() + _STANDING * (heights.max() - heights.min())
    found: list[NamedVector] = []
    for name, joint, standing in zip(feet, joints, low.T):
        found += _agreed(name, np.einsum("kji,j->ki", T[standing, joint, :3, :3], up))
    return tuple(found)


def _agreed(name: str, vectors: FloatArray) -> list[NamedVector]:
    """The mean direction, in a list; nothing where there are few vectors or they differ."""
    total = vectors.sum(axis=0)
    lengths = float(np.linalg.norm(vectors, axis=1).sum())
    if len(vectors) < _MIN_SAMPLES or np.linalg.norm(total) < _AGREEMENT * lengths:
        return []
    x, y, z = total / np.linalg.norm(total)
    return [(name, (float(x), float(y), float(z)))]


def on_ground(poses: list[Landmarks], up: FloatArray) -> float:
    """Share of the poses whose lowest joint is as high over 0 as one on the ground is."""
    low, high = _ON_GROUND
    count = 0
    for marks in poses:
        lowest = min(float(x @ up) for x in marks.joint.values())
        count += low <= lowest / (leg_length(marks) or 1.0) <= high
    return count / len(poses)


def standing_ankle_height(poses: list[Landmarks], up: FloatArray) -> float | None:
    """Height of the ankle of a foot on the ground [file units]; None where no foot is known."""
    feet = ("leftFoot", "rightFoot")
    lowest = [
        min(float(marks.joint[foot] @ up) for foot in feet if foot in marks.joint)
        for marks in poses
        if any(foot in marks.joint for foot in feet)
    ]
    return float(np.percentile(lowest, 2.0)) if lowest else None
