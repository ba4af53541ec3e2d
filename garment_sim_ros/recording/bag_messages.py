"""Messages of a recording by the endings of their topics, read as what they are."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_typestore

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.mocap.bag_file import Bag
from garment_sim_ros.recording.message_bytes import read_diagnostics, read_poses

_TYPES = {
    "robot_description": "std_msgs/msg/String",
    "collider_description": "std_msgs/msg/String",
    "collider_poses": "geometry_msgs/msg/PoseArray",
    "joint_states": "sensor_msgs/msg/JointState",
    "quality": "diagnostic_msgs/msg/DiagnosticArray",
    "topology": "shape_msgs/msg/Mesh",
    "points": "sensor_msgs/msg/PointCloud2",
}
_OWN_READERS: dict[str, Callable[[bytes], Any]] = {
    "collider_poses": read_poses,
    "quality": read_diagnostics,
}

Messages = Callable[..., Iterator[tuple[str, int, Any]]]
"""All messages on topics with one of these endings, by time: topic, time of arrival [ns] and
message of each. Raises `InputFileError` where there is none."""


def messages_of(reader: Bag, path: str | Path) -> Messages:
    """How messages of an opened bag are asked for."""
    types = get_typestore(Stores.ROS2_JAZZY)

    def messages(*endings: str) -> Iterator[tuple[str, int, Any]]:
        read = {
            (c.topic, c.msgtype): _OWN_READERS.get(
                ending, partial(types.deserialize_cdr, typename=c.msgtype)
            )
            for c in reader.connections
            for ending in endings
            if c.topic.endswith("/" + ending) and c.msgtype == _TYPES[ending]
        }
        asked = [c for c in reader.connections if (c.topic, c.msgtype) in read]
        found = False
        for c, arrival, data in reader.messages(asked) if asked else ():
            found = True
            yield c.topic, arrival, read[c.topic, c.msgtype](data)
        if not found:
            raise InputFileError(
                path, f"no message on {' or '.join(endings)}", "needed: an avatar's topics"
            )

    return messages


def read_at_once(messages: Messages, *endings: str) -> Messages:
    """The same, messages of some topics read now, in one pass: each unpacks all of a recording.

    Args:
        messages: How they are asked for.
        endings: Of topics that are small enough to be held.

    Raises:
        InputFileError: There is no message on any of them.
    """
    held: dict[str, list[tuple[str, int, Any]]] = {ending: [] for ending in endings}
    for topic, arrival, message in messages(*endings):
        held[topic.rsplit("/", 1)[-1]].append((topic, arrival, message))

    def from_held(ending: str) -> Iterator[tuple[str, int, Any]]:
        # One without any says so as ever.
        yield from held.get(ending) or messages(ending)

    return from_held
