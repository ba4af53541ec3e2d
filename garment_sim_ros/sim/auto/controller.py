"""Which level a frame is run at: falls at once where frames take too long, climbs slowly.

Frames over the budget fill a bucket that leaks. Two in a short time make it overflow: the level
falls to where the mean of them would have fitted, by the levels' costs. It climbs by one after a
time of patience in which the frames would have fitted there, too. A climb that was in vain
doubles the patience for that level, one that held halves it: a level that is out of reach is
seldom tried. So there is never less than the least patience between a fall and the climb after it,
nor between two climbs.

Nothing here knows a clock: the same frames give the same levels.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

MEMORY = 1.0
"""Frames over the budget are forgotten by a factor of e in this time [s]."""
PATIENCE = 1.0, 60.0
"""Shortest and longest time before a climb [s]."""
_IN_VAIN = 5.0
"""A fall within this time after a climb shows that it was in vain [s], or within its patience."""
_OVERFLOW = 1.5
_TOLERATED, _FULL = 0.5, 2.0
"""What the bucket of the next level may hold at a climb, and at most."""
_MARGIN = 1.1
"""The next level is expected to take so many times what costs say."""
_UNCOUNTED = 2
"""Frames after a change that do not count: they prepare."""
_DEEP = 2.0
"""A frame that takes so many budgets counts twice."""


class Change(NamedTuple):
    """A change of the level.

    Attributes:
        before: Level before.
        after: Level after.
        cause: Why, in words.
    """

    before: int
    after: int
    cause: str


class Controller:
    """Chooses a level frame by frame.

    Args:
        costs: What a frame costs at each level, rising [any unit].
        budget: Longest time that a frame may take [ms].
        rate: Of the frames [Hz].
        start: Level at first.
        shelter: Level that it falls to where the cloth is behind, unless it is there or lower.

    Attributes:
        level: The level now.
        budget: As given; may be set.
        patience: Time that it waits before a climb to each level [s].
    """

    def __init__(
        self, costs: Sequence[float], budget: float, rate: float, start: int, shelter: int = 0
    ) -> None:
        self.level = start
        self.budget = budget
        self.patience = [PATIENCE[0]] * len(costs)
        self._costs = tuple(costs)
        self._rate, self._shelter = rate, shelter
        self._keep = math.exp(-1.0 / (MEMORY * rate))
        self._since_change = 0
        self._climbed = False
        self._over = self._would = self._excess = 0.0
        self._frames_over = 0

    def frame(self, work: float, waited: float = 0.0, *, behind: bool = False) -> Change | None:
        """Take a frame's times; the level after it may be another one.

        Args:
            work: How long the frame was worked at [ms]; costs tell how much it would have been.
            waited: How long after it was due that began [ms]; no level changes it.
            behind: Whether more is due than a frame's time.
        """
        self._since_change += 1
        if behind and self.level > 0:
            lowest = self._shelter if self.level > self._shelter else 0
            return self._fall(lowest, "the cloth is behind")
        if self._since_change <= _UNCOUNTED:
            return None
        took = waited + work
        self._count(work, waited)
        if self._over > _OVERFLOW and self.level > 0:
            mean = self._excess / self._frames_over
            fits = [n for n in range(self.level) if mean * self._ratio(n) <= self.budget]
            cause = f"frames take {took:.3g} ms of {self.budget:.3g} ms"
            return self._fall(max(fits, default=0), cause)
        if self.level + 1 < len(self._costs) and self._is_calm():
            return self._climb()
        return None

    def _count(self, work: float, waited: float) -> None:
        """Fill the buckets of this level and of the next one."""
        took = waited + work
        self._over *= self._keep
        if took > self.budget:
            self._over += 2.0 if took > _DEEP * self.budget else 1.0
            self._excess += took
            self._frames_over += 1
        elif self._over < 0.1:
            self._excess, self._frames_over = 0.0, 0
        above = min(self.level + 1, len(self._costs) - 1)
        would = waited + work * self._ratio(above) * _MARGIN > self.budget
        self._would = min(_FULL, self._would * self._keep + would)

    def _is_calm(self) -> bool:
        waited = self._since_change >= self.patience[self.level + 1] * self._rate
        return waited and self._would <= _TOLERATED

    def _climb(self) -> Change:
        if self._climbed:
            self.patience[self.level] = max(PATIENCE[0], 0.5 * self.patience[self.level])
        self._climbed = True
        cause = f"calm for {self._since_change / self._rate:.3g} s"
        return self._become(self.level + 1, cause)

    def _fall(self, level: int, cause: str) -> Change:
        patience = self.patience[self.level]
        if self._climbed and self._since_change <= max(_IN_VAIN, patience) * self._rate:
            self.patience[self.level] = min(PATIENCE[1], 2.0 * patience)
        self._climbed = False
        return self._become(level, cause)

    def _become(self, level: int, cause: str) -> Change:
        change = Change(self.level, level, cause)
        self.level = level
        self._since_change = 0
        self._over = self._would = self._excess = 0.0
        self._frames_over = 0
        return change

    def _ratio(self, level: int) -> float:
        """What a frame would cost at a level, over what it costs at this one."""
        return self._costs[level] / self._costs[self.level]
