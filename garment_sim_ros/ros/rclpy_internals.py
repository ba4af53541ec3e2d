"""All that is used of `rclpy` beside its documented interface, in this file alone.

`rclpy` has no call for these: waiting for single subscriptions without an executor, taking a
message together with its publisher's identity, the name of a lifecycle state, the end of a
lifecycle, and the parameters that are given to a node and that it does not declare. A test asks
each of them and names the versions that they were checked with (`CHECKED_WITH`).
"""

import ctypes
import time
import weakref
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context
from rclpy.executors import Executor, TimeoutException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher
from rclpy.node import Node
from rclpy.subscription import Subscription

from garment_sim_ros.stamps import SECOND

CHECKED_WITH = ("7.1",)
"""Major and minor versions of `rclpy`."""

RCLError = rclpy_implementation.RCLError
"""Raised by calls into a context that is gone."""

PARTICIPANT = 12
"""A publisher's identity begins with that of its process, so many bytes."""

_IDENTITY = 16
_KINDS = ("subscription", "guard_condition", "client", "service")
_ERROR, _NOTHING_THERE = 1, 401
_OLDEST = 10 * SECOND
"""No message waits longer to be taken: the machine's clock was set [ns]."""
_KEPT_ROOM = 2**20
"""Room for messages that is kept from one to the next [bytes]."""


class Taken(NamedTuple):
    """A message as it came.

    Attributes:
        data: Serialized.
        publisher: Identity (GID) of its publisher, empty where the middleware does not tell.
        received: When the middleware got it [ns], 0 where it does not tell.
    """

    data: bytes
    publisher: bytes
    received: int

    def age(self) -> int:
        """How long ago it was received [ns]; 0 where that is not known, or the clock was set."""
        age = time.time_ns() - self.received
        return age if 0 < age < _OLDEST else 0


class Unattended(CallbackGroup):
    """Entities that no executor waits for."""

    def can_execute(self, entity: Any) -> bool:
        """Never."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Never."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Cannot happen."""


class Waiter:
    """Waits for subscriptions without an executor, which costs more than what a message brings.

    Args:
        context: Of the node.
        subscriptions: What to wait for.
    """

    def __init__(self, context: Context, subscriptions: Sequence[Subscription]) -> None:
        self._subscriptions = subscriptions
        self._wait_set = rclpy_implementation.WaitSet(
            len(subscriptions), 0, 0, 0, 0, 0, context.handle
        )

    def wait(self, longest: int) -> None:
        """Sleep until one has a message, at most some time [ns]."""
        self._wait_set.clear_entities()
        for subscription in self._subscriptions:
            self._wait_set.add_subscription(subscription.handle)
        self._wait_set.wait(longest)


class Ready:
    """Whether an executor would find anything to run, asked for a tenth of what its look takes.

    Args:
        context: Of the nodes.
        nodes: The nodes.
    """

    def __init__(self, context: Context, nodes: Sequence[Node]) -> None:
        self._context = context
        self._nodes = nodes
        self._wait_set: Any = None
        self._sizes: tuple[int, ...] = ()

    def __call__(self) -> bool:
        """Look, without waiting."""
        services = [s.handle for n in self._nodes for s in n.services]
        clients = [c.handle for n in self._nodes for c in n.clients]
        timers = [t.handle for n in self._nodes for t in n.timers]
        guards = [g.handle for n in self._nodes for g in n.guards]
        waitables = [w for n in self._nodes for w in n.waitables]
        subscriptions = [
            s.handle
            for n in self._nodes
            for s in n.subscriptions
            if not isinstance(s.callback_group, Unattended)
        ]
        if any(timer.is_timer_ready() for timer in timers):
            return True
        sizes = (len(subscriptions), len(guards), 0, len(clients), len(services), len(waitables))
        if sizes != self._sizes:
            self._wait_set = rclpy_implementation.WaitSet(*sizes, self._context.handle)
            self._sizes = sizes
        ready = self._wait_set
        ready.clear_entities()
        for service in services:
            ready.add_service(service)
        for client in clients:
            ready.add_client(client)
        for guard in guards:
            ready.add_guard_condition(guard)
        for subscription in subscriptions:
            ready.add_subscription(subscription)
        for waitable in waitables:
            waitable.add_to_wait_set(ready)
        ready.wait(0)
        return any(map(ready.get_ready_entities, _KINDS)) or any(
            waitable.is_ready(ready) for waitable in waitables
        )


def run_ready(executor: Executor) -> bool:
    """Run one callback that is ready, without waiting.

    Returns:
        Whether there was one.

    Raises:
        Exception: What the callback raised.
    """
    try:
        handler, _, _ = executor.wait_for_ready_callbacks(timeout_sec=0.0)
    except TimeoutException:
        return False
    handler()
    handler.result()  # raises what the callback raised
    return True


def lifecycle_state(node: LifecycleNode) -> str:
    """Name of a node's lifecycle state."""
    return str(node._state_machine.current_state[1])


def end_lifecycle(node: LifecycleNode) -> None:
    """Let go of a destroyed node's lifecycle, which keeps it on the network otherwise.

    The middleware's threads then run on while the process ends and takes away what they use: it
    hung in one of 366 ends of a small node.
    """
    node._state_machine.destroy_when_not_in_use()


def given_names(node: Node) -> tuple[str, ...]:
    """Names of the parameters that the command line and parameter files give a node."""
    return tuple(node._parameter_overrides)


def given_value(node: Node, name: str) -> Any:
    """What they give one of them; None where they do not."""
    found = node._parameter_overrides.get(name)
    return None if found is None else found.value


def activate(publisher: LifecyclePublisher) -> None:
    """Let a publisher speak that was made when its node was active already."""
    publisher.on_activate(None)


class _Allocator(ctypes.Structure):
    """`rcutils_allocator_t`."""

    _fields_ = tuple(
        (name, ctypes.c_void_p) for name in ("allocate", "free", "reallocate", "zero", "state")
    )


class _Bytes(ctypes.Structure):
    """`rcutils_uint8_array_t`."""

    _fields_ = (
        ("buffer", ctypes.c_void_p),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", _Allocator),
    )


class _Info(ctypes.Structure):
    """`rmw_message_info_t`, with room for longer ones."""

    _fields_ = (
        ("sent", ctypes.c_int64),
        ("received", ctypes.c_int64),
        ("sent_number", ctypes.c_uint64),
        ("received_number", ctypes.c_uint64),
        ("middleware", ctypes.c_void_p),
        ("publisher", ctypes.c_uint8 * _IDENTITY),
        ("room", ctypes.c_uint8 * 64),
    )


class _Library(NamedTuple):
    """Functions of the C library below `rclpy`."""

    take: Callable[..., int]
    init: Callable[..., int]
    fini: Callable[..., int]
    forget_error: Callable[[], None]
    allocator: _Allocator


def _library() -> _Library | None:
    """The C library, None where it is not as it was in the versions known."""
    try:
        rcl, rcutils = ctypes.CDLL("librcl.so"), ctypes.CDLL("librcutils.so")
        take = rcl.rcl_take_serialized_message
        take.argtypes = (ctypes.c_void_p,) * 4
        take.restype = ctypes.c_int32
        init = rcutils.rcutils_uint8_array_init
        init.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
        fini = rcutils.rcutils_uint8_array_fini
        fini.argtypes = (ctypes.c_void_p,)
        default = rcutils.rcutils_get_default_allocator
        default.restype = _Allocator
        return _Library(take, init, fini, rcutils.rcutils_reset_error, default())
    except (OSError, AttributeError):
        return None


class Taker:
    """Takes a subscription's messages one by one, each with its publisher's identity.

    `rclpy` drops the identity, so the C library is asked; where it is another than the versions
    known, messages come without.

    Args:
        subscription: Of serialized messages; in a group that no executor attends to.
    """

    _lib: _Library | None = _library()

    def __init__(self, subscription: Subscription) -> None:
        self._subscription = subscription
        self._info = _Info()
        if self._lib is not None:
            self._bytes = _Bytes()
            self._make_room()
            weakref.finalize(self, self._lib.fini, ctypes.byref(self._bytes))

    def take(self) -> Taken | None:
        """The next message, None where there is none."""
        handle = self._subscription.handle
        with handle:
            if self._lib is None:
                taken = handle.take_message(self._subscription.msg_type, True)
                if taken is None:
                    return None
                return Taken(taken[0], b"", taken[1]["received_timestamp"])
            status = self._lib.take(
                handle.pointer, ctypes.byref(self._bytes), ctypes.byref(self._info), None
            )
        if status:
            self._lib.forget_error()
            if status == _NOTHING_THERE:
                return None
            if status == _ERROR:
                return Taken(b"", b"", 0)  # what came is no message
            raise RCLError(f"a message could not be taken ({status})")
        data = ctypes.string_at(self._bytes.buffer, self._bytes.length)
        if self._bytes.capacity > _KEPT_ROOM:
            self._lib.fini(ctypes.byref(self._bytes))
            self._make_room()
        return Taken(data, bytes(self._info.publisher), int(self._info.received))

    def _make_room(self) -> None:
        assert self._lib is not None
        self._lib.init(ctypes.byref(self._bytes), 0, ctypes.byref(self._lib.allocator))
