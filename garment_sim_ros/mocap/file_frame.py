"""What a motion capture file does not say: its unit, its axes, and a pose to compare with.

All of it is read off the body: how tall it is, where its head is, and where its legs are.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.anatomy import (
    Landmarks,
    SourceReference,
    find_landmarks,
    stands,
    unit,
)
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.mocap.body_evidence import (
    calmest,
    hinge_axes,
    on_ground,
    sole_directions,
    standing_ankle_height,
    upward,
)
from garment_sim_ros.mocap.clip import NamedVector

_UNITS = {
    "metre": 1.0,
    "foot": 0.3048,
    "decimetre": 0.1,
    "CMU unit": 0.0254 / 0.45,
    "inch": 0.0254,
    "centimetre": 0.01,
    "millimetre": 0.001,
}
_STATURE = (0.9, 2.1)
"""Heights that a unit may make of the skeleton [m]; it ends below the top of the head."""
_TYPICAL_STATURE = 1.6
_MAX_POSES = 400
"""Frames that are looked at, spread over the clip."""


@dataclass(frozen=True, kw_only=True)
class FileFrame:
    """How to read a file's numbers.

    Attributes:
        unit: Name of the unit.
        metres_per_unit: Its length [m].
        stature: Height of the skeleton [file units].
        rotation: Rotation from the file's axes to z up, x forward, shape [3, 3].
        reference: Channel values of a recognisable pose [rad, file units], shape [d]; None if the
            zero pose is one.
        hinges: Joint name and axis of each elbow and knee that bends, as in `Clip`.
        soles: Joint name and upward direction of each foot that stands, as in `Clip`; empty where
            the zero pose shows it.
        ankle_height: Height of the lower ankle when it is lowest [file units]; None without feet.
        notes: What was assumed, one sentence each.
    """

    unit: str
    metres_per_unit: float
    stature: float
    rotation: FloatArray
    reference: FloatArray | None
    hinges: tuple[NamedVector, ...]
    soles: tuple[NamedVector, ...]
    ankle_height: float | None
    notes: tuple[str, ...]


def describe_unit(frame: FileFrame) -> str:
    """The sentence for the log."""
    height = frame.stature * frame.metres_per_unit
    return (
        f"Unit taken as {frame.unit} ({frame.metres_per_unit:g} m): "
        f"the skeleton is {frame.stature:.4g} high, so {height:.2f} m."
    )


def file_frame(
    rig: Rig,
    mapping: Mapping[str, str],
    values: FloatArray,
    end_sites: Mapping[str, tuple[float, float, float]],
    known_up: FloatArray | None = None,
) -> FileFrame:
    """Work out unit, axes and reference pose.

    Args:
        rig: Skeleton in file units and axes.
        mapping: Humanoid bone to joint name.
        values: Channel values [rad, file units], shape [f, d].
        end_sites: Joint name to where its bone ends [file units].
        known_up: The axis that is up, where the file's format says so; then the zero pose is
            believed to face as the body does.
    """
    kinematics = ForwardKinematics(rig)
    ends = {joint: np.array(offset) for joint, offset in end_sites.items()}
    known = SourceReference(end_sites=ends)
    zero = find_landmarks(rig, mapping, kinematics.from_dofs(np.zeros(values.shape[1])), known)
    chosen = np.unique(np.linspace(0, len(values) - 1, _MAX_POSES).astype(int))
    T = np.array([kinematics.from_dofs(values[i]).copy() for i in chosen])
    poses = [find_landmarks(rig, mapping, T_pose, known) for T_pose in T]
    notes: list[str] = []
    up = _up_axis(zero, poses) if known_up is None else known_up
    if up is None:
        up = np.array([0.0, 1.0, 0.0])
        notes.append("Legs and trunk are not known: +Y is taken to be up.")
    zero_stands = stands(zero, up)
    reference = None
    if not zero_stands and mapping:
        best = calmest(poses, up)
        reference = values[chosen[best]].copy()
        notes.append(f"The zero pose is no body pose: frame {chosen[best] + 1} is the reference.")
    faces = zero if known_up is not None and zero_stands else poses[0]
    forward = _forward_axis(faces, up)
    if forward is None:
        rotation = AXES_FROM_Y_UP if up[1] > 0.5 else _rotation_to_up(up)
        notes.append(f"Up is {_axis_name(up)}; where the body faces is not known.")
    else:
        rotation = np.stack([forward, np.cross(up, forward), up])
        how = " at first" if faces is poses[0] else ""
        notes.append(f"Up is {_axis_name(up)}, the body faces {_axis_name(forward)}{how}.")
    stature = _stature(rig, zero if zero_stands else None, mapping, ends, up)
    name = _unit_of(stature)
    return FileFrame(
        unit=name,
        metres_per_unit=_UNITS[name],
        stature=stature,
        rotation=rotation,
        reference=reference,
        hinges=hinge_axes(rig, mapping, T, poses),
        soles=() if zero_stands else sole_directions(rig, mapping, T, up),
        ankle_height=standing_ankle_height(poses, up),
        notes=tuple(notes),
    )


def _axis_name(axis: FloatArray) -> str:
    k = int(np.argmax(np.abs(axis)))
    return f"{'+' if axis[k] > 0 else '-'}{'XYZ'[k]}"


def _nearest_axis(direction: FloatArray) -> FloatArray:
    """The signed coordinate axis nearest to a direction."""
    axis = np.zeros(3)
    k = int(np.argmax(np.abs(direction)))
    axis[k] = np.copysign(1.0, direction[k])
    return axis


def _rotation_to_up(up: FloatArray) -> FloatArray:
    forward = np.roll(np.abs(up), 1)
    return np.stack([forward, np.cross(up, forward), up])


def _up_axis(zero: Landmarks, poses: list[Landmarks]) -> FloatArray | None:
    """The axis along which people are upright most of the time.

    Somebody who lies or tumbles is not. The zero pose, if it is one, then knows better, and where
    the two differ the ground tells: what is lowest is at height 0 most of the time.
    """
    directions = [d for d in map(upward, poses) if d is not None]
    mean = np.mean(directions, axis=0) if directions else np.zeros(3)
    most = _nearest_axis(mean) if directions else None
    rest = upward(zero)
    if rest is None or not stands(zero, _nearest_axis(rest)):
        return most
    rest = _nearest_axis(rest)
    if most is None:
        return rest
    lies = on_ground(poses, rest) > 0.5 > on_ground(poses, most)
    return rest if lies or np.abs(mean).max() < 0.7 else most


def _forward_axis(marks: Landmarks, up: FloatArray) -> FloatArray | None:
    """The horizontal axis nearest to where hips and shoulders face."""
    left = np.zeros(3)
    for part in ("UpperLeg", "UpperArm"):
        line = marks.lateral(part)
        if line is not None:
            left += line
    forward = np.cross(left, up)
    return _nearest_axis(forward) if unit(forward) is not None else None


def _stature(
    rig: Rig,
    zero: Landmarks | None,
    mapping: Mapping[str, str],
    ends: Mapping[str, FloatArray],
    up: FloatArray,
) -> float:
    """Height of the skeleton, whatever its pose [file units].

    In a standing zero pose it is measured; otherwise the bones from foot to head are added up.
    """
    T = ForwardKinematics(rig).from_dofs(np.zeros(len(rig.dofs)))
    index = {name: i for i, name in enumerate(rig.joint_names)}
    points = [T[:, :3, 3]]
    points += [(T[index[j], :3, :3] @ end + T[index[j], :3, 3])[None] for j, end in ends.items()]
    if zero is not None:
        heights = np.concatenate(points) @ up
        return float(heights.max() - heights.min())
    length = np.linalg.norm(rig.T_parent_joint[:, :3, 3], axis=1)
    top = next((mapping[b] for b in ("head", "neck", "chest") if b in mapping), None)
    foot = next((mapping[b] for b in ("leftFoot", "rightFoot") if b in mapping), None)
    if top is None or foot is None or "hips" not in mapping:
        spread = np.concatenate(points)
        return float((spread.max(axis=0) - spread.min(axis=0)).max())
    total = float(np.linalg.norm(ends[top])) if top in ends else 0.0
    above_hips = {
        index[mapping[b]] for b in ("hips", "leftUpperLeg", "rightUpperLeg") if b in mapping
    }
    for name in (top, foot):
        j = index[name]
        while j >= 0 and j not in above_hips:
            total += float(length[j])
            j = int(rig.parent[j])
    return total


def _unit_of(stature: float) -> str:
    """The unit that makes the skeleton a person, the most ordinary one where several do."""
    if stature <= 0.0:
        return "metre"

    def oddness(name: str) -> tuple[bool, float]:
        height = stature * _UNITS[name]
        return (
            not _STATURE[0] <= height <= _STATURE[1],
            abs(float(np.log(height / _TYPICAL_STATURE))),
        )

    return min(_UNITS, key=oddness)
