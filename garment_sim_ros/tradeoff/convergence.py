"""How long a motion is unique from where it starts: sub-steps doubled, and starts shaken.

Cloth that is pressed together buckles to whichever side rounding chooses, and from there two runs
part faster and faster. Half a second of a sheet that swings is unique to a tenth of a millimetre;
of garments on a body that walks a few frames are.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.tradeoff.metrics import distance_mm
from garment_sim_ros.tradeoff.playing import Player, Snapshot

CHANGE = 0.1
"""A motion is unique as long as the last doubling, or shaking, changes it by less [mm]."""
SHAKEN = 1e-6
"""RMS of what a start is off by when it is shaken, in each direction [m]."""


class Track(NamedTuple):
    """The motion from one start, as long as it is unique; one frame at least.

    Attributes:
        states: The start, and what there was after each frame.
        sub_steps: In a frame.
        change: RMS, over frames and vertices, of what the last doubling changed [mm].
        chaos: The same of what shaking the start changed [mm].
    """

    states: tuple[Snapshot, ...]
    sub_steps: int
    change: float
    chaos: float


def unique_track(
    make: Callable[[int], Player], start: Snapshot, frames: int, counts: tuple[int, float]
) -> Track:
    """Double sub-steps until the motion is unique in all frames; cut it where it stops being so.

    Of the numbers of sub-steps the one counts whose doubling was without effect for longest:
    rounding may have the change grow again.

    Args:
        make: What plays the scene with so many sub-steps in a frame, garments put on.
        start: Where it starts.
        frames: Most frames.
        counts: The first number of sub-steps, and the largest one.
    """
    count, most = counts
    states = best = _played(make(count), start, frames)
    taken, off = count, np.full(frames, np.inf)
    while 2 * count <= most and unique_frames(off) < frames:
        count *= 2
        before, states = states, _played(make(count), start, frames)
        moved = running_mm(before, states)
        if _rank(moved) > _rank(off):
            best, taken, off = states, count, moved
    shaken = running_mm(best, _played(make(taken), _shaken(start), frames))
    length = max(1, min(unique_frames(off), unique_frames(shaken)))
    change, chaos = float(off[length - 1]), float(shaken[length - 1])
    return Track(tuple(best[: length + 1]), taken, change, chaos)


def running_mm(here: Sequence[Snapshot], there: Sequence[Snapshot]) -> FloatArray:
    """RMS distance of two runs from one start up to each frame after it [mm], shape [f].

    Args:
        here: The start and what there was after each frame.
        there: The same of the other run.
    """
    squares = [distance_mm(a.x, b.x) ** 2 for a, b in zip(here, there)]
    return np.sqrt(np.cumsum(squares) / np.arange(1, len(squares) + 1))[1:]


def unique_frames(off: FloatArray) -> int:
    """So many frames from the first one on are off by less than `CHANGE`; not finite is more."""
    over = np.flatnonzero(~(off < CHANGE))
    return int(over[0]) if len(over) else len(off)


def _rank(off: FloatArray) -> tuple[int, float]:
    """Larger is better: for how many frames it is unique, then by how little that changes."""
    held = unique_frames(off)
    return held, -float(off[max(held, 1) - 1])


def _played(player: Player, start: Snapshot, frames: int) -> list[Snapshot]:
    player.begin(start)
    states = [start]
    for n in range(start.frame, start.frame + frames):
        player.play(n, n + 1)
        states.append(player.snapshot(n + 1))
    return states


def _shaken(start: Snapshot) -> Snapshot:
    """A start with every coordinate a little off."""
    rng = np.random.default_rng(0)
    x = {
        name: (x + SHAKEN * rng.standard_normal(x.shape)).astype(np.float32)
        for name, x in start.x.items()
    }
    return Snapshot(frame=start.frame, x=x, v=start.v)
