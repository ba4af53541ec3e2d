"""The converged motion that others are compared with, restarted so that chaos stays small.

Cloth that buckles is chaotic: two runs that begin a rounding apart are centimetres apart seconds
later, whichever is better. So the motion is cut into segments. Each begins where the reference
ended the one before, and what is compared is what comes of that within the segment.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.solver_params import SPRINGS
from garment_sim_ros.tradeoff.metrics import distance_mm, pierced, rest_speed_mm_s
from garment_sim_ros.tradeoff.playing import Player, Snapshot
from garment_sim_ros.tradeoff.points import Point
from garment_sim_ros.tradeoff.scenes import Staged

SEGMENT = 0.5
"""Length of a segment [s]."""
CHANGE = 0.1
"""It is converged where twice as many sub-steps change it by less than this [mm]."""
_FIRST, MOST = 60, 960
"""Sub-steps of the first try, and most of them, in 1/60 s."""
SHAKEN = 1e-6
"""RMS of what the starts are off by, in each direction, to see how chaotic a segment is [m]."""
_DEFAULT = 18
_REST, _ROUNDS = 0.5, 8
"""The rest shape is then refined in at most so many rounds of so long [s]."""


@dataclass(frozen=True, kw_only=True)
class Reference:
    """A motion and what it comes to rest as.

    Attributes:
        starts: The segments' starts.
        paths: World positions by name [m], the start and after each frame, shape [f + 1, v, 3].
        sub_steps: Of each segment, in a frame.
        changes: By how much the last doubling changed each segment [mm].
        chaos: By how much each segment changes where its start is off by `SHAKEN` [mm].
        rest: Positions at rest by name [m], shape [v, 3].
        rest_moved: How far that shape still moved in its last half second [mm].
        rest_speed: RMS speed there [mm/s].
        pierced: Share of its frames in which a body part runs through a garment.
    """

    starts: tuple[Snapshot, ...]
    paths: dict[str, SingleArray]
    sub_steps: tuple[int, ...]
    changes: tuple[float, ...]
    chaos: tuple[float, ...]
    rest: dict[str, SingleArray]
    rest_moved: float
    rest_speed: float
    pierced: float

    @property
    def converged(self) -> bool:
        """Whether every segment is."""
        return max(self.changes) < CHANGE

    def told(self) -> dict[str, object]:
        """What is reported of it."""
        return {
            "converged": self.converged,
            "sub_steps": list(self.sub_steps),
            "changes_mm": [round(c, 4) if np.isfinite(c) else None for c in self.changes],
            "chaos_mm": [round(c, 4) for c in self.chaos],
            "rest_moved_mm": round(self.rest_moved, 4),
            "rest_speed_mm_s": round(self.rest_speed, 3),
            "pierced": round(self.pierced, 4),
        }

    def save(self, file: Path) -> None:
        """Write it to an .npz file."""
        names = list(self.rest)
        arrays = {
            "names": np.array(names),
            "frames": np.array([s.frame for s in self.starts]),
            "sub_steps": np.array(self.sub_steps),
            "changes": np.array(self.changes),
            "chaos": np.array(self.chaos),
            "numbers": np.array([self.rest_moved, self.rest_speed, self.pierced]),
        }
        for n in names:
            arrays |= {f"path_{n}": self.paths[n], f"rest_{n}": self.rest[n]}
            arrays[f"x_{n}"] = np.array([s.x[n] for s in self.starts])
            arrays[f"v_{n}"] = np.array([s.v[n] for s in self.starts])
        partial = file.with_name(f".{file.name}")
        with partial.open("wb") as out:
            np.savez_compressed(out, **arrays)  # type: ignore[arg-type]
        partial.replace(file)

    @classmethod
    def load(cls, file: Path) -> "Reference | None":
        """What `save` wrote; None where that is not there or damaged."""
        try:
            with np.load(file) as held:
                names = held["names"].tolist()
                rows = {k: [held[f"{k}_{n}"] for n in names] for k in ("x", "v", "path", "rest")}
                frames = held["frames"].tolist()
                moved, speed, through = held["numbers"].tolist()
                return cls(
                    starts=tuple(
                        Snapshot(
                            frame=frame,
                            x={n: x[k] for n, x in zip(names, rows["x"])},
                            v={n: v[k] for n, v in zip(names, rows["v"])},
                        )
                        for k, frame in enumerate(frames)
                    ),
                    paths=dict(zip(names, rows["path"])),
                    rest=dict(zip(names, rows["rest"])),
                    sub_steps=tuple(held["sub_steps"].tolist()),
                    changes=tuple(held["changes"].tolist()),
                    chaos=tuple(held["chaos"].tolist()),
                    rest_moved=moved,
                    rest_speed=speed,
                    pierced=through,
                )
        except (OSError, ValueError, KeyError, BadZipFile):
            return None


def segments(staged: Staged) -> list[tuple[int, int]]:
    """First and last frame of each segment."""
    length = max(1, round(SEGMENT / staged.scene.frame))
    starts = range(0, staged.frames, length)
    return [(first, min(first + length, staged.frames)) for first in starts]


def reference(
    staged: Staged, most: int = MOST, change: float = CHANGE, membrane: str = SPRINGS
) -> Reference:
    """The reference of a scene: `xpbd` with so many sub-steps that more change little.

    Args:
        staged: The scene.
        most: Most sub-steps in 1/60 s.
        change: It is converged where a doubling changes it by less [mm].
        membrane: What resists strain in the plane.
    """
    per = staged.scene.frame * 60.0
    player = _player(staged, round(_DEFAULT * per), membrane)
    player.put_on(settle=True)
    at = player.snapshot(0)
    starts, parts, counts, changes, chaos = [], [], [], [], []
    for first, last in segments(staged):
        starts.append(at)
        path, count, moved, at = _converged(
            lambda n: _player(staged, n, membrane),
            at,
            (first, last),
            (round(_FIRST * per), most * per),
            change,
        )
        chaos.append(_chaos(_player(staged, count, membrane), starts[-1], (first, last), path))
        parts.append({name: x[:-1] if last < staged.frames else x for name, x in path.items()})
        counts.append(count)
        changes.append(moved)
    paths = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    rest, rest_moved, speed = _rest(staged, at, counts[-1], membrane)
    return Reference(
        starts=tuple(starts),
        paths=paths,
        sub_steps=tuple(counts),
        changes=tuple(changes),
        chaos=tuple(chaos),
        rest=rest,
        rest_moved=rest_moved,
        rest_speed=speed,
        pierced=pierced(staged, paths),
    )


def _player(staged: Staged, sub_steps: int, membrane: str) -> Player:
    point = Point(kind="", solver="xpbd", sub_steps=sub_steps, passes=1, membrane=membrane)
    return Player(staged, point.arguments(staged.scene.frame))


def _converged(
    make: Callable[[int], Player],
    at: Snapshot,
    frames: tuple[int, int],
    counts: tuple[int, float],
    change: float,
) -> tuple[dict[str, SingleArray], int, float, Snapshot]:
    """Path, sub-steps, last change [mm] and end of one segment.

    Where single precision or chaos has the change grow again, that with the least change is it.
    """
    count, most = counts
    path: dict[str, SingleArray] = {}
    best: tuple[dict[str, SingleArray], int, float, Snapshot] | None = None
    while True:
        player = make(count)
        player.put_on(settle=False)
        player.begin(at)
        finer = player.play(*frames).paths
        moved = distance_mm(path, finer) if path else np.inf
        if best is None or moved < best[2]:
            best = finer, count, moved, player.snapshot(frames[1])
        if best[2] < change or 2 * count > most:
            return best
        path = finer
        count *= 2


def _chaos(
    player: Player, at: Snapshot, frames: tuple[int, int], path: dict[str, SingleArray]
) -> float:
    """How far a segment ends up from its path [mm] when its start is a little off."""
    rng = np.random.default_rng(0)
    x = {
        name: (x + SHAKEN * rng.standard_normal(x.shape)).astype(np.float32)
        for name, x in at.x.items()
    }
    player.put_on(settle=False)
    player.begin(Snapshot(frame=at.frame, x=x, v=at.v))
    return distance_mm(player.play(*frames).paths, path)


def _rest(
    staged: Staged, at: Snapshot, sub_steps: int, membrane: str
) -> tuple[dict[str, SingleArray], float, float]:
    """The shape at rest [m], how far it still moved [mm], and its speed [mm/s]."""
    dt, end = staged.scene.frame, staged.frames
    rough = _player(staged, round(_DEFAULT * dt * 60.0), membrane)
    rough.put_on(settle=False)
    rough.begin(at)
    rough.play(end, end + staged.still_frames)
    fine, now = _player(staged, sub_steps, membrane), rough.snapshot(end)
    fine.put_on(settle=False)
    for _ in range(_ROUNDS):
        for v in now.v.values():
            v[:] = 0.0  # what swings stops in the middle, sooner or later
        fine.begin(now)
        paths = fine.play(end, end + max(12, round(_REST / dt))).paths
        then, now = now, fine.snapshot(end)
        moved = distance_mm(then.x, now.x)
        if moved < 0.5 * CHANGE:
            break
    return now.x, moved, rest_speed_mm_s(paths, dt)
