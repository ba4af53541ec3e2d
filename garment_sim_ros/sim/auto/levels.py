"""The points of the front that `auto` moves between, from the cheapest to the most accurate.

All are settings of `xpbd` on the same colliders and with the same fabric. They differ in
sub-steps and in searches for contacts, which is what a frame's time goes into; more passes over
the edges are beaten by more sub-steps. The lowest has fewer vertices, too, and folds: vertices and
solver of the preset `fast`. Nothing below it is known to be safe. Which is more accurate does not
depend on the machine; what each costs does, see `own_front`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from garment_sim_ros.params import XpbdSettings

FRAME = 1 / 60
"""What sub-steps are counted in [s]."""


@dataclass(frozen=True, kw_only=True)
class Level:
    """One point.

    Attributes:
        name: As tables have it.
        sub_steps: In 1/60 s.
        search_every: See `XpbdSettings`.
        cost: Time of a frame over that of `balanced`.
        detail: Share of the vertices that are simulated.
    """

    name: str
    sub_steps: int
    search_every: int
    cost: float
    detail: float = 1.0

    def settings(self, base: XpbdSettings) -> XpbdSettings:
        """Settings as they are, but for what this level moves."""
        return replace(base, sub_step=FRAME / self.sub_steps, search_every=self.search_every)


LEVELS: tuple[Level, ...] = (
    Level(name="fast", sub_steps=9, search_every=9, cost=0.43, detail=0.25),
    Level(name="9", sub_steps=9, search_every=9, cost=0.64),
    Level(name="12", sub_steps=12, search_every=12, cost=0.66),
    Level(name="18", sub_steps=18, search_every=18, cost=0.75),
    Level(name="18, 2 searches", sub_steps=18, search_every=9, cost=0.89),
    Level(name="balanced", sub_steps=18, search_every=6, cost=1.0),
    Level(name="27", sub_steps=27, search_every=9, cost=1.14),
    Level(name="36, 3 searches", sub_steps=36, search_every=12, cost=1.4),
    Level(name="accurate", sub_steps=54, search_every=18, cost=1.72),
)
"""What `garment-sim tradeoff --calibrate` measured where this was written."""
START = "balanced"
"""The level that is taken at first."""
MOVED = ("sub_step", "search_every", "iterations")
"""Parameters that `auto` moves, or that its levels have in common."""


def with_costs(costs: Sequence[float]) -> tuple[Level, ...]:
    """The levels that are worth their costs: none that a more accurate one costs as little as.

    The lowest and the first one stay, so that there is a floor and a start.

    Args:
        costs: Of all `LEVELS` [any unit].
    """
    start = next(level.name for level in LEVELS if level.name == START)
    unit = costs[[level.name for level in LEVELS].index(start)]
    kept = []
    for number, (level, cost) in enumerate(zip(LEVELS, costs)):
        is_beaten = any(cost >= other for other in costs[number + 1 :])
        if not is_beaten or number == 0 or level.name == START:
            kept.append(replace(level, cost=cost / unit))
    return tuple(kept)
