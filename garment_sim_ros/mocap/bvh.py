"""BVH files as clips."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.humanoid import humanoid_map
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Dofs, Rig
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.mocap.bvh_text import BvhText, parse_bvh
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.clip_in_metres import check_options, clip_in_metres, skipped_frames

_FALLBACK_FRAME_TIME = 1.0 / 30.0


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
    check_options(skip_t_pose, metres_per_unit)
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
    frame_time = text.frame_time
    if frame_time <= 0.0:
        frame_time = _FALLBACK_FRAME_TIME
        notes.append(f"Frame Time is 0; taken as {frame_time:.4f} s.")
    count = len(values) - skipped_frames(skip_t_pose, rig, mapping, values)
    return clip_in_metres(
        Path(path).stem,
        rig,
        frame_time * np.arange(count, dtype=np.float64),
        values,
        mapping=mapping,
        notes=notes,
        end_sites=end_sites,
        metres_per_unit=metres_per_unit,
    )


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
    dofs = Dofs.free(names, joint, kind, axis)
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
