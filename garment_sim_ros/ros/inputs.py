"""What a node takes in: serialized messages of some topics, asked for in a fixed order.

With `rclpy`'s executor, being woken costs more than what a message brings; and it does not tell
who sent it. However many messages come, those that are taken at once are limited, so that a node
that is flooded still does its work.
"""

import time
from collections.abc import Callable, Sequence

from rclpy.node import Node
from rclpy.subscription import Subscription

from garment_sim_ros.errors import GarmentSimError, MessageError
from garment_sim_ros.ros.handover import Handed, Handover
from garment_sim_ros.ros.interfaces import subscribe
from garment_sim_ros.ros.rclpy_internals import Taken, Taker, Waiter
from garment_sim_ros.ros.sources import Source
from garment_sim_ros.ros.stamp_order import AWAY
from garment_sim_ros.ros.topics import Topic
from garment_sim_ros.stamps import SECOND

UNUSABLE = "unusable"
_MOST_AT_ONCE = 100
_MOST_BYTES = 32 * 2**20


class Input:
    """One topic.

    Args:
        node: The node.
        topic: The topic.
        take: Uses a message; may raise `MessageError`.
        rejected: Called with the topic and the error of every message that was not used.
        source: Which publisher is followed; None: all of them.
        room: Messages that may come between two calls of `take_all`.
        keep_all: Whether none may be lost.
        handover: Topics that are not subscribed to, but handed over within the process.

    Attributes:
        topic: As given.
        source: As given.
        away: Time without a look at what has come, before the next usable message; 0 where it was
            short [ns].
        used: When the last usable message came, on a clock that only runs forward [ns].
        count: Usable messages so far.
        subscription: None where messages are handed over.
    """

    def __init__(
        self,
        node: Node,
        topic: Topic,
        take: Callable[[Taken], object],
        *,
        rejected: Callable[[str, MessageError], object],
        source: Source | None = None,
        room: int = 0,
        keep_all: bool = False,
        handover: Handover | None = None,
    ) -> None:
        self.topic = topic
        self.source = source
        self.used = self._looked = time.monotonic_ns()
        self.away = self.count = 0
        self._node = node
        self._take = take
        self._rejected = rejected
        self._most = max(room, _MOST_AT_ONCE)
        self.subscription: Subscription | None = None
        self._taker: Taker | Handed
        self._handover = handover if handover is not None and topic in handover else None
        if self._handover is not None:
            depth = max(topic.depth, room)
            self._taker = self._handover.read(topic, depth=depth, keep_all=keep_all)
        else:
            self.subscription = subscribe(node, topic, depth=room, keep_all=keep_all)
            self._taker = Taker(self.subscription)

    def take_all(self) -> None:
        """Use the messages that have come, up to a number."""
        now = time.monotonic_ns()
        if now - self._looked > AWAY:
            self.away = now - self._looked
        self._looked = now
        for _ in range(self._most):
            message = self._taker.take()
            if message is None:
                return
            self._use(message)

    def destroy(self) -> None:
        """Take in nothing more."""
        if self._handover is not None and isinstance(self._taker, Handed):
            self._handover.leave(self.topic, self._taker)
        if self.subscription is not None:
            self._node.destroy_subscription(self.subscription)

    def silent(self) -> float:
        """Time since the last usable message, or since the input was made [s]."""
        return (time.monotonic_ns() - self.used) / SECOND

    def excuse(self) -> None:
        """Begin to count the silence anew."""
        self.used = time.monotonic_ns()

    def conflict(self) -> str:
        """Who is followed and who is not, where several send; empty where there is no conflict.

        A followed publisher that is there no more is left. Where messages are handed over, who
        else publishes is not heard.
        """
        if self._handover is not None:
            return self._unheard()
        source = self.source
        if source is None or source.followed is None or self.subscription is None:
            return ""
        others = source.others(time.monotonic_ns())
        if not others:
            return ""
        names = {
            bytes(info.endpoint_gid)[
                : len(source.followed)
            ]: f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            for info in self._node.get_publishers_info_by_topic(self.subscription.topic_name)
        }
        # Some middlewares identify publishers in messages otherwise than in the graph.
        if source.followed not in names and any(other in names for other in others):
            source.leave()
            return ""

        def named(publisher: bytes) -> str:
            name = names.get(publisher, publisher.hex())
            alike = list(names.values()).count(name) > 1
            return f"{name} ({publisher.hex()})" if alike else name

        ignored = ", ".join(named(p) for p in others)
        return (
            f"{1 + len(others)} publishers of {self.topic.name}: {named(source.followed)} is "
            f"followed, {ignored} ignored"
        )

    def _unheard(self) -> str:
        """Who publishes what is handed over; empty where that is one."""
        topic = self._node.resolve_topic_name(self.topic.name)
        count = self._node.count_publishers(topic)
        if count < 2:
            return ""
        return (
            f"{count} publishers of {self.topic.name}: that of this process is followed, "
            "what others send is not heard"
        )

    def _use(self, message: Taken) -> None:
        try:
            if len(message.data) > _MOST_BYTES:
                raise MessageError(
                    "too_long", f"{len(message.data)} bytes; allowed: up to {_MOST_BYTES}"
                )
            now = time.monotonic_ns()
            if self.source is not None:
                self.source.check(message.publisher, now)
            self._take(message)
        except MessageError as error:
            self._rejected(self.topic.name, error)
            return
        except GarmentSimError as error:
            self._rejected(self.topic.name, MessageError(UNUSABLE, str(error)))
            return
        self.used = time.monotonic_ns()
        self.count += 1
        self.away = 0
        if self.source is not None:
            self.source.accept(message.publisher, self.used)


class Inputs:
    """Inputs that a node waits for together; each time they are taken in the order given.

    Args:
        node: The node.
        inputs: The inputs.
    """

    def __init__(self, node: Node, inputs: Sequence[Input]) -> None:
        self._inputs = inputs
        subscriptions = [i.subscription for i in inputs if i.subscription is not None]
        self._waiter = Waiter(node.context, subscriptions)

    def wait(self, longest: int) -> None:
        """Sleep until messages come, at most some time [ns], and use them."""
        self._waiter.wait(longest)
        for i in self._inputs:
            i.take_all()
