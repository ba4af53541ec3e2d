"""A recorded avatar: what its topics said, read back from the bag."""

from collections import defaultdict
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.colliders.description import from_json
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import InputFileError, MessageError
from garment_sim_ros.geometry.transforms import interpolate_poses
from garment_sim_ros.mocap.bag_file import Bag, opened_bag
from garment_sim_ros.recording.bag_messages import Messages, messages_of, read_at_once
from garment_sim_ros.stamps import nanoseconds

_UNIT = 1e-2
"""How far the length of a quaternion may be from 1."""
_MOST_HELD = 2**28
"""Positions of a recording up to so large are held as they are read, not read twice."""


@dataclass(frozen=True, kw_only=True)
class GarmentTrack:
    """One garment over time.

    Attributes:
        vertices: Rest shape from `topology` [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        arrival: When each frame arrived [ns], shape [n].
        finite: Whether every number of every frame is.
        positions: Vertices in the world at the recording's `stamp` [m], shape [m, v, 3].
    """

    vertices: FloatArray
    triangles: IntArray
    arrival: NDArray[np.int64]
    finite: bool
    positions: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class ColliderTrack:
    """Colliders over time.

    Attributes:
        colliders: The last set that was described.
        stamp: Of each message with as many poses as it has [ns], increasing, shape [k].
        position: Origins of the colliders' frames [m], shape [k, n, 3].
        orientation: Unit quaternions (x, y, z, w), shape [k, n, 4].
    """

    colliders: ColliderSet
    stamp: NDArray[np.int64]
    position: FloatArray
    orientation: FloatArray

    def at(self, stamp: int) -> ColliderPoses | None:
        """Poses at a time [ns], between two messages interpolated; None before and after all."""
        if not len(self.stamp) or not self.stamp[0] <= stamp <= self.stamp[-1]:
            return None
        after = min(max(int(np.searchsorted(self.stamp, stamp)), 1), len(self.stamp) - 1)
        before = max(after - 1, 0)
        span = int(self.stamp[after] - self.stamp[before])
        poses = ColliderPoses.identity(len(self.colliders))
        for k in (before, after):
            if self.stamp[k] == stamp:
                poses.position[:], poses.orientation[:] = self.position[k], self.orientation[k]
                return poses
        interpolate_poses(
            self.position[before],
            self.orientation[before],
            self.position[after],
            self.orientation[after],
            (stamp - int(self.stamp[before])) / max(span, 1),
            poses.position,
            poses.orientation,
        )
        return poses


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
        stamp, garments = _garments(messages, path, (0, 2**63 - 1), most_frames, most_bytes)
        try:
            times, quality = _quality_over_time(messages)
        except InputFileError:  # none was recorded
            times, quality = np.zeros(0, np.int64), {}
        return Shown(
            stamp=stamp,
            garments=garments,
            colliders=_colliders(messages),
            quality_stamp=times,
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
        stamp, garments = _garments(messages, path, joints_known, most_frames)
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
        colliders=_colliders(messages),
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


def _garments(
    messages: Messages,
    path: str | Path,
    joints_known: tuple[int, int],
    most_frames: int,
    most_bytes: int = 2**63,
) -> tuple[NDArray[np.int64], dict[str, GarmentTrack]]:
    """Times of the frames that are kept [ns], and the garments."""
    shapes = {
        _garment_of(topic): _mesh(path, topic, message)
        for topic, _, message in messages("topology")
    }
    arrivals: dict[str, list[int]] = {name: [] for name in shapes}
    stamps: dict[str, set[int]] = {name: set() for name in shapes}
    finite = dict.fromkeys(shapes, True)
    held: dict[tuple[str, int], NDArray[np.float32]] = {}
    left = _MOST_HELD
    for topic, arrival, message in messages("points"):
        name = _garment_of(topic)
        if name not in shapes:
            raise InputFileError(path, f"{topic} has no topology", "needed: an avatar's topics")
        x = _points(path, topic, message, len(shapes[name][0]))
        arrivals[name].append(arrival)
        stamps[name].add(time := _nanoseconds(message))
        if (left := left - x.nbytes) >= 0:
            held[name, time] = x
        finite[name] = finite[name] and bool(np.isfinite(x).all())

    # Before the first pose and after the last one it is not known where the body was.
    first, last = joints_known
    common = sorted(t for t in set.intersection(*stamps.values()) if first <= t <= last)
    # A second pass rather than holding all positions of a long recording.
    size = sum(vertices.size for vertices, _ in shapes.values()) * np.float32().itemsize
    most = min(most_frames, max(2, most_bytes // size))
    kept = common[:: max(1, -(-len(common) // most))]
    place = {stamp: k for k, stamp in enumerate(kept)}
    positions = {
        name: np.zeros((len(kept), len(vertices), 3), np.float32)
        for name, (vertices, _) in shapes.items()
    }
    if left >= 0:
        for name, rows in positions.items():
            for row, stamp in zip(rows, kept, strict=True):
                row[:] = held[name, stamp]
    else:
        held.clear()
        for topic, _, message in messages("points"):
            if (k := place.get(_nanoseconds(message))) is not None:
                name = _garment_of(topic)
                positions[name][k] = _points(path, topic, message, len(shapes[name][0]))
    return np.array(kept, np.int64), {
        name: GarmentTrack(
            vertices=vertices,
            triangles=triangles,
            arrival=np.array(arrivals[name], np.int64),
            finite=finite[name],
            positions=positions[name],
        )
        for name, (vertices, triangles) in shapes.items()
    }


def _colliders(messages: Messages) -> ColliderTrack | None:
    try:
        text = [message.data for _, _, message in messages("collider_description")][-1]
        colliders = from_json(text)
        found = {
            message.stamp: message.poses
            for _, _, message in messages("collider_poses")
            if len(message.poses) == len(colliders)
        }
    except (InputFileError, MessageError):
        return None
    stamps = sorted(stamp for stamp, poses in found.items() if _are_poses(poses))
    poses = np.array([found[stamp] for stamp in stamps]).reshape(-1, len(colliders), 7)
    return ColliderTrack(
        colliders=colliders,
        stamp=np.array(stamps, np.int64),
        position=np.ascontiguousarray(poses[..., :3]),
        orientation=np.ascontiguousarray(poses[..., 3:]),
    )


def _are_poses(poses: FloatArray) -> bool:
    norm = np.linalg.norm(poses[:, 3:], axis=1)
    return bool(np.isfinite(poses).all() and (np.abs(norm - 1.0) < _UNIT).all())


def _joints(messages: Iterable[Any]) -> tuple[tuple[str, ...], NDArray[np.int64], FloatArray]:
    """Names, stamps and values of all messages with the first one's joints, as time goes on."""
    names: tuple[str, ...] = ()
    stamps: list[int] = []
    values: list[FloatArray] = []
    for message in messages:
        if not stamps and len(set(message.name)) == len(message.name):
            names = tuple(message.name)
        stamp = _nanoseconds(message)
        if (
            tuple(message.name) == names
            and len(message.position) == len(names)
            and np.isfinite(message.position).all()
            and (not stamps or stamp > stamps[-1])
        ):
            stamps.append(stamp)
            values.append(np.array(message.position))
    return names, np.array(stamps, np.int64), np.array(values)


def _mesh(path: str | Path, topic: str, message: Any) -> tuple[FloatArray, IntArray]:
    vertices = np.array([[p.x, p.y, p.z] for p in message.vertices]).reshape(-1, 3)
    triangles = np.array([t.vertex_indices for t in message.triangles], np.int64).reshape(-1, 3)
    if not len(triangles) or triangles.max() >= len(vertices) or not np.isfinite(vertices).all():
        raise InputFileError(
            path,
            f"{topic} has {len(triangles)} triangles on {len(vertices)} vertices",
            "needed: a surface of finite vertices",
        )
    return vertices, triangles.astype(np.int32)


def _points(path: str | Path, topic: str, message: Any, count: int) -> NDArray[np.float32]:
    """The x y z of a PointCloud2 that starts with them, shape [count, 3]."""
    step = message.point_step
    if message.width * message.height != count or step < 12 or len(message.data) != count * step:
        raise InputFileError(path, f"{topic} does not fit its topology", "needed: as many points")
    rows = message.data.reshape(count, step)
    return np.ascontiguousarray(rows[:, :12]).view(np.float32).reshape(-1, 3)


def _nanoseconds(message: Any) -> int:
    return nanoseconds(message.header.stamp)


def _garment_of(topic: str) -> str:
    return topic.split("/")[-2]
