"""What one feature costs and what it does: a preset's base and the other case in turns."""

from dataclasses import dataclass, field

import numpy as np

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.tradeoff.features import FEATURES, Case
from garment_sim_ros.tradeoff.metrics import (
    Paths,
    crossed_own,
    distances_mm,
    is_finite,
    worn_figures,
)
from garment_sim_ros.tradeoff.playing import Played, Player, Snapshot
from garment_sim_ros.tradeoff.runner import plain
from garment_sim_ros.tradeoff.scenes import Staged
from garment_sim_ros.tradeoff.table import Row

TURN = 0.5
"""Length of a turn [s]."""


@dataclass(kw_only=True)
class _Side:
    """One of the two cases, and what was seen of it.

    Attributes:
        case: The case.
        player: It, being simulated.
        start: Where each of its runs begins: on the first pose, settled.
        turns: Processor time of the frames of each turn [s].
        parts: World positions in the turns of the last run.
        let_go: The most particles whose contact was dropped.
    """

    case: Case
    player: Player
    start: Snapshot
    turns: list[list[float]] = field(default_factory=list)
    parts: list[dict[str, SingleArray]] = field(default_factory=list)
    let_go: int = 0

    @classmethod
    def of(cls, case: Case) -> "_Side":
        """A case with its garments put on; all of it has been used once, so that it is compiled.

        Raises:
            GarmentSimError: It cannot be simulated.
        """
        player = case.player()
        player.put_on(settle=True)
        start = player.snapshot(0)
        player.play(0, min(2, case.staged.frames))
        return cls(case=case, player=player, start=start)

    def begin(self) -> None:
        """Go back to the start."""
        self.player.put_on(settle=False)
        self.player.begin(self.start)
        self.parts = []

    def take(self, played: Played) -> None:
        """Keep what was seen in a turn."""
        self.turns.append(played.processor)
        self.parts.append(played.paths)
        self.let_go = max(self.let_go, *played.let_go)

    @property
    def paths(self) -> Paths:
        """World positions at the start and after each frame of the last run, by name [m]."""
        last = len(self.parts) - 1
        return {
            name: np.concatenate(
                [part[name][: None if k == last else -1] for k, part in enumerate(self.parts)]
            )
            for name in self.parts[0]
        }

    def figures(self) -> Row:
        """What its garments did; nothing where they are not finite."""
        paths = self.paths
        if not is_finite(paths):
            return {}
        staged = self.case.staged
        own = {"dropped": self.let_go, "mended": self.player.mended}
        through = {"crossed_own": crossed_own(staged, paths)}
        return {**worn_figures(staged, paths), **through, **own}


def priced(scene: str, preset: str, feature: str, seconds: float, repeats: int) -> Row:
    """One row of the price list.

    Args:
        scene: Name of the scene.
        preset: Name of the preset that is the base.
        feature: Name of the feature.
        seconds: Of the motion at most [s]; 0: all.
        repeats: How often the motion is run.

    Raises:
        ParameterError: There is no such scene or preset, or the scene's files are not there.
    """
    row: Row = {"scene": scene, "preset": preset, "feature": feature}
    base = Case.of(scene, preset, seconds)
    try:
        switched = FEATURES[feature].switch(base)
        if switched is None:
            return row | {"refused": "nothing to switch"}
        other, is_on = switched
        row["in_preset"] = "off" if is_on else "on"
        return row | price(*((base, other) if is_on else (other, base)), repeats)
    except GarmentSimError as error:
        return row | {"refused": " ".join(str(error).split())}


def price(off: Case, on: Case, repeats: int) -> Row:
    """Cost and effect of what is on in one case and off in the other.

    Both take turns of a segment each, and change who comes first; a frame's cost is paired with
    that of the same frame in the other case.

    Args:
        off: Without the feature.
        on: With it.
        repeats: How often the motion is run.

    Raises:
        GarmentSimError: One of the two cannot be simulated.
    """
    sides = [_Side.of(off), _Side.of(on)]
    for repeat in range(repeats):
        for side in sides:
            side.begin()
        for k, (first, last) in enumerate(_turns(off.staged)):
            for side in sides if (repeat + k) % 2 == 0 else sides[::-1]:
                side.take(side.player.play(first, last))
    figures = _cost(*(side.turns for side in sides))
    each = [side.figures() for side in sides]
    for which, found in zip(("off", "on"), each):
        figures |= {f"{name}_{which}": value for name, value in found.items()}
        figures[f"finite_{which}"] = bool(found)
    if all(each):
        apart = distances_mm(*(side.paths for side in sides))
        figures["moved_mm"] = float(np.percentile(apart, 95.0))
    return {name: plain(value) for name, value in figures.items()}


def _turns(staged: Staged) -> list[tuple[int, int]]:
    """First and last frame of each turn."""
    length = max(1, round(TURN / staged.scene.frame))
    starts = range(0, staged.frames, length)
    return [(first, min(first + length, staged.frames)) for first in starts]


def _cost(off: list[list[float]], on: list[list[float]]) -> Row:
    """Medians over the turns of medians over their frames, and what most turns lie between."""
    pairs = [(1e3 * np.array(a), 1e3 * np.array(b)) for a, b in zip(off, on)]
    more = [float(np.median(b - a)) for a, b in pairs]
    share = [float(np.median(b / a)) - 1.0 for a, b in pairs]
    return {
        "off_ms": float(np.median([np.median(a) for a, _ in pairs])),
        "on_ms": float(np.median([np.median(b) for _, b in pairs])),
        "cost_ms": float(np.median(more)),
        "cost_ms_p10": float(np.percentile(more, 10.0)),
        "cost_ms_p90": float(np.percentile(more, 90.0)),
        "cost_share": float(np.median(share)),
        "turns": len(pairs),
    }
