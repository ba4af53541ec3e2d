"""A recorded avatar: what its topics said, read back from the bag."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.mocap.bag_file import opened_bag
from garment_sim_ros.stamps import nanoseconds

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

_TYPES = {
    "robot_description": "std_msgs/msg/String",
    "joint_states": "sensor_msgs/msg/JointState",
    "quality": "diagnostic_msgs/msg/DiagnosticArray",
    "topology": "shape_msgs/msg/Mesh",
    "points": "sensor_msgs/msg/PointCloud2",
}


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
        stamp: Times of frames of which all garments are kept [ns], increasing, shape [m]; only
            those at which the joints are known.
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
    with opened_bag(path) as reader:
        return _read(reader, path, most_frames)


def _read(reader: Reader, path: str | Path, most_frames: int) -> Recording:
    types = get_typestore(Stores.ROS2_JAZZY)

    def messages(ending: str) -> Iterator[tuple[str, int, Any]]:
        kind = _TYPES[ending]
        connections = [
            c for c in reader.connections
            if c.topic.endswith("/" + ending) and c.msgtype == kind
        ]  # fmt: skip
        found = False
        for connection, arrival, data in reader.messages(connections) if connections else ():
            found = True
            yield connection.topic, arrival, types.deserialize_cdr(data, kind)
        if not found:
            raise InputFileError(path, f"no message on {ending}", "needed: an avatar's topics")

    description = next(messages("robot_description"))[2].data
    names, joint_stamp, joint_values = _joints(
        message for _, _, message in messages("joint_states")
    )
    if len(joint_stamp) == 0:
        raise InputFileError(path, "holds no usable joint_states", "needed: finite positions")
    quality: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for _, _, message in messages("quality"):
        for status in message.status:
            for item in status.values:
                with suppress(ValueError):  # a word, such as the name of a solver
                    number = float(item.value)
                    quality[status.name][item.key].append(number)

    shapes = {
        _garment_of(topic): _mesh(path, topic, message)
        for topic, _, message in messages("topology")
    }
    arrivals: dict[str, list[int]] = {name: [] for name in shapes}
    stamps: dict[str, set[int]] = {name: set() for name in shapes}
    finite = dict.fromkeys(shapes, True)
    for topic, arrival, message in messages("points"):
        name = _garment_of(topic)
        if name not in shapes:
            raise InputFileError(path, f"{topic} has no topology", "needed: an avatar's topics")
        x = _points(path, topic, message, len(shapes[name][0]))
        arrivals[name].append(arrival)
        stamps[name].add(_nanoseconds(message))
        finite[name] = finite[name] and bool(np.isfinite(x).all())

    # Before the first pose and after the last one it is not known where the body was.
    first, last = joint_stamp.min(), joint_stamp.max()
    common = sorted(t for t in set.intersection(*stamps.values()) if first <= t <= last)
    # A second pass rather than holding all positions: a long recording has too many.
    kept = common[:: max(1, -(-len(common) // most_frames))]
    place = {stamp: k for k, stamp in enumerate(kept)}
    positions = {
        name: np.zeros((len(kept), len(vertices), 3), np.float32)
        for name, (vertices, _) in shapes.items()
    }
    for topic, _, message in messages("points"):
        if (k := place.get(_nanoseconds(message))) is not None:
            name = _garment_of(topic)
            positions[name][k] = _points(path, topic, message, len(shapes[name][0]))
    return Recording(
        robot_description=description,
        joint_names=names,
        joint_stamp=joint_stamp,
        joint_values=joint_values,
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
