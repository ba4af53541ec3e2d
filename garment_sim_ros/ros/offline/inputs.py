"""What comes in: the messages of a clip that is played, or of a recording."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rosbags.interfaces import Connection
from std_msgs.msg import String

from garment_sim_ros.body.humanoid import load_humanoid_overrides
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.mocap.bag_file import Bag, opened_bag
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler, rate_of
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.params import MocapPlayerParameters
from garment_sim_ros.ros.cdr import encode
from garment_sim_ros.ros.offline.setup import JOINTS, POSES
from garment_sim_ros.ros.serialize import Joints
from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_POSES,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
    Topic,
)
from garment_sim_ros.stamps import SECOND

_LONGEST = 24 * 3600.0
"""Longest time that a clip is played for [s]."""
_NEEDED = {
    JOINTS: (ROBOT_DESCRIPTION, JOINT_STATES),
    POSES: (COLLIDER_DESCRIPTION, COLLIDER_POSES),
}


@dataclass(frozen=True)
class Message:
    """One message.

    Attributes:
        topic: What it is about.
        time: When it came, its time in the recording [ns].
        data: Its bytes.
    """

    topic: Topic
    time: int
    data: bytes


@dataclass(frozen=True, kw_only=True)
class Input:
    """Messages to be worked through.

    Attributes:
        messages: The description first.
        count: How many they are.
        namespace: Where their topics are, empty or with a slash in front.
        begins_with: Which they are, joint_states or collider_poses.
    """

    messages: Iterator[Message]
    count: int
    namespace: str
    begins_with: str


def from_clip(p: MocapPlayerParameters, seconds: float | None = None) -> Input:
    """A clip as `mocap_player` plays it with a clock that begins at 0.

    Args:
        p: The player's parameters.
        seconds: For how long [s]; the length of the clip where None.

    Raises:
        InputFileError: The clip cannot be used.
        ParameterError: A length that is not allowed.
    """
    clip = load_clip(
        p.clip, humanoid_overrides=load_humanoid_overrides(p.bone_names) if p.bone_names else None
    )
    length = clip.duration / (p.speed or 1.0) if seconds is None else seconds
    if not 0.0 <= length <= _LONGEST:
        raise ParameterError("--seconds", f"found {length:g}", f"allowed: 0 to {_LONGEST:g}")
    period = round(SECOND / (p.rate or rate_of(clip)))
    sampler = ClipSampler(clip, ("carry" if p.travel else "loop") if p.loop else "once")
    count = round(length * SECOND) // period + 1

    def messages() -> Iterator[Message]:
        yield Message(
            ROBOT_DESCRIPTION, period, encode(String(data=urdf_from_clip(clip, p.frame_id)))
        )
        message = Joints(clip.rig.dofs.names, p.frame_id)
        clip_time = 0.0
        for n in range(1, count + 1):  # time 0 would mean that there is no time yet
            data = message.fill(n * period, sampler.sample(clip_time))
            yield Message(JOINT_STATES, n * period, data)
            clip_time += p.speed * period / SECOND

    return Input(messages=messages(), count=count + 1, namespace="", begins_with=JOINTS)


@contextmanager
def opened_input(
    path: str | Path, *, begins_with: str = "", namespace: str | None = None
) -> Iterator[Input]:
    """A recording's messages.

    Args:
        path: A rosbag2 folder, or its .mcap or .db3 file.
        begins_with: joint_states or collider_poses; empty: the first of these that it has.
        namespace: Of the avatar; None: the first one's that it has.

    Raises:
        InputFileError: It cannot be read, or lacks what is needed.
    """
    with opened_bag(path) as bag:
        name, topics = _chosen(path, bag, begins_with, namespace)
        yield Input(
            messages=_in_order(path, bag, topics),
            count=sum(c.msgcount for c in topics.values()),
            namespace=next(iter(topics.values())).topic.rpartition("/")[0],
            begins_with=name,
        )


def _chosen(
    path: str | Path, bag: Bag, begins_with: str, namespace: str | None
) -> tuple[str, dict[Topic, Connection]]:
    """The first pair of topics of one avatar that a recording has."""
    for name in (begins_with,) if begins_with else (JOINTS, POSES):
        spaces = {
            c.topic.rpartition("/")[0]
            for c in bag.connections
            if _is(c, _NEEDED[name][1]) and c.msgcount
        }
        for space in sorted(spaces) if namespace is None else [namespace]:
            found = {
                topic: c
                for topic in _NEEDED[name]
                for c in bag.connections
                if _is(c, topic) and c.topic.rpartition("/")[0] == space and c.msgcount
            }
            if len(found) == len(_NEEDED[name]):
                return name, found
    pairs = [_NEEDED[begins_with]] if begins_with else list(_NEEDED.values())
    raise InputFileError(
        path,
        "lacks what is needed" + (f" in {namespace or '/'}" if namespace is not None else ""),
        "needed: messages on "
        + " or on ".join(" and ".join(topic.name for topic in pair) for pair in pairs),
    )


def _is(connection: Connection, topic: Topic) -> bool:
    name = connection.topic.rpartition("/")[2]
    return name == topic.name and connection.msgtype == topic.kind


def _in_order(path: str | Path, bag: Bag, topics: dict[Topic, Connection]) -> Iterator[Message]:
    """The first description, then the messages as they came but for that one."""
    description, moving = topics
    start = next((time for _, time, _ in bag.messages([topics[moving]])), 0)
    first = next(bag.messages([topics[description]]), None)
    if first is None:
        raise InputFileError(path, f"holds no message on {topics[description].topic}")
    yield Message(description, min(first[1], start), first[2])
    # It is latched: who came late got it before all else.
    is_first = True
    for connection, time, data in bag.messages(list(topics.values())):
        topic = description if connection.topic == topics[description].topic else moving
        if topic is description and is_first:
            is_first = False
            continue
        yield Message(topic, time, data)
