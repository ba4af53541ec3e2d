"""The converged motion that others are compared with, restarted so that chaos stays small.

Cloth that buckles is chaotic: two runs that begin a rounding apart are centimetres apart seconds
later, whichever is better. So the motion is cut into segments. Each begins where the reference
ended the one before, and what is compared is what comes of that within the segment.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.solver_params import SPRINGS
from garment_sim_ros.tradeoff.convergence import CHANGE, Track, unique_track
from garment_sim_ros.tradeoff.metrics import distance_mm, pierced, rest_speed_mm_s
from garment_sim_ros.tradeoff.playing import Player, Snapshot
from garment_sim_ros.tradeoff.points import Point
from garment_sim_ros.tradeoff.scenes import Staged

LONGEST = 0.5
"""Longest segment [s]."""
_FIRST, MOST = 60, 960
"""Sub-steps of the first try, and most of them, in 1/60 s."""
_DEFAULT = 18
_SEARCH_EVERY = 12
"""Sub-steps from one search for contacts to the next: each one moves cloth a little."""
_REST, _ROUNDS = 0.5, 8
"""The rest shape is then refined in at most so many rounds of so long [s]."""


@dataclass(frozen=True, kw_only=True)
class Reference:
    """A motion and what it comes to rest as.

    Attributes:
        starts: The segments' starts.
        paths: World positions by name as they are simulated [m], the start and after each frame,
            shape [f + 1, v, 3].
        sub_steps: Of each segment, in a frame.
        changes: By how much the last doubling changed each segment [mm].
        chaos: By how much each segment changes where its start is shaken [mm].
        rest: Positions at rest by name [m], shape [v, 3]; empty where nothing comes to rest.
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
    def segments(self) -> list[tuple[int, int]]:
        """First and last frame of each segment."""
        firsts = [start.frame for start in self.starts]
        frames = len(next(iter(self.paths.values()))) - 1
        return list(zip(firsts, [*firsts[1:], frames]))

    @property
    def doubts(self) -> tuple[float, ...]:
        """Of each segment the last doubling's change or its chaos, what is more [mm]."""
        return tuple(np.maximum(self.changes, self.chaos).tolist())

    @property
    def doubt(self) -> float:
        """Their RMS over all frames [mm]."""
        frames = [last - first for first, last in self.segments]
        return float(np.sqrt(np.average(np.square(self.doubts), weights=frames)))

    @property
    def converged(self) -> bool:
        """Whether every segment is."""
        return self.over == 0

    @property
    def over(self) -> int:
        """How many segments are not."""
        return sum(not doubt < CHANGE for doubt in self.doubts)

    def told(self) -> dict[str, object]:
        """What is reported of it."""
        return {
            "converged": self.converged,
            "doubt_mm": float(f"{self.doubt:.3g}") if np.isfinite(self.doubt) else None,
            "segments": [last - first for first, last in self.segments],
            "over": self.over,
            "sub_steps": list(self.sub_steps),
            "changes_mm": [_told(c) for c in self.changes],
            "chaos_mm": [_told(c) for c in self.chaos],
            "rest_moved_mm": _told(self.rest_moved),
            "rest_speed_mm_s": _told(self.rest_speed),
            "pierced": _told(self.pierced),
        }

    def save(self, file: Path) -> None:
        """Write it to an .npz file."""
        names = list(self.paths)
        arrays = {
            "names": np.array(names),
            "frames": np.array([s.frame for s in self.starts]),
            "sub_steps": np.array(self.sub_steps),
            "changes": np.array(self.changes),
            "chaos": np.array(self.chaos),
            "numbers": np.array([self.rest_moved, self.rest_speed, self.pierced]),
        }
        for n in names:
            arrays[f"path_{n}"] = self.paths[n]
            if self.rest:
                arrays[f"rest_{n}"] = self.rest[n]
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
                rows = {k: [held[f"{k}_{n}"] for n in names] for k in ("x", "v", "path")}
                frames = held["frames"].tolist()
                rest = {n: held[f"rest_{n}"] for n in names if f"rest_{n}" in held}
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
                    rest=rest,
                    sub_steps=tuple(held["sub_steps"].tolist()),
                    changes=tuple(held["changes"].tolist()),
                    chaos=tuple(held["chaos"].tolist()),
                    rest_moved=moved,
                    rest_speed=speed,
                    pierced=through,
                )
        except (OSError, ValueError, KeyError, BadZipFile):
            return None


def _told(value: float) -> float | None:
    return round(value, 4) if np.isfinite(value) else None


def reference(staged: Staged, most: int = MOST, membrane: str = SPRINGS) -> Reference:
    """The reference of a scene: `xpbd` with so many sub-steps that more change little.

    Args:
        staged: The scene.
        most: Most sub-steps in 1/60 s.
        membrane: What resists strain in the plane.
    """
    per = staged.scene.frame * 60.0
    usual, counts = round(_DEFAULT * per), (round(_FIRST * per), most * per)

    @cache
    def player(sub_steps: int) -> Player:
        made = _player(staged, sub_steps, membrane)
        made.put_on(settle=sub_steps == usual)
        return made

    at = player(usual).snapshot(0)
    longest = window = max(1, round(LONGEST / staged.scene.frame))
    tracks: list[Track] = []
    while at.frame < staged.frames:
        tracks.append(unique_track(player, at, min(window, staged.frames - at.frame), counts))
        window = min(longest, 2 * (len(tracks[-1].states) - 1))
        at = tracks[-1].states[-1]
    states = [state for track in tracks for state in track.states[:-1]] + [at]
    paths = {name: np.array([state.x[name] for state in states]) for name in at.x}
    rest, moved, speed = _rest(staged, at, tracks[-1].sub_steps, membrane)
    return Reference(
        starts=tuple(track.states[0] for track in tracks),
        paths=paths,
        sub_steps=tuple(track.sub_steps for track in tracks),
        changes=tuple(track.change for track in tracks),
        chaos=tuple(track.chaos for track in tracks),
        rest=rest,
        rest_moved=moved,
        rest_speed=speed,
        pierced=pierced(staged, paths),
    )


def _player(staged: Staged, sub_steps: int, membrane: str) -> Player:
    point = Point(
        kind="",
        solver="xpbd",
        sub_steps=sub_steps,
        passes=1,
        membrane=membrane,
        options=(("search_every", _SEARCH_EVERY),),
    )
    return Player(staged, point.arguments(staged.scene.frame))


def _rest(
    staged: Staged, at: Snapshot, sub_steps: int, membrane: str
) -> tuple[dict[str, SingleArray], float, float]:
    """The shape at rest [m], how far it still moved [mm], and its speed [mm/s]; nan in gusts."""
    if not staged.scene.rests:
        return {}, np.nan, np.nan
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
        paths = fine.play(end, end + max(12, round(_REST / dt))).simulated
        then, now = now, fine.snapshot(end)
        moved = distance_mm(then.x, now.x)
        if moved < 0.5 * CHANGE:
            break
    return now.x, moved, rest_speed_mm_s(paths, dt)
