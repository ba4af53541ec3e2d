"""Topics of one avatar that go from node to node of one process, beside the middleware.

Messages are handed over serialized, as they would come: what a node does with them is the same,
and so is what it rejects. Whoever else wants them subscribes as ever.
"""

import time
from collections import deque
from collections.abc import Iterable
from typing import Any

from rclpy.lifecycle import LifecyclePublisher
from rclpy.serialization import serialize_message

from garment_sim_ros.ros.rclpy_internals import PARTICIPANT, Taken
from garment_sim_ros.ros.topics import Topic

_SENDER = bytes(PARTICIPANT) + b"here"
"""Identity of all publishers of the process: there is one for each topic."""


class Handed:
    """Messages that were handed over and not taken yet.

    Args:
        most: So many are kept, the newest; None: all.
    """

    def __init__(self, most: int | None) -> None:
        self._waiting: deque[tuple[bytes, int]] = deque(maxlen=most)

    def put(self, data: bytes) -> None:
        """Hand over a serialized message."""
        self._waiting.append((data, time.time_ns()))

    def take(self) -> Taken | None:
        """The next message, None where there is none."""
        if not self._waiting:
            return None
        data, received = self._waiting.popleft()
        return Taken(data, _SENDER, received)


class Handover:
    """Hands messages from a node's publishers to other nodes' inputs.

    Args:
        topics: Those that are handed over; nobody else's messages on them are heard.
    """

    def __init__(self, topics: Iterable[Topic]) -> None:
        self._readers: dict[str, list[Handed]] = {topic.name: [] for topic in topics}
        self._latched: dict[str, bytes] = {}

    def __contains__(self, topic: Topic) -> bool:
        return topic.name in self._readers

    def read(self, topic: Topic, *, depth: int, keep_all: bool) -> Handed:
        """Messages of a topic from now on, and of a latched one the last before."""
        made = Handed(None if keep_all else depth)
        if topic.name in self._latched:
            made.put(self._latched[topic.name])
        self._readers[topic.name].append(made)
        return made

    def leave(self, topic: Topic, reader: Handed) -> None:
        """Hand over nothing more to a reader."""
        self._readers[topic.name].remove(reader)

    def give(self, topic: Topic, message: Any) -> None:
        """Hand a message to all readers of its topic."""
        data = message if isinstance(message, bytes) else serialize_message(message)
        if topic.latched:
            self._latched[topic.name] = data
        for reader in self._readers[topic.name]:
            reader.put(data)


class HandingPublisher:
    """A publisher whose messages are handed over, too.

    Args:
        publisher: The publisher; what it is silent for is not handed over.
        topic: Its topic.
        handover: Takes the messages.
    """

    def __init__(self, publisher: LifecyclePublisher, topic: Topic, handover: Handover) -> None:
        self._publisher = publisher
        self._topic = topic
        self._handover = handover

    def publish(self, message: Any) -> None:
        """Publish a message, or its serialized bytes."""
        if self._publisher.is_activated:
            self._handover.give(self._topic, message)
            self._publisher.publish(message)

    def get_subscription_count(self) -> int:
        """How many subscriptions there are in other processes."""
        return int(self._publisher.get_subscription_count())
