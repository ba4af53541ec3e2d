"""BVH files as clips."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.humanoid import humanoid_map
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Dofs, Rig
from garment_sim_ros.errors import GeometryError, InputFileError, ParameterError
from garment_sim_ros.mocap.bvh_text import BvhText, parse_bvh
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.file_frame import FileFrame, describe_unit, file_frame
from garment_sim_ros.mocap.inserted_pose import inserted_frames
from garment_sim_ros.mocap.sampling import closes

_FALLBACK_FRAME_TIME = 1.0 / 30.0
_SKIP = ("auto", "on", "off")


def load_bvh(
    path: str | Path,
    *,
    skip_t_pose: str = "auto",
    metres_per_unit: float | None = None,
    humanoid_overrides: Mapping[str, str | None] | None = None,
) -> Clip:
    """Read a BVH file in any unit, with any axis up.

    Args:
        path: The file.
        skip_t_pose: Whether to leave out a pose that was inserted before the motion: ``auto``
            where the motion jumps away from one, ``on`` for the first frame, ``off``.
        metres_per_unit: Length of the file's unit [m]; None guesses it from the body's height.
        humanoid_overrides: Humanoid bone to joint name, as for `humanoid_map`.

    Returns:
        The clip; its notes say which unit and axes were assumed.

    Raises:
        InputFileError: The file is missing, damaged or no BVH.
        ParameterError: An option is outside its range.
    """
    _check(skip_t_pose, metres_per_unit)
    text = parse_bvh(path)
    notes = list(text.notes)
    try:
        rig, values = _rig_in_file_units(text, notes)
    except GeometryError as error:
        raise InputFileError(path, str(error)) from error
    mapping = humanoid_map(rig.joint_names, rig.parent, humanoid_overrides)
    end_sites = tuple(
        (text.names[joint], (offset[0], offset[1], offset[2])) for joint, offset in text.end_sites
    )
    frame = file_frame(rig, mapping, values, dict(end_sites))
    notes += frame.notes
    unit = _unit(frame, metres_per_unit, notes)
    if not mapping:
        notes.append("No joint name is known: the clip can only drive a body of the same names.")
    skipped = _skipped(skip_t_pose, rig, mapping, values)
    if skipped:
        notes.append(f"Skipped {skipped} inserted first frame(s).")
    frame_time = text.frame_time
    if frame_time <= 0.0:
        frame_time = _FALLBACK_FRAME_TIME
        notes.append(f"Frame Time is 0; taken as {frame_time:.4f} s.")
    rig, values, reference = _in_metres(rig, values, frame.reference, unit)
    T_world_file = np.eye(4)
    T_world_file[:3, :3] = frame.rotation
    clip = Clip(
        name=Path(path).stem,
        rig=rig,
        times=frame_time * np.arange(len(values) - skipped, dtype=np.float64),
        values=values[skipped:],
        T_world_file=T_world_file,
        reference=reference,
        end_sites=tuple((j, (x * unit, y * unit, z * unit)) for j, (x, y, z) in end_sites),
        hinges=frame.hinges,
        soles=frame.soles,
        ankle_height=None if frame.ankle_height is None else frame.ankle_height * unit,
        notes=tuple(notes),
    )
    return replace(clip, loops=closes(clip))


def _check(skip_t_pose: str, metres_per_unit: float | None) -> None:
    """See whether options are allowed.

    Raises:
        ParameterError: One is not.
    """
    if skip_t_pose not in _SKIP:
        raise ParameterError("skip_t_pose", f"is {skip_t_pose!r}", f"allowed: {', '.join(_SKIP)}")
    if metres_per_unit is not None and not 0.0 < metres_per_unit < 1e3:
        raise ParameterError("metres_per_unit", f"is {metres_per_unit}", "allowed: 0 to 1000")


def _unit(frame: FileFrame, asked: float | None, notes: list[str]) -> float:
    """Length of the file's unit [m], with a note on where it comes from."""
    if asked is None:
        notes.append(describe_unit(frame))
        return frame.metres_per_unit
    notes.append(f"Unit taken as {asked:g} m, as asked.")
    return asked


def _skipped(asked: str, rig: Rig, mapping: Mapping[str, str], values: FloatArray) -> int:
    """How many first frames to leave out, all but one at most."""
    skipped = {"off": 0, "on": 1}.get(asked)
    if skipped is None:
        skipped = inserted_frames(rig, mapping, values)
    return min(skipped, len(values) - 1)


def _in_metres(
    rig: Rig, values: FloatArray, reference: FloatArray | None, unit: float
) -> tuple[Rig, FloatArray, FloatArray | None]:
    """A skeleton, channel values and a reference pose whose lengths are in a unit [m]."""
    is_length = rig.dofs.kind == TRANSLATION
    values = np.where(is_length, values * unit, values)
    if reference is not None:
        reference = np.where(is_length, reference * unit, reference)
    T = rig.T_parent_joint.copy()
    T[:, :3, 3] *= unit
    return replace(rig, T_parent_joint=T), values, reference


def _rig_in_file_units(text: BvhText, notes: list[str]) -> tuple[Rig, FloatArray]:
    """Skeleton and channel values, angles in radians, lengths in the file's unit.

    A joint moves by its position channels first, wherever they stand among its channels, because
    BVH adds them to the joint's offset.
    """
    names: list[str] = []
    joint: list[int] = []
    kind: list[int] = []
    axis: list[FloatArray] = []
    columns: list[int] = []
    first = 0
    for j, channels in enumerate(text.channels):
        order = sorted(range(len(channels)), key=lambda c: channels[c].endswith("rotation"))
        for c in order:
            names.append(f"{text.names[j]}_{channels[c]}")
            joint.append(j)
            kind.append(ROTATION if channels[c].endswith("rotation") else TRANSLATION)
            axis.append(np.eye(3)["XYZ".index(channels[c][0])])
            columns.append(first + c)
        first += len(channels)
    d = len(names)
    dofs = Dofs(
        names=tuple(names),
        joint=np.array(joint, np.int32),
        kind=np.array(kind, np.int8),
        axis=np.array(axis),
        lower=np.full(d, -np.inf),
        upper=np.full(d, np.inf),
        mimic_source=np.full(d, -1, np.int32),
        mimic_multiplier=np.ones(d),
        mimic_offset=np.zeros(d),
    )
    values = text.values[:, columns]
    values[:, dofs.kind == ROTATION] *= np.pi / 180.0
    T = np.tile(np.eye(4), (len(text.names), 1, 1))
    T[:, :3, 3] = text.offset
    _settle_absolute_positions(text, dofs, values, T, notes)
    parent = np.array(text.parent, np.int32)
    return (
        Rig(joint_names=tuple(text.names), parent=parent, T_parent_joint=T, dofs=dofs),
        values,
    )


def _settle_absolute_positions(
    text: BvhText, dofs: Dofs, values: FloatArray, T: FloatArray, notes: list[str]
) -> None:
    """Undo offsets that are counted twice.

    Some programs write position channels that replace the joint's offset instead of adding to it.
    They are told by their values, which then lie around the offset and not around zero.
    """
    for j, name in enumerate(text.names):
        moved = np.flatnonzero((dofs.joint == j) & (dofs.kind == TRANSLATION))
        if len(moved) == 0:
            continue
        offset = dofs.axis[moved] @ T[j, :3, 3]
        median = np.median(values[:, moved], axis=0)
        if np.linalg.norm(median - offset) >= np.linalg.norm(median):
            continue
        notes.append(f"Positions of '{name}' replace its offset.")
        if text.parent[j] < 0:
            T[j, :3, 3] -= offset @ dofs.axis[moved]
        else:  # the zero pose must keep its bones
            values[:, moved] -= offset
