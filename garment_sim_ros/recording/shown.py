"""What there is to see in a bag of an avatar: all of it over time, or its first frame alone."""

from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.mocap.bag_file import opened_bag
from garment_sim_ros.recording.bag_messages import Messages, messages_of, read_at_once
from garment_sim_ros.recording.tracks import (
    ColliderTrack,
    GarmentTrack,
    colliders_of,
    garment_of,
    garments_of,
    mesh_of,
    points_of,
    stamp_of,
)

_OPENING = 200
"""Messages at the start of a bag among which its first frame is looked for."""


@dataclass(frozen=True, kw_only=True)
class Shown:
    """What there is to see of an avatar over time.

    Attributes:
        stamp: Times of the frames that are kept [ns], increasing, shape [m].
        garments: By name.
        colliders: Colliders and their poses; None where the bag has none that can be used.
        quality_stamp: Time of each message on `quality` [ns], shape [k].
        quality: By garment and key, values at these times, NaN where one is missing, shape [k].
    """

    stamp: NDArray[np.int64]
    garments: dict[str, GarmentTrack]
    colliders: ColliderTrack | None
    quality_stamp: NDArray[np.int64]
    quality: dict[str, dict[str, FloatArray]]


def read_shown(path: str | Path, *, most_frames: int, most_bytes: int) -> Shown:
    """Read what there is to see in a bag of one avatar; joints need not be in it.

    Args:
        path: A rosbag2 folder.
        most_frames: Positions are kept of at most so many frames, evenly spread.
        most_bytes: Positions take no more memory than this, unless two frames do.

    Raises:
        InputFileError: Not a bag, or one without garments.
    """
    with opened_bag(path) as reader:
        messages = read_at_once(
            messages_of(reader, path),
            *("topology", "quality", "collider_description", "collider_poses"),
        )
        stamp, garments = garments_of(messages, path, (0, 2**63 - 1), most_frames, most_bytes)
        try:
            times, quality = _quality_over_time(messages)
        except InputFileError:  # none was recorded
            times, quality = np.zeros(0, np.int64), {}
        return Shown(
            stamp=stamp,
            garments=garments,
            colliders=colliders_of(messages),
            quality_stamp=times,
            quality=quality,
        )


def read_opening(path: str | Path) -> Shown | None:
    """Read no more than the first frame, without colliders, in a fraction of the time.

    Args:
        path: A rosbag2 folder.

    Returns:
        That frame; None where the first messages do not have all of it.

    Raises:
        InputFileError: Not a bag, or one without garments.
    """
    with opened_bag(path) as reader:
        with_messages = [c.topic for c in reader.connections if c.msgcount]
        dressed = {garment_of(t) for t in with_messages if t.endswith("/topology")}
        told = not any(t.endswith("/quality") for t in with_messages)
        quality: dict[str, dict[str, FloatArray]] = {}
        shapes: dict[str, tuple[FloatArray, IntArray]] = {}
        clouds: dict[str, dict[int, tuple[int, NDArray[np.float32]]]] = {n: {} for n in dressed}
        messages = messages_of(reader, path)("topology", "points", "quality")
        for topic, arrival, message in islice(messages, _OPENING):
            if topic.endswith("/quality"):
                quality, told = {name: {} for name, _ in message.status}, True
            elif topic.endswith("/topology"):
                shapes[garment_of(topic)] = mesh_of(path, topic, message)
            elif (name := garment_of(topic)) in shapes:
                x = points_of(path, topic, message, len(shapes[name][0]))
                clouds[name][stamp_of(message)] = arrival, x
            common = set.intersection(*map(set, clouds.values())) if clouds else set()
            if told and common:
                return _frame(min(common), shapes, clouds, quality)
    return None


def _frame(
    stamp: int,
    shapes: dict[str, tuple[FloatArray, IntArray]],
    clouds: dict[str, dict[int, tuple[int, NDArray[np.float32]]]],
    quality: dict[str, dict[str, FloatArray]],
) -> Shown:
    """One frame alone, see `read_opening`."""
    garments = {}
    for name, (vertices, triangles) in shapes.items():
        arrival, x = clouds[name][stamp]
        garments[name] = GarmentTrack(
            vertices=vertices,
            triangles=triangles,
            arrival=np.array([arrival], np.int64),
            finite=bool(np.isfinite(x).all()),
            positions=x[None],
        )
    return Shown(
        stamp=np.array([stamp], np.int64),
        garments=garments,
        colliders=None,
        quality_stamp=np.zeros(0, np.int64),
        quality=quality,
    )


def _quality_over_time(
    messages: Messages,
) -> tuple[NDArray[np.int64], dict[str, dict[str, FloatArray]]]:
    stamps: list[int] = []
    found: dict[tuple[str, str], dict[int, float]] = defaultdict(dict)
    for _, _, message in messages("quality"):
        for name, items in message.status:
            for key, value in items:
                with suppress(ValueError):
                    found[name, key][len(stamps)] = float(value)
        stamps.append(message.stamp)
    quality: dict[str, dict[str, FloatArray]] = defaultdict(dict)
    for (name, key), values in found.items():
        column = quality[name][key] = np.full(len(stamps), np.nan)
        column[list(values)] = list(values.values())
    return np.array(stamps, np.int64), dict(quality)
