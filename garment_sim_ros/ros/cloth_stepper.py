"""The cloth's clock: which time is simulated next, from poses that come when they come."""

import math
import time
from collections import deque
from statistics import median
from typing import Any

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.errors import MessageError
from garment_sim_ros.params import ClothNodeParameters
from garment_sim_ros.ros.pose_buffer import PoseBuffer
from garment_sim_ros.ros.stamp_order import AWAY, StampOrder
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.world.teleport import has_jumped
from garment_sim_ros.stamps import SECOND

POSE_COUNT = "pose_count"
_REMEMBERED = 32
_LATENCY_WINDOW = SECOND // 2
"""Arrivals are averaged over this time [ns], but over no fewer than so many messages:"""
_FEWEST = 4
_PARTS = 6
"""Time that is passed over goes by in so many parts with steps between them, in which limbs that
were carried into the cloth push it out again: in one part they end deep in it."""
_UNSTEADY = SECOND // 4
"""Jumps that follow on each other in less time [ns] are waited for to end,"""
_STEADY = SECOND // 10
"""until there was none for so long [ns]."""
_COARSE = 3
"""Where the garments lag behind sub-steps are so many times as long, and so many steps at least
are one."""
_CATCHING_UP = 3
"""Garments that were put on catch up within so many times the frames that it takes where the body
stands still; a machine that is slower than that passes time over."""
_IN_VAIN = 30
"""Nor do they go on after so many frames in a row without coming nearer: garments that are not
shown are worse than garments that passed time over."""


class ClothStepper:
    """Advances a simulation by whole steps up to a time that poses are known for.

    Times are integer nanoseconds, so that the same stamps always give the same steps. Steps that
    follow each other are one of the simulation, as far as its `solver_step` reaches.

    Args:
        simulation: The garments.
        step: The step [s].
        delay: How far the cloth stays behind the newest poses [s]; below 0: one input period.
        catch_up: Most time to simulate at once where frames are due [s].
        teleport_speed: Colliders that move faster have jumped [m/s].
        teleport_turn_rate: A root that turns faster has jumped [rad/s].
        on_teleport: What follows: "reset" puts the garments on anew, "keep" takes them along as
            they are, "ignore" simulates the way.
        time_jump: Stamps farther apart begin a new time [s].
        on_time_jump: What follows, "reset" or "keep" as at a teleport.
        longest_lag: How far the garments may lag behind while they catch up [s].

    Attributes:
        time: Simulated time [ns], None before the first poses.
        steps: Steps taken.
        resets: Times the garments were put on anew, the first time not counted.
        teleports: Jumps of the body.
        skipped: Time that was passed over because there was too much of it [ns].
        coarse: Time that was simulated in coarse steps because there was much of it [ns].
        lag: How far the garments lag behind, as they catch up [ns].
        is_behind: Whether the garments were put on and have not caught up yet with the body, which
            moved on in the meantime: they are not to be shown.
        delay: As given.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        step: float,
        delay: float,
        catch_up: float,
        teleport_speed: float,
        teleport_turn_rate: float,
        on_teleport: str,
        time_jump: float,
        on_time_jump: str,
        longest_lag: float,
    ) -> None:
        self.simulation = simulation
        self.time: int | None = None
        self.steps = 0
        self.resets = 0
        self.teleports = 0
        self.skipped = self.coarse = self.lag = 0
        self.is_behind = False
        self._frames_left: int | None = None
        self._least_due = self._in_vain = 0
        self.delay = delay
        # Rounded down, so that whole numbers of steps fit into a period of the input.
        self._step = math.floor(step * SECOND + 1e-2)
        self._most_steps = max(1, round(catch_up * SECOND) // self._step)
        self._most_lag = round(longest_lag * SECOND) // self._step
        self._is_late = False
        self._late_steps = 0
        self._may_be_coarse = True
        self._jump = {"speed": teleport_speed, "turn_rate": teleport_turn_rate}
        self._on_teleport, self._on_time_jump = on_teleport, on_time_jump
        self._order = StampOrder(time_jump)
        self._keeps_time, self._looked = False, time.monotonic_ns()
        self._buffer = PoseBuffer()
        self._periods: deque[int] = deque(maxlen=_REMEMBERED)
        self._latency = 0.0
        self._messages = 0
        self._starts_anew = True
        self._carries = self._is_unsteady = False
        self._jumped = -_UNSTEADY
        count = len(simulation.collider_set)
        self._now, self._next = ColliderPoses.identity(count), ColliderPoses.identity(count)

    @classmethod
    def with_parameters(
        cls, simulation: Simulation, p: ClothNodeParameters, **others: Any
    ) -> "ClothStepper":
        """As the node's parameters have it, with single ones replaced by others."""
        values = {
            "step": p.solver_step,
            "delay": p.delay,
            "catch_up": p.catch_up,
            "teleport_speed": p.teleport_speed,
            "teleport_turn_rate": p.teleport_turn_rate,
            "on_teleport": p.on_teleport,
            "time_jump": p.time_jump,
            "on_time_jump": p.on_time_jump,
            "longest_lag": p.longest_lag,
        }
        return cls(simulation, **{**values, **others})

    def add(
        self, stamp: int, poses: ColliderPoses, arrival: int, *, new_sender: bool = False
    ) -> None:
        """Take poses over.

        Args:
            stamp: Their time [ns].
            poses: World poses of all colliders.
            arrival: When they came, on a clock that only runs forward [ns].
            new_sender: Whether they are another sender's than those before: no way leads from one
                to the other.

        Raises:
            MessageError: They do not fit the colliders, or the poses before; nothing changes.
        """
        expected = len(self.simulation.collider_set)
        if len(poses.position) != expected:
            raise MessageError(
                POSE_COUNT, f"found {len(poses.position)} poses; allowed: {expected}"
            )
        before = self._order.newest
        if new_sender:
            self._order.begin(stamp)
        if self._keeps_time:
            self._attend()
        anew = new_sender or self._order.accept(stamp)
        puts_on = anew
        if before is not None and not anew:
            self._periods.append(stamp - before)
            newest = self._buffer.newest[1]
            root = self.simulation.collider_set.root
            past = (stamp - before) / SECOND
            if has_jumped(newest, poses, past, root=root, **self._jump):
                self.teleports += 1
                anew = puts_on = self._on_teleport == "reset"
                self._is_unsteady = stamp - self._jumped < _UNSTEADY
                self._jumped = stamp
                if self._on_teleport == "keep":
                    self._carries = True
                    self._buffer.clear()
        elif before is not None:
            # Jumps of the time before say nothing of this one.
            self._is_unsteady, self._jumped = False, stamp - _UNSTEADY
            # A loop shorter than putting on takes would never show garments put on anew each time.
            if not new_sender and (self._on_time_jump == "keep" or self.is_behind):
                self._carries, puts_on = True, False
        if anew:
            self._starts_anew = self._starts_anew or puts_on
            self._periods.clear()
            self._buffer.clear()
        self._buffer.add(stamp, poses)
        # Neither time nor clock need be those of the messages before.
        if anew or abs(arrival - stamp - self._latency) > SECOND:
            self._messages = 0
        self._messages += 1
        window = max(_FEWEST, _LATENCY_WINDOW / max(self.period, 1))
        self._latency += (arrival - stamp - self._latency) / min(self._messages, window)

    def figures(self) -> dict[str, object]:
        """What goes to diagnostics."""
        return {
            "resets": self.resets,
            "teleports": self.teleports,
            "time_jumps": self._order.jumps,
            "lag_s": self.lag / SECOND,
            "coarse_s": self.coarse / SECOND,
            "skipped_s": self.skipped / SECOND,
            "input_period_ms": 1e3 * self.period / SECOND,
            "solver_steps": self.steps,
        }

    @property
    def period(self) -> int:
        """Time between the latest poses [ns]; 0 while unknown."""
        return int(median(self._periods)) if self._periods else 0

    @property
    def newest(self) -> int:
        """Stamp of the newest poses [ns]."""
        return self._buffer.newest[0]

    @property
    def has_poses(self) -> bool:
        """Whether any poses have come."""
        return len(self._buffer) > 0

    @property
    def poses(self) -> ColliderPoses:
        """World poses of the colliders at `time`; the next `advance` overwrites them."""
        return self._now

    def restart(self) -> None:
        """Put the garments on anew at the next `advance`."""
        self._starts_anew = True

    def never_coarse(self) -> None:
        """From now on somebody else sees to it that garments that lag behind cost less."""
        self._may_be_coarse = False

    def due(self, until: int) -> int:
        """How many steps there are up to a time [ns]."""
        return 0 if self.time is None else (until - self.time) // self._step

    def target(self, now: int) -> int:
        """The time to simulate up to when it is `now` on the clock of arrivals [ns].

        It lies `delay` behind the time that stamps have now. That runs evenly, whatever the rate
        and the jitter of messages; but the target is never beyond the newest of them.
        """
        self._keeps_time = True
        self._attend()
        return min(self._buffer.newest[0], self._wanted(now))

    def ahead(self, then: int) -> int | None:
        """The time to simulate up to ahead of a frame, `then` on the clock of arrivals [ns].

        None where no poses for it are there yet, or more than steps is to be done.
        """
        begins_anew = self._starts_anew or self._carries or self.is_behind or self._is_late
        if self.time is None or not self.has_poses or begins_anew:
            return None
        until = min(self._buffer.newest[0], self._wanted(then))
        return until if 0 < self.due(until) <= self._most_steps else None

    def _wanted(self, now: int) -> int:
        """The time of stamps, less `delay`, when it is `now` on the clock of arrivals [ns]."""
        delay = self.period if self.delay < 0.0 else round(self.delay * SECOND)
        return int(now - self._latency) - delay

    def _attend(self) -> None:
        """Look; after a while without, no gap is a jump. A clock that is set tells nothing."""
        now = time.monotonic_ns()
        if now - self._looked > AWAY:
            self._order.excuse_gap(now - self._looked)
        self._looked = now

    def advance(self, until: int, *, in_time: bool = True) -> bool:
        """Simulate whole steps up to a time.

        Args:
            until: The time [ns].
            in_time: Whether to take no more steps than `catch_up` allows. Where more are due they
                are coarse, then they come later, up to the longest lag, then time is passed over.

        Returns:
            Whether the garments moved.
        """
        if not self.has_poses:
            return False
        if self._waits(self._buffer.newest[0]):
            self._take_along(*self._buffer.newest)
            return True
        if self._starts_anew or self.time is None:
            self._put_on(*self._buffer.newest)
            if in_time:
                # Settling took a while, in which no messages were taken.
                self._order.excuse_gap()
            self.is_behind, self._frames_left = in_time, None
            return True
        if self._carries:
            self._take_along(*self._buffer.newest)
            return True
        steps = self.due(until)
        self.is_behind = self.is_behind and in_time
        if self.is_behind:
            steps = self._catch_up(steps)
        if steps <= 0:
            return False
        over, taken = self._divide(steps) if in_time else (0, steps)
        parts = min(_PARTS, taken) if over else 1
        for part in range(parts):
            self._pass_over(_share(over, part, parts))
            self._simulate(_share(taken, part, parts), coarse=in_time and self._is_late)
        self._buffer.forget_before(self.time)
        return True

    def _waits(self, stamp: int) -> bool:
        """Whether putting on has to wait: poses that jump again and again are no body's."""
        if self.time is None or not (self._starts_anew and self._is_unsteady):
            return False
        return stamp - self._jumped < _STEADY

    def _put_on(self, stamp: int, poses: ColliderPoses) -> None:
        self.resets += self.time is not None
        self.simulation.reset(poses)
        self.time = stamp
        self._now = poses.copy()
        self._starts_anew = self._carries = False

    def _catch_up(self, steps: int) -> int:
        """Steps of so many that a frame takes after garments were put on.

        None of that time is passed over: limbs that moved on would be carried into the cloth.
        """
        if self._frames_left is None:
            self._frames_left = _CATCHING_UP * -(-steps // self._most_steps)
            self._least_due, self._in_vain = steps + 1, 0
        self._frames_left -= 1
        self._in_vain = 0 if steps < self._least_due else self._in_vain + 1
        self._least_due = min(self._least_due, steps)
        goes_on = self._frames_left > 0 and self._in_vain < _IN_VAIN
        self.is_behind = steps > self._most_steps and goes_on
        return self._most_steps if self.is_behind else steps

    def _divide(self, steps: int) -> tuple[int, int]:
        """Of so many steps that are due: those to pass over, and those to simulate now.

        What is left comes later: the garments lag behind, and catch up in the next frames. Where
        that takes long the machine is too slow for it, and less and less lag is allowed.
        """
        taken = min(steps, self._most_steps)
        left = steps - taken
        self._is_late = left > 0 or (self._is_late and steps > self._most_steps // 2)
        self._late_steps = self._late_steps + taken if self._is_late else 0
        allowed = max(0, self._most_lag - self._late_steps // 2)
        over = max(0, left - allowed)
        self.lag = (left - over) * self._step
        return over, taken

    def _simulate(self, steps: int, *, coarse: bool) -> None:
        """Take so many steps, as many at once as the simulation does."""
        assert self.time is not None
        most = max(1, round(self.simulation.solver_step * SECOND / self._step))
        coarse = coarse and self._may_be_coarse
        while steps > 0:
            at_once = min(steps, max(most, _COARSE) if coarse else most)
            steps -= at_once
            self.time += at_once * self._step
            self._buffer.at(self.time, self._next)
            self._move(at_once, coarse=coarse)

    def _take_along(self, stamp: int, poses: ColliderPoses) -> None:
        """Take the garments along on a jump; time until then is passed over."""
        self.simulation.transport(self._now, poses)
        self.time = stamp
        self._now = poses.copy()
        self._carries = self.is_behind = False

    def _pass_over(self, steps: int) -> None:
        """Take the garments along for some steps without simulating."""
        assert self.time is not None
        if not steps:
            return
        self.skipped += steps * self._step
        self.time += steps * self._step
        self._buffer.at(self.time, self._next)
        self.simulation.transport(self._now, self._next)
        self._now, self._next = self._next, self._now

    def _move(self, steps: int, *, coarse: bool) -> None:
        time = steps * self._step / SECOND
        if coarse and steps > 1:
            self.simulation.advance_coarsely(self._now, self._next, time, _COARSE)
            self.coarse += steps * self._step
        else:
            self.simulation.advance(self._now, self._next, time)
        self._now, self._next = self._next, self._now
        self.steps += steps


def _share(whole: int, part: int, parts: int) -> int:
    """How many of `whole` things belong to a part, spread evenly."""
    return (part + 1) * whole // parts - part * whole // parts
