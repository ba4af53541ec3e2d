"""From numbers in a file's unit and axes to a clip in metres whose up is known."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.rig import TRANSLATION, Rig
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.mocap.clip import Clip, NamedVector
from garment_sim_ros.mocap.file_frame import FileFrame, describe_unit, file_frame
from garment_sim_ros.mocap.inserted_pose import inserted_frames
from garment_sim_ros.mocap.sampling import closes

_SKIP = ("auto", "on", "off")
_STATURE_IN_METRES = (0.3, 3.0)
"""Heights of skeletons that a file in metres may have [m]."""


def check_options(skip_t_pose: str, metres_per_unit: float | None = None) -> None:
    """See whether options are allowed.

    Raises:
        ParameterError: One is not.
    """
    if skip_t_pose not in _SKIP:
        raise ParameterError("skip_t_pose", f"is {skip_t_pose!r}", f"allowed: {', '.join(_SKIP)}")
    if metres_per_unit is not None and not 0.0 < metres_per_unit < 1e3:
        raise ParameterError("metres_per_unit", f"is {metres_per_unit}", "allowed: 0 to 1000")


def skipped_frames(asked: str, rig: Rig, mapping: Mapping[str, str], values: FloatArray) -> int:
    """How many first frames to leave out, all but one at most.

    Args:
        asked: ``skip_t_pose`` of `load_bvh`.
        rig: The skeleton.
        mapping: Humanoid bone to joint name.
        values: Channel values, shape [f, d].
    """
    skipped = {"off": 0, "on": 1}.get(asked)
    if skipped is None:
        skipped = inserted_frames(rig, mapping, values)
    return min(skipped, len(values) - 1)


def clip_in_metres(
    name: str,
    rig: Rig,
    times: FloatArray,
    values: FloatArray,
    *,
    mapping: Mapping[str, str],
    notes: list[str],
    end_sites: tuple[NamedVector, ...] = (),
    metres_per_unit: float | None = None,
    known_up: FloatArray | None = None,
) -> Clip:
    """A clip of channel values whose unit and axes are told from the body that they move.

    Args:
        name: The clip's name.
        rig: The skeleton, in the file's unit and axes.
        times: Sample times from 0 [s], shape [f].
        values: Channel values [rad, file units], shape [skipped + f, d]; the first tell about the
            body, too, and are left out then.
        mapping: Humanoid bone to joint name.
        notes: What is known of the file already, one sentence each.
        end_sites: As in `Clip`, in the file's unit.
        metres_per_unit: As for `load_bvh`.
        known_up: The axis that is up in files whose format has one; it has metres, too, which are
            believed where they make a body of some size.
    """
    frame = file_frame(rig, mapping, values, dict(end_sites), known_up)
    notes = [*notes, *frame.notes]
    if known_up is not None and _STATURE_IN_METRES[0] <= frame.stature <= _STATURE_IN_METRES[1]:
        unit = 1.0
    else:
        unit = _unit(frame, metres_per_unit, notes)
    if not mapping:
        notes.append("No joint name is known: the clip can only drive a body of the same names.")
    skipped = len(values) - len(times)
    if skipped:
        notes.append(f"Skipped {skipped} inserted first frame(s).")
    rig, values, reference = _in_metres(rig, values, frame.reference, unit)
    T_world_file = np.eye(4)
    T_world_file[:3, :3] = frame.rotation
    clip = Clip(
        name=name,
        rig=rig,
        times=times,
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


def _unit(frame: FileFrame, asked: float | None, notes: list[str]) -> float:
    """Length of the file's unit [m], with a note on where it comes from."""
    if asked is None:
        notes.append(describe_unit(frame))
        return frame.metres_per_unit
    notes.append(f"Unit taken as {asked:g} m, as asked.")
    return asked


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
