"""What all nodes share: lifecycle, parameters, diagnostics, and how a process begins and ends."""

import gc
import os
import signal
import sys
import traceback
from collections.abc import Callable, Collection
from types import FrameType
from typing import Any, Generic, TypeVar

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import (
    LifecycleNode,
    LifecyclePublisher,
    LifecycleState,
    TransitionCallbackReturn,
)
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from garment_sim_ros.errors import GarmentSimError, MessageError
from garment_sim_ros.params import LifecycleParameters
from garment_sim_ros.ros.diagnostics import Condition, Diagnostics, Rejections
from garment_sim_ros.ros.interfaces import Poll, Topic, advertise, advertise_always, subscribe
from garment_sim_ros.ros.parameters import NodeParameters
from garment_sim_ros.ros.ticker import Ticker, Waits, spin

Group = TypeVar("Group")


class ManagedNode(LifecycleNode, Generic[Group]):
    """A lifecycle node that says what is wrong with it.

    Subclasses override `prepare`, `start`, `stop`, `release`, `condition` and, where parameters
    may be set while the node runs, `parameters_changed`.

    Args:
        name: The node's name.
        group: Its parameters.
        dynamic: Names of those that may be set while it runs.

    Attributes:
        parameters: Their values now.
        autostart: Whether it configures and activates itself.
        rejections: What it rejected.
        failure: Why configuring failed, None if it did not.
        ticker: Makes the node's calls at a fixed rate, None where there are none.
    """

    def __init__(self, name: str, group: type[Group], *, dynamic: Collection[str] = ()) -> None:
        super().__init__(name)
        self._group_parameters = NodeParameters(
            self, group, dynamic=dynamic, on_change=self.parameters_changed
        )
        self.autostart = NodeParameters(self, LifecycleParameters).values.autostart
        self.rejections = Rejections(self.get_logger().warning)
        self.failure: GarmentSimError | None = None
        self.ticker: Ticker | None = None
        self._followed: Poll | None = None
        self._entities: list[Publisher | Subscription] = []
        self._diagnostics = Diagnostics(self, self.rejections, self.condition)

    @property
    def parameters(self) -> Group:
        """Values of the node's parameters."""
        return self._group_parameters.values

    def prepare(self) -> None:
        """Load what is needed and make publishers and subscriptions."""

    def start(self) -> None:
        """Begin to work."""

    def stop(self) -> None:
        """Pause work; `start` may follow."""

    def release(self) -> None:
        """Let go of what `prepare` loaded; topics end by themselves."""

    def tick_at(self, rate: float, callback: Callable[[int, int], None]) -> Ticker:
        """Begin to call back at a fixed rate [Hz]; see `Ticker`."""
        self.ticker = Ticker(self, rate, callback)
        return self.ticker

    def stop_ticking(self) -> None:
        """Call back no more."""
        if self.ticker is not None:
            self.ticker.destroy()
            self.ticker = None

    def follow(self, topic: Topic, take: Callable[[bytes], None]) -> None:
        """As `subscribe`, for the topic that the node waits for most of the time."""
        self._followed = self.poll(topic, take, room=0)

    @property
    def mostly(self) -> Waits | None:
        """What `spin` waits for."""
        if self.ticker is not None and not self.ticker.is_simulated:
            return self.ticker
        return self._followed

    def parameters_changed(self, parameters: Group) -> None:
        """Take over parameters that were set."""

    def condition(self) -> Condition:
        """How the node is, for its diagnostics."""
        return Condition(text=self.state)

    @property
    def state(self) -> str:
        """Name of the lifecycle state."""
        return str(self._state_machine.current_state[1])

    def advertise(self, topic: Topic, garment: str = "") -> LifecyclePublisher:
        """A publisher, silent while the node is not active, that ends with what `prepare` made."""
        publisher = advertise(self, topic, garment)
        if self.state == "active":
            # Only those that are there beforehand are activated with the node.
            publisher.on_activate(None)
        self._entities.append(publisher)
        return publisher

    def advertise_always(self, topic: Topic, garment: str = "") -> Publisher:
        """A publisher that does not depend on the state; it ends with what `prepare` made."""
        publisher = advertise_always(self, topic, garment)
        self._entities.append(publisher)
        return publisher

    def subscribe(
        self,
        topic: Topic,
        take: Callable[[bytes], None],
        *,
        always: bool = False,
        keep_all: bool = False,
    ) -> None:
        """Have serialized messages taken, and counted where `take` rejects them.

        Args:
            topic: The topic.
            take: Uses a message; may raise `MessageError`.
            always: Whether to take them while the node is not active: latched ones do not come
                again.
            keep_all: Whether none may be lost.
        """
        callback = self._counting(topic, take, always=always)
        self._entities.append(subscribe(self, topic, callback, keep_all=keep_all))

    def poll(self, topic: Topic, take: Callable[[bytes], None], *, room: int) -> Poll:
        """As `subscribe`, for messages that are asked for; see `Poll`."""
        poll = Poll(self, topic, self._counting(topic, take, always=False), room=room)
        self._entities.append(poll.subscription)
        return poll

    def _counting(
        self, topic: Topic, take: Callable[[bytes], None], *, always: bool
    ) -> Callable[[bytes], None]:
        def callback(data: bytes) -> None:
            if not always and self.state != "active":
                return
            try:
                take(data)
            except MessageError as error:
                self.rejections.add(topic.name, error)

        return callback

    def _undo(self) -> None:
        """Forget what `prepare` and all after it made."""
        self.release()
        self._followed = None
        for entity in self._entities:
            if isinstance(entity, LifecyclePublisher):
                self.destroy_lifecycle_publisher(entity)
            elif isinstance(entity, Publisher):
                self.destroy_publisher(entity)
            else:
                self.destroy_subscription(entity)
        self._entities.clear()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Prepare; a file or parameter that is not allowed leaves the node unconfigured."""
        self.failure = None
        try:
            self.prepare()
        except GarmentSimError as error:
            self.failure = error
            if not self.autostart:  # else it is the process's last line
                self.get_logger().error(f"not configured: {error}")
            self._undo()
            return TransitionCallbackReturn.FAILURE
        except Exception:
            # rclpy would drop it without a word.
            self.get_logger().fatal(traceback.format_exc())
            return TransitionCallbackReturn.ERROR
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to work."""
        result = super().on_activate(state)
        self.start()
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Pause work."""
        self.stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget everything that configuring made."""
        result = super().on_cleanup(state)
        self._undo()
        return result

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and forget everything."""
        if state.label == "active":
            self.stop()
        result = super().on_shutdown(state)
        self._undo()
        return result


class _Stopped(BaseException):
    """A signal came while the node was not yet spinning."""


class _StopSignals:
    """SIGINT and SIGTERM end the process in order, from the first line to the last.

    `rclpy` ends spinning on both; before that, work in Python is interrupted.
    """

    def __init__(self) -> None:
        self.asked = False
        self.interrupts = True
        # Before rclpy.init: its own handlers call these afterwards.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._take)

    def _take(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        if self.interrupts:
            self.interrupts = False
            raise _Stopped


def run(make_node: Callable[[], ManagedNode[Any]], argv: list[str] | None = None) -> int:
    """Run a node until SIGINT, SIGTERM or the end of its context.

    Args:
        make_node: Makes the node.
        argv: Command line with ROS arguments; that of the process where None.

    Returns:
        Exit code: 0, or 2 for a parameter or file that is not allowed, after one line about it.
    """
    signals = _StopSignals()
    # Sending happens in a thread of the middleware's: a slow reader does not delay a frame.
    os.environ.setdefault("RMW_FASTRTPS_PUBLICATION_MODE", "ASYNCHRONOUS")
    node: ManagedNode[Any] | None = None
    try:
        rclpy.init(args=argv)
        node = make_node()
        if node.autostart:
            _autostart(node)
        # What lives now lives to the end: the collector need not look at it again.
        gc.collect()
        gc.freeze()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        signals.interrupts = False
        if not signals.asked:
            spin(executor, lambda: node.mostly)
    except (_Stopped, ExternalShutdownException):
        pass
    except GarmentSimError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return 2
    except rclpy_implementation.RCLError as error:
        # The context is gone between two lines of a callback once a signal came.
        if not signals.asked:
            print(f"error: {error}", file=sys.stderr, flush=True)
            return 2
    finally:
        signals.interrupts = False
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _autostart(node: ManagedNode[Any]) -> None:
    if node.trigger_configure() != TransitionCallbackReturn.SUCCESS:
        raise node.failure or GarmentSimError(f"{node.get_name()} could not be configured")
    node.trigger_activate()
