"""A recorded avatar: what its topics said, read back from the bag."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag2 import ReaderError

from garment_sim_ros.errors import InputFileError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


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
class Recording:
    """An avatar's topics.

    Attributes:
        robot_description: The source skeleton, URDF text.
        joint_names: Channels, in the order of `joint_values`.
        joint_stamp: Of each `joint_states` message [ns], shape [k].
        joint_values: Channel values [rad or m], shape [k, d].
        stamp: Times of frames of which all garments are kept [ns], increasing, shape [m].
        garments: By name.
        quality: Values over time of each key that each status of `quality` has.
    """

    robot_description: str
    joint_names: tuple[str, ...]
    joint_stamp: NDArray[np.int64]
    joint_values: FloatArray
    stamp: NDArray[np.int64]
    garments: dict[str, GarmentTrack]
    quality: dict[str, dict[str, FloatArray]]


def read_recording(path: str | Path, *, most_frames: int = 300) -> Recording:
    """Read a bag of one avatar.

    Args:
        path: A rosbag2 folder.
        most_frames: Positions are kept of at most so many frames, evenly spread.

    Raises:
        InputFileError: Not a bag, or topics that are needed are missing or have no message.
    """
    try:
        with AnyReader([Path(path)]) as reader:
            return _read(reader, path, most_frames)
    except (AnyReaderError, ReaderError, OSError) as error:
        raise InputFileError(path, str(error), "allowed: a rosbag2 folder") from None


def _read(reader: AnyReader, path: str | Path, most_frames: int) -> Recording:
    def messages(ending: str) -> Iterator[tuple[str, int, Any]]:
        connections = [c for c in reader.connections if c.topic.endswith("/" + ending)]
        if not sum(c.msgcount for c in connections):
            raise InputFileError(path, f"no message on {ending}", "needed: an avatar's topics")
        for connection, arrival, data in reader.messages(connections):
            yield connection.topic, arrival, reader.deserialize(data, connection.msgtype)

    description = next(messages("robot_description"))[2].data
    joints = [message for _, _, message in messages("joint_states")]
    names = tuple(joints[0].name)
    joints = [m for m in joints if tuple(m.name) == names and len(m.position) == len(names)]
    quality: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for _, _, message in messages("quality"):
        for status in message.status:
            for item in status.values:
                with suppress(ValueError):  # a word, such as the name of a solver
                    number = float(item.value)
                    quality[status.name][item.key].append(number)

    shapes = {_garment_of(topic): _mesh(message) for topic, _, message in messages("topology")}
    arrivals: dict[str, list[int]] = {name: [] for name in shapes}
    stamps: dict[str, set[int]] = {name: set() for name in shapes}
    finite = dict.fromkeys(shapes, True)
    for topic, arrival, message in messages("points"):
        name = _garment_of(topic)
        if message.width * message.height != len(shapes.get(name, ((),))[0]):
            raise InputFileError(
                path, f"{topic} does not fit its topology", "needed: as many points"
            )
        arrivals[name].append(arrival)
        stamps[name].add(_nanoseconds(message))
        finite[name] = finite[name] and bool(np.isfinite(_points(message)).all())

    # A second pass rather than holding all positions: a long recording has too many.
    common = sorted(set.intersection(*stamps.values()))
    kept = common[:: max(1, -(-len(common) // most_frames))]
    place = {stamp: k for k, stamp in enumerate(kept)}
    positions = {
        name: np.zeros((len(kept), len(vertices), 3), np.float32)
        for name, (vertices, _) in shapes.items()
    }
    for topic, _, message in messages("points"):
        if (k := place.get(_nanoseconds(message))) is not None:
            positions[_garment_of(topic)][k] = _points(message)
    return Recording(
        robot_description=description,
        joint_names=names,
        joint_stamp=np.array([_nanoseconds(m) for m in joints]),
        joint_values=np.array([m.position for m in joints]),
        stamp=np.array(kept, np.int64),
        garments={
            name: GarmentTrack(
                vertices=vertices,
                triangles=triangles,
                arrival=np.array(arrivals[name], np.int64),
                finite=finite[name],
                positions=positions[name],
            )
            for name, (vertices, triangles) in shapes.items()
        },
        quality={
            name: {key: np.array(values) for key, values in keys.items()}
            for name, keys in quality.items()
        },
    )


def _mesh(message: Any) -> tuple[FloatArray, IntArray]:
    vertices = np.array([[p.x, p.y, p.z] for p in message.vertices])
    return vertices, np.array([t.vertex_indices for t in message.triangles], np.int32)


def _points(message: Any) -> NDArray[np.float32]:
    """The x y z of a PointCloud2 that starts with them, shape [v, 3]."""
    rows = message.data.reshape(message.width * message.height, message.point_step)
    return np.ascontiguousarray(rows[:, :12]).view(np.float32).reshape(-1, 3)


def _nanoseconds(message: Any) -> int:
    stamp = message.header.stamp
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def _garment_of(topic: str) -> str:
    return topic.split("/")[-2]
