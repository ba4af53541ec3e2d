"""A recorded avatar: what its topics said, read back from the bag."""

from collections import defaultdict
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.mocap.bag_file import Bag, opened_bag
from garment_sim_ros.recording.bag_messages import Messages, messages_of
from garment_sim_ros.recording.tracks import (
    ColliderTrack,
    GarmentTrack,
    colliders_of,
    garments_of,
    stamp_of,
)


@dataclass(frozen=True, kw_only=True)
class Recording:
    """An avatar's topics.

    Attributes:
        robot_description: The source skeleton, URDF text.
        joint_names: Channels, in the order of `joint_values`.
        joint_stamp: Of each `joint_states` message [ns], shape [k].
        joint_values: Channel values [rad or m], shape [k, d].
        stamp: Times of frames of which all garments are kept [ns], increasing, shape [m]; only
            those at which the joints are known.
        garments: By name.
        quality: Values over time of each key that each status of `quality` has.
        colliders: Colliders and their poses; None where the bag has none that can be used.
    """

    robot_description: str
    joint_names: tuple[str, ...]
    joint_stamp: NDArray[np.int64]
    joint_values: FloatArray
    stamp: NDArray[np.int64]
    garments: dict[str, GarmentTrack]
    quality: dict[str, dict[str, FloatArray]]
    colliders: ColliderTrack | None = None


def read_recording(path: str | Path, *, most_frames: int = 300, dressed: bool = True) -> Recording:
    """Read a bag of one avatar.

    Args:
        path: A rosbag2 folder.
        most_frames: Positions are kept of at most so many frames, evenly spread.
        dressed: Refuse a bag without garments or `quality`; else both may be missing. Without
            garments the frames are those of the joints.

    Raises:
        InputFileError: Not a bag, or topics that are needed are missing or have no message.
    """
    with opened_bag(path) as reader:
        return _read(reader, path, most_frames, dressed)


def _read(reader: Bag, path: str | Path, most_frames: int, dressed: bool) -> Recording:
    messages = messages_of(reader, path)
    description = next(messages("robot_description"))[2].data
    names, joint_stamp, joint_values = _joints(
        message for _, _, message in messages("joint_states")
    )
    if len(joint_stamp) == 0:
        raise InputFileError(path, "holds no usable joint_states", "needed: finite positions")
    joints_known = int(joint_stamp.min()), int(joint_stamp.max())
    said = {c.topic.rsplit("/", 1)[-1] for c in reader.connections if c.msgcount}
    quality = _quality(messages) if dressed or "quality" in said else {}
    if dressed or said & {"topology", "points"}:
        stamp, garments = garments_of(messages, path, joints_known, most_frames)
    else:
        stamp, garments = joint_stamp[:: max(1, -(-len(joint_stamp) // most_frames))], {}
    return Recording(
        robot_description=description,
        joint_names=names,
        joint_stamp=joint_stamp,
        joint_values=joint_values,
        stamp=stamp,
        garments=garments,
        quality=quality,
        colliders=colliders_of(messages),
    )


def _quality(messages: Messages) -> dict[str, dict[str, FloatArray]]:
    """Values over time of each key of each status."""
    quality: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for _, _, message in messages("quality"):
        for name, items in message.status:
            for key, value in items:
                with suppress(ValueError):  # a word, such as the name of a solver
                    number = float(value)
                    quality[name][key].append(number)
    return {
        name: {key: np.array(values) for key, values in keys.items()}
        for name, keys in quality.items()
    }


def _joints(messages: Iterable[Any]) -> tuple[tuple[str, ...], NDArray[np.int64], FloatArray]:
    """Names, stamps and values of all messages with the first one's joints, as time goes on."""
    names: tuple[str, ...] = ()
    stamps: list[int] = []
    values: list[FloatArray] = []
    for message in messages:
        if not stamps and len(set(message.name)) == len(message.name):
            names = tuple(message.name)
        stamp = stamp_of(message)
        if (
            tuple(message.name) == names
            and len(message.position) == len(names)
            and np.isfinite(message.position).all()
            and (not stamps or stamp > stamps[-1])
        ):
            stamps.append(stamp)
            values.append(np.array(message.position))
    return names, np.array(stamps, np.int64), np.array(values)
