"""Garments and colliders of a recorded avatar over time, read back from its messages."""

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
from garment_sim_ros.recording.bag_messages import Messages
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


def garments_of(
    messages: Messages,
    path: str | Path,
    joints_known: tuple[int, int],
    most_frames: int,
    most_bytes: int = 2**63,
) -> tuple[NDArray[np.int64], dict[str, GarmentTrack]]:
    """Times of the frames that are kept [ns], and the garments.

    Args:
        messages: Of the bag.
        path: Of the bag, for what is wrong with it.
        joints_known: Frames before and after these times are not kept [ns].
        most_frames: See `bags.read_recording`.
        most_bytes: See `shown.read_shown`.
    """
    shapes = {
        garment_of(topic): mesh_of(path, topic, message)
        for topic, _, message in messages("topology")
    }
    arrivals: dict[str, list[int]] = {name: [] for name in shapes}
    stamps: dict[str, set[int]] = {name: set() for name in shapes}
    finite = dict.fromkeys(shapes, True)
    held: dict[tuple[str, int], NDArray[np.float32]] = {}
    left = _MOST_HELD
    for topic, arrival, message in messages("points"):
        name = garment_of(topic)
        if name not in shapes:
            raise InputFileError(path, f"{topic} has no topology", "needed: an avatar's topics")
        x = points_of(path, topic, message, len(shapes[name][0]))
        arrivals[name].append(arrival)
        stamps[name].add(time := stamp_of(message))
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
            if (k := place.get(stamp_of(message))) is not None:
                name = garment_of(topic)
                positions[name][k] = points_of(path, topic, message, len(shapes[name][0]))
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


def colliders_of(messages: Messages) -> ColliderTrack | None:
    """Colliders as last described, and their poses; None where there are none that can be used."""
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


def mesh_of(path: str | Path, topic: str, message: Any) -> tuple[FloatArray, IntArray]:
    """Rest shape [m], shape [v, 3], and triangles, shape [t, 3], that a `topology` tells."""
    vertices = np.array([[p.x, p.y, p.z] for p in message.vertices]).reshape(-1, 3)
    triangles = np.array([t.vertex_indices for t in message.triangles], np.int64).reshape(-1, 3)
    if not len(triangles) or triangles.max() >= len(vertices) or not np.isfinite(vertices).all():
        raise InputFileError(
            path,
            f"{topic} has {len(triangles)} triangles on {len(vertices)} vertices",
            "needed: a surface of finite vertices",
        )
    return vertices, triangles.astype(np.int32)


def points_of(path: str | Path, topic: str, message: Any, count: int) -> NDArray[np.float32]:
    """The x y z of a PointCloud2 that starts with them, shape [count, 3]."""
    step = message.point_step
    if message.width * message.height != count or step < 12 or len(message.data) != count * step:
        raise InputFileError(path, f"{topic} does not fit its topology", "needed: as many points")
    rows = message.data.reshape(count, step)
    return np.ascontiguousarray(rows[:, :12]).view(np.float32).reshape(-1, 3)


def stamp_of(message: Any) -> int:
    """The time in a message's header [ns]."""
    return nanoseconds(message.header.stamp)


def garment_of(topic: str) -> str:
    """Name of the garment that a topic is of."""
    return topic.split("/")[-2]
