"""Recorded `joint_states` of a rosbag2 as a clip."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_typestore

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.mocap.bag_file import Bag, opened_bag
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.sampling import closes
from garment_sim_ros.mocap.source_urdf import reference_from_urdf
from garment_sim_ros.stamps import nanoseconds

_MAX_MESSAGES = 2_000_000
_MAX_VALUES = 200_000_000
_JOINT_STATE = "sensor_msgs/msg/JointState"
_STRING = "std_msgs/msg/String"


def load_bag(path: str | Path) -> Clip:
    """Read the joint states and the robot description of a recording.

    Messages that cannot be used are left out and counted in the clip's notes: other joints than
    the first message's, values that are missing or not finite, stamps that repeat or go back.

    Args:
        path: A rosbag2 folder, or its .mcap or .db3 file.

    Raises:
        InputFileError: It is missing, damaged, too large, or holds no usable joint states.
    """
    with opened_bag(path) as reader:
        return _clip(path, reader)


def _clip(path: str | Path, reader: Bag) -> Clip:
    states = _topic(path, reader, _JOINT_STATE, "joint_states", near="")
    namespace = states.topic.rpartition("/")[0]
    description = _topic(path, reader, _STRING, "robot_description", near=namespace)
    text = None
    types = get_typestore(Stores.ROS2_JAZZY)
    for _, _, data in reader.messages([description]):
        text = types.deserialize_cdr(data, _STRING).data  # type: ignore[attr-defined]
        break
    if text is None:
        raise InputFileError(path, f"holds no message on {description.topic}")
    source = f"{path}: {description.topic}"
    rig, reference = parse_urdf(text, source), reference_from_urdf(text, source)
    rejected: Counter[str] = Counter()
    times, values, joints = _read(path, reader, states, rig.dofs.names, rejected)
    notes = [f"Left out {count} message(s): {why}." for why, count in sorted(rejected.items())]
    still = sorted(set(rig.dofs.names) - joints)
    if still:
        notes.append(f"Not recorded, taken as 0: {', '.join(still[:20])}.")
    pose = None
    if reference.values:
        pose = np.array([reference.values.get(name, 0.0) for name in rig.dofs.names])

    def vectors(named: Any) -> tuple[tuple[str, tuple[float, float, float]], ...]:
        return tuple((n, (float(v[0]), float(v[1]), float(v[2]))) for n, v in named.items())

    clip = Clip(
        name=Path(path).stem,
        rig=rig,
        times=times,
        values=values,
        T_world_file=np.eye(4),
        reference=pose,
        end_sites=vectors(reference.end_sites),
        hinges=vectors(reference.hinges),
        soles=vectors(reference.soles),
        ankle_height=reference.ankle_height,
        notes=tuple(notes),
    )
    return replace(clip, loops=closes(clip))


def _topic(path: str | Path, reader: Bag, kind: str, name: str, near: str) -> Connection:
    """The connection of a topic that ends in `name`, the one in namespace `near` preferred."""
    found = [
        c for c in reader.connections
        if c.msgtype == kind and c.topic.rpartition("/")[2] == name
    ]  # fmt: skip
    if not found:
        topics = sorted({c.topic for c in reader.connections})
        raise InputFileError(
            path,
            f"has no topic {name} of type {kind}; its topics: {', '.join(topics[:20]) or 'none'}",
        )
    return min(found, key=lambda c: (c.topic.rpartition("/")[0] != near, c.topic))


def _messages(reader: Bag, connection: Connection) -> Iterator[tuple[int, Any]]:
    """Log time [ns] and message; None where it cannot be decoded."""
    types = get_typestore(Stores.ROS2_JAZZY)
    for _, timestamp, data in reader.messages([connection]):
        try:
            yield timestamp, types.deserialize_cdr(data, _JOINT_STATE)
        except Exception:  # a damaged record must not take the others with it
            yield timestamp, None


def _read(
    path: str | Path,
    reader: Bag,
    connection: Connection,
    channels: tuple[str, ...],
    rejected: Counter[str],
) -> tuple[FloatArray, FloatArray, frozenset[str]]:
    """Times [s], values [rad or m] and which channels were recorded."""
    column = {name: i for i, name in enumerate(channels)}
    names: tuple[str, ...] = ()
    order: NDArray[np.intp] = np.zeros(0, np.intp)
    first: frozenset[str] = frozenset()
    stamps: list[int] = []
    rows: list[FloatArray] = []
    for count, (log_time, message) in enumerate(_messages(reader, connection)):
        if count >= _MAX_MESSAGES or len(rows) * len(channels) > _MAX_VALUES:
            raise InputFileError(
                path, "holds too many joint states", f"allowed: {_MAX_MESSAGES} messages"
            )
        if message is None:
            rejected["they cannot be decoded"] += 1
            continue
        if len(message.name) != len(message.position):
            rejected["names and positions differ in number"] += 1
            continue
        if not np.isfinite(message.position).all():
            rejected["a position is not finite"] += 1
            continue
        if names != tuple(message.name):
            if len(set(message.name)) != len(message.name):
                rejected["a name occurs twice"] += 1
                continue
            if first and first != set(message.name):
                rejected["the joints are not those of the first message"] += 1
                continue
            names, first = tuple(message.name), frozenset(message.name)
            order = np.array([k for k, name in enumerate(names) if name in column], np.intp)
            target = np.array([column[names[k]] for k in order], np.intp)
        if len(order) == 0:
            raise InputFileError(
                path,
                f"the joint states name {', '.join(names[:5]) or 'nothing'}, of which the robot "
                "description has none",
            )
        stamp = nanoseconds(message.header.stamp)
        stamp = stamp or log_time
        if stamps and stamp <= stamps[-1]:
            rejected["the stamp repeats or goes back"] += 1
            continue
        row = np.zeros(len(channels))
        row[target] = message.position[order]
        stamps.append(stamp)
        rows.append(row)
    if not rows:
        why = "; ".join(sorted(rejected)) or "there are none"
        raise InputFileError(path, f"holds no usable joint states: {why}")
    seconds = np.array([stamp - stamps[0] for stamp in stamps], dtype=np.float64) * 1e-9
    return seconds, np.array(rows), frozenset(first & column.keys())
