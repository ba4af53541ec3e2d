"""Calls at a fixed rate on an absolute grid of times: nothing drifts, what was missed is known.

`rclpy`'s executor looks at every entity of a node whenever it wakes, which takes longer than many
a frame. So in real time the grid is kept here, by sleeping; the executor then only has a look now
and then (`spin`). In simulated time the calls come from a timer of the node's. A node that follows
one topic instead waits for that alone in the same way.
"""

import math
import time
from collections.abc import Callable
from fractions import Fraction
from typing import Protocol

from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.lifecycle import LifecycleNode
from rclpy.timer import Timer

from garment_sim_ros.going_first import go_first
from garment_sim_ros.ros.rclpy_internals import run_ready
from garment_sim_ros.stamps import SECOND

_LOOK_PERIOD = SECOND // 10
"""How often services, parameters and descriptions are looked at beside the ticks [ns]."""
_LONGEST_LOOK = SECOND // 200
"""Then it goes on at the next look, however much there is to do [ns]."""
_LOST = 10 * SECOND
"""A grid so far in the past is left: the clock was set, or the machine slept [ns]."""
_STANDS = SECOND // 10
"""A simulated clock that has not moved for so long stands still [ns]."""
_PARTS = 4
"""A period is divided into so many parts by times at which work ahead of a call can be done."""


class Ticker:
    """Calls back at a fixed rate of the node's clock.

    Args:
        node: The node.
        rate: Calls per second [Hz].
        callback: Takes the time at which the call was due [ns] and how many periods have passed
            since the one before: 1, or more where calls had to be left out.
        origin: A time of the grid in real time [ns]: tickers with the same one stay in step, where
            their rates are multiples of each other. None: the grid begins now.
        work_ahead: Does between two calls what can be done of the second; called some times, but
            not in simulated time. Takes when that call is due [ns].

    Attributes:
        period: Time between calls [ns].
        is_simulated: Whether the node's clock is a simulated one.
    """

    def __init__(
        self,
        node: LifecycleNode,
        rate: float,
        callback: Callable[[int, int], None],
        origin: int | None = None,
        work_ahead: Callable[[int], object] | None = None,
    ) -> None:
        self.period = round(SECOND / rate)
        self._work_ahead = work_ahead
        self._calls = Fraction(rate) / SECOND  # per nanosecond
        self._callback = callback
        self._node = node
        self._given_origin = origin
        self._timer: Timer | None = None
        self.follow_clock(simulated=bool(node.get_parameter("use_sim_time").value))

    def follow_clock(self, *, simulated: bool) -> None:
        """Go on with the node's clock, which may be another one than before."""
        self.destroy()
        self.is_simulated = simulated
        given = None if simulated else self._given_origin
        self._origin = self.now() if given is None else given
        self._number = 1 + self._last_before(self.now())
        self._due = self._time_of(self._number)
        self._part = _PARTS
        self._seen = self.now(), time.monotonic_ns()
        if simulated:
            self._timer = self._node.create_timer(self.period / SECOND, self._tick)

    def now(self) -> int:
        """Time of the node's clock [ns]."""
        return int(self._node.get_clock().now().nanoseconds)

    def stands_still(self) -> bool:
        """Whether the clock is a simulated one that has not moved for a while: it is paused."""
        now = self.now()
        if now != self._seen[0]:
            self._seen = now, time.monotonic_ns()
        is_told = self.is_simulated and now > 0  # else it has not begun
        return is_told and time.monotonic_ns() - self._seen[1] > _STANDS

    def steady(self) -> int:
        """Now [ns], on a clock to average arrivals on: one that is not set, or as stamps are."""
        return self.now() if self.is_simulated else time.monotonic_ns()

    def ahead(self) -> int:
        """Time until there is something to do [ns]: the next call, or work ahead of it."""
        now = self.now()
        self._leave_a_lost_grid(now)
        return self._next() - now

    def wait(self, longest: int) -> None:
        """Sleep until there is something to do, at most some time [ns], and do it."""
        ahead = self.ahead()
        if ahead > 0:
            time.sleep(min(ahead, longest) / SECOND)
        if ahead <= longest:
            self._do()

    def call_if_due(self) -> None:
        """Do what there is to do unless it is too early for it, or a timer does it."""
        if not self.is_simulated and self.ahead() <= 0:
            self._do()

    def _next(self) -> int:
        """When there is something to do [ns]."""
        left = _PARTS - self._part
        return self._due - left * self.period // _PARTS

    def _do(self) -> None:
        if self._work_ahead is None or self._next() >= self._due or self.now() >= self._due:
            self._tick()
            return
        self._work_ahead(self._due)
        now = self.now()
        while self._part < _PARTS and self._next() <= now:
            self._part += 1

    def _leave_a_lost_grid(self, now: int) -> None:
        """Begin a new one where the clock was set: a call is due within a period, or was."""
        if now - self._due > _LOST or self._due - now > 2 * self.period:
            self._origin = self._due = now
            self._number, self._part = 0, _PARTS

    def destroy(self) -> None:
        """Stop for good."""
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def _tick(self) -> None:
        now = self.now()
        self._leave_a_lost_grid(now)
        # A timer comes a little early by its own reckoning, never by half a period.
        number = max(self._number, self._last_before(now + self.period // 4))
        missed = number - self._number
        due = self._due if not missed else self._time_of(number)
        self._number = number + 1
        self._due = self._time_of(self._number)
        self._part = _PARTS if self._work_ahead is None else 1
        self._callback(due, 1 + missed)

    def _time_of(self, number: int) -> int:
        """When a call of the grid is due [ns]."""
        return self._origin + round(number / self._calls)

    def _last_before(self, now: int) -> int:
        """The last call of the grid up to a time [ns]."""
        return math.floor((now - self._origin) * self._calls)


class Waits(Protocol):
    """What a node mostly waits for."""

    def wait(self, longest: int) -> None:
        """Sleep until it is there, at most some time [ns], and handle it."""


class Spun(Protocol):
    """What `spin` asks of a node."""

    @property
    def context(self) -> Context:
        """The node's context."""

    @property
    def realtime_priority(self) -> int:
        """See `going_first.go_first`."""

    @property
    def mostly(self) -> Waits | None:
        """What the node mostly waits for at the moment, if there is such a thing."""

    def attend(self) -> None:
        """Take over what was made beside the node's thread."""


def spin(executor: Executor, node: Spun) -> None:
    """Run a node's callbacks until its context is shut down.

    Raises:
        ExternalShutdownException: The context was shut down.
    """
    looked = 0
    while node.context.ok():
        go_first(node.realtime_priority)
        node.attend()
        current = node.mostly
        if current is None:
            executor.spin_once(timeout_sec=_LOOK_PERIOD / SECOND)
            continue
        current.wait(_LOOK_PERIOD)
        now = time.monotonic_ns()
        if now - looked >= _LOOK_PERIOD:
            looked = now
            while run_ready(executor) and time.monotonic_ns() - now < _LONGEST_LOOK:
                pass
    raise ExternalShutdownException
