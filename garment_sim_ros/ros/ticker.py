"""Calls at a fixed rate on an absolute grid of times: nothing drifts, what was missed is known.

`rclpy`'s executor looks at every entity of a node whenever it wakes, which takes longer than many
a frame. So in real time the grid is kept here, by sleeping; the executor then only has a look now
and then (`spin`). In simulated time the calls come from a timer of the node's. A node that follows
one topic instead waits for that alone in the same way.
"""

import time
from collections.abc import Callable
from typing import Protocol

from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.lifecycle import LifecycleNode
from rclpy.timer import Timer

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


class Ticker:
    """Calls back at a fixed rate of the node's clock.

    Args:
        node: The node.
        rate: Calls per second [Hz].
        callback: Takes the time at which the call was due [ns] and how many periods have passed
            since the one before: 1, or more where calls had to be left out.

    Attributes:
        period: Time between calls [ns].
        is_simulated: Whether the node's clock is a simulated one.
    """

    def __init__(
        self, node: LifecycleNode, rate: float, callback: Callable[[int, int], None]
    ) -> None:
        self.period = round(SECOND / rate)
        self._callback = callback
        self._node = node
        self._timer: Timer | None = None
        self.follow_clock(simulated=bool(node.get_parameter("use_sim_time").value))

    def follow_clock(self, *, simulated: bool) -> None:
        """Go on with the node's clock, which may be another one than before."""
        self.destroy()
        self.is_simulated = simulated
        self._due = self.now() + self.period
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

    def wait(self, longest: int) -> None:
        """Sleep until the next call is due, at most some time [ns], and make it."""
        self._leave_a_lost_grid(self.now())
        ahead = self._due - self.now()
        if ahead > longest:
            time.sleep(longest / SECOND)
        else:
            if ahead > 0:
                time.sleep(ahead / SECOND)
            self._tick()

    def _leave_a_lost_grid(self, now: int) -> None:
        """Begin a new one where the clock was set: a call is due within a period, or was."""
        if now - self._due > _LOST or self._due - now > 2 * self.period:
            self._due = now

    def destroy(self) -> None:
        """Stop for good."""
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def _tick(self) -> None:
        now = self.now()
        self._leave_a_lost_grid(now)
        # A timer comes a little early by its own reckoning, never by half a period.
        missed = max(0, (now - self._due + self.period // 4) // self.period)
        due = self._due + missed * self.period
        self._due = due + self.period
        self._callback(due, 1 + missed)


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
