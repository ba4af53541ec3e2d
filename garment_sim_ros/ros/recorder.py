"""Records an avatar's topics into a rosbag2 (mcap) as the serialized bytes that arrive.

Messages are asked for some times a second instead of waking `rclpy`'s executor each: that takes a
third of a core for the topics of one avatar, which the nodes need.
"""

import contextlib
import importlib
import queue
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import rclpy
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosbags.interfaces import Connection, Qos
from rosbags.typesys import Stores, get_typestore

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.recording.bag_writer import BagWriter
from garment_sim_ros.ros.offered import offered
from garment_sim_ros.ros.own_context import own_context
from garment_sim_ros.ros.rclpy_internals import Taker
from garment_sim_ros.ros.topics import topic_of
from garment_sim_ros.stepping_back import SMALL, libraries_step_back, step_back

_NAMES = frozenset(
    {
        *("joint_states", "robot_description", "root_pose", "quality", "diagnostics"),
        *("collider_poses", "collider_description", "collider_markers"),
    }
)
_LOOK_PERIOD = 0.02  # between two looks for messages [s]
_DISCOVERY_PERIOD = 0.1  # between two looks for topics [s]
_USUAL = 10  # depth of topics that are not ours
_DEPTH = 1000  # arrived messages that may wait; the publishers' own depth is what they offer


@dataclass(frozen=True)
class _Topic:
    kind: str
    offered: Qos


def is_recorded(topic: str) -> bool:
    """Whether a topic, by its full name, belongs to an avatar."""
    parts = topic.split("/")
    return parts[-1] in _NAMES or "garments" in parts[:-1]


class Recorder:
    """Records while its `with` block runs, in a node and threads of its own.

    Topics are subscribed to as they appear. Writing happens in another thread than receiving, so
    that compression and the disk delay nothing.

    Args:
        path: Folder of the bag; must not exist.
        name: Name of the node.

    Attributes:
        first_cloth: Set when the first points of a garment have arrived.
        counts: Messages so far, by topic.
    """

    def __init__(self, path: Path, name: str = "recorder") -> None:
        self.first_cloth = threading.Event()
        self.counts: dict[str, int] = {}
        self._writer = BagWriter(path)
        self._types = get_typestore(Stores.ROS2_JAZZY)
        # A topic's first entry carries what it was subscribed with instead of a message.
        self._queue: queue.SimpleQueue[tuple[str, int, bytes | _Topic] | None] = (
            queue.SimpleQueue()
        )
        self._failure: BaseException | None = None
        self._takers: dict[str, Taker] = {}
        self._ended = threading.Event()
        self._name = name

    def __enter__(self) -> "Recorder":
        self._writer.open()
        self._context = own_context()
        self._node = rclpy.create_node(self._name, context=self._context)
        self._threads = [
            threading.Thread(target=self._receive, name="receive", daemon=True),
            threading.Thread(target=self._write, name="write", daemon=True),
        ]
        for thread in self._threads:
            thread.start()
        libraries_step_back()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ended.set()
        self._threads[0].join()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)
        self._queue.put(None)
        self._threads[1].join()
        self._close()
        if error is None:
            self.check()

    def check(self) -> None:
        """See that everything could be written so far.

        Raises:
            InputFileError: There was no room; the block may as well end, then the recording can be
                read up to there.
            Exception: Whatever else went wrong.
        """
        failure = self._failure
        if isinstance(failure, OSError):
            raise InputFileError(
                self._writer.path,
                f"{failure.strerror or failure}: what is whole of it stays and can be read",
                "needed: room to write",
            ) from failure
        if failure is not None:
            raise failure

    def _close(self) -> None:
        """Close the recording, or what there is room for of it."""
        try:
            if not isinstance(self._failure, OSError):
                self._writer.close()
                return
        except OSError as error:
            self._failure = error
        with contextlib.suppress(OSError):  # then there is none, and it is told as it is
            self._writer.keep_what_is_whole()

    def _receive(self) -> None:
        step_back(SMALL)
        discovered = 0.0
        try:
            while not self._ended.wait(_LOOK_PERIOD):
                now = time.monotonic()
                if now - discovered >= _DISCOVERY_PERIOD:
                    discovered = now
                    self._discover()
                self._take_all()
            self._take_all()
        except BaseException as error:
            self._failure = error

    def _take_all(self) -> None:
        arrived: list[tuple[int, str, bytes]] = []
        for topic, taker in self._takers.items():
            while (taken := taker.take()) is not None:
                # When the middleware got it, not when it was asked for.
                arrived.append((taken.received or time.time_ns(), topic, taken.data))
        for stamp, topic, data in sorted(arrived, key=lambda message: message[0]):
            self._queue.put((topic, stamp, data))
            self.counts[topic] += 1
            if topic.endswith("/points"):
                self.first_cloth.set()

    def _write(self) -> None:
        step_back(SMALL)
        # Only this thread touches the writer: it is not made for two at once.
        connections: dict[str, Connection] = {}
        while (item := self._queue.get()) is not None:
            if self._failure is not None:
                continue
            topic, stamp, data = item
            try:
                if isinstance(data, _Topic):
                    connections[topic] = self._writer.add_connection(
                        topic,
                        data.kind,
                        typestore=self._types,
                        offered_qos_profiles=[data.offered],
                    )
                else:
                    self._writer.write(connections[topic], stamp, data)
            except BaseException as error:
                self._failure = error

    def _discover(self) -> None:
        for topic, types in self._node.get_topic_names_and_types():
            if topic in self.counts or not is_recorded(topic):
                continue
            offers = self._node.get_publishers_info_by_topic(topic)
            if offers:
                self._subscribe(topic, types[0], offers)

    def _subscribe(self, topic: str, kind: str, offers: list[TopicEndpointInfo]) -> None:
        self.counts[topic] = 0
        reliable = all(o.qos_profile.reliability == ReliabilityPolicy.RELIABLE for o in offers)
        latched = all(o.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for o in offers)
        profile = QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        known = topic_of(topic)
        # Most middlewares do not tell depths.
        depth = max(o.qos_profile.depth for o in offers) or (known.depth if known else _USUAL)
        profile_offered = offered(reliable=reliable, latched=latched, depth=depth)
        self._queue.put((topic, 0, _Topic(kind, profile_offered)))
        package, _, message = kind.partition("/msg/")
        message_type = getattr(importlib.import_module(f"{package}.msg"), message)
        # No executor spins this node: the callback is never called.
        self._takers[topic] = Taker(
            self._node.create_subscription(
                message_type, topic, lambda data: None, profile, raw=True
            )
        )
