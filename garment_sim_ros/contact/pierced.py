"""Which body parts run through a garment: the measure of whether it is still worn.

A body part pierces a garment in a frame where its core (see `cores`) runs through one of the
garment's triangles. That is excused near where the motion presses two body parts into each other:
a hand inside the hip has cloth between the two, and cannot but run through it. Two parts that
overlap most of the time are neighbours, such as upper arm and shoulder, and excuse nothing.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.crossings import find_hits, overlaps
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import matrix_from_quaternion

NEAR = 0.06
"""How far along a core an overlap with another body part excuses [m]."""
_ALWAYS = 0.5
"""Share of the frames in which neighbours overlap."""
_MOST = 4096
"""Hits of one garment in a frame that are kept: more change nothing."""

Posed = Mapping[str, tuple[NDArray[np.floating], IntArray]]
"""World positions [m], shape [v, 3], and triangles, shape [t, 3], of garments by name."""


@dataclass(frozen=True, kw_only=True)
class Pierced:
    """What was found so far.

    Attributes:
        frames: Frames looked at.
        pierced: Frames in which a body part runs through a garment.
        by_garment: The same of each garment that has any.
        by_bone: The same of each garment and bone.
    """

    frames: int
    pierced: int
    by_garment: Mapping[str, int]
    by_bone: Mapping[str, Mapping[str, int]]

    @property
    def share(self) -> float:
        """Share of the frames, 0 where there are none."""
        return self.pierced / max(self.frames, 1)


@dataclass(frozen=True)
class _Hits:
    """Hits of one core and one garment in a frame that have the same excuses."""

    garment: str
    core: int
    excuses: tuple[int, ...]


class _Looker:
    """Looks at single frames; keeps how often which parts overlap."""

    def __init__(self, colliders: ColliderSet) -> None:
        self.cores = cores = Cores.of(colliders)
        shape = cores.same_bone.shape
        self._low, self._high = np.empty(shape), np.empty(shape)
        self._overlaps = np.zeros(shape, np.int64)
        self._core, self._at = np.empty(_MOST, np.int32), np.empty(_MOST)
        self.frames = 0

    def look(self, poses: ColliderPoses, garments: Posed) -> list[_Hits]:
        """The hits of one frame."""
        cores = self.cores
        ends = cores.posed(poses)
        overlaps(
            ends,
            poses.position[cores.solid_collider],
            matrix_from_quaternion(poses.orientation[cores.solid_collider]),
            cores.planes,
            cores.plane_start,
            cores.same_bone,
            self._low,
            self._high,
        )
        inside = self._low < self._high
        self._overlaps += inside
        self.frames += 1
        near = NEAR / np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 1e-9)
        found: list[_Hits] = []
        for name, (x, triangles) in garments.items():
            count = min(find_hits(ends, x, triangles, self._core, self._at), _MOST)
            for k in np.unique(self._core[:count]).tolist():
                at = self._at[:count][self._core[:count] == k, None]
                excused = (
                    inside[k] & (self._low[k] - near[k] <= at) & (at <= self._high[k] + near[k])
                )
                for excuses in sorted({tuple(np.flatnonzero(row).tolist()) for row in excused}):
                    found.append(_Hits(name, k, excuses))
        return found

    def is_pressed(self, core: int, at: int, but: Sequence[str]) -> bool:
        """Whether the motion presses an end of a core into a body part, in the latest frame.

        Args:
            core: The core.
            at: The end: 0 or 1.
            but: Bones that are no reason.
        """
        ends = self.cores.ends[core]
        near = NEAR / max(float(np.linalg.norm(ends[1] - ends[0])), 1e-9)
        low, high = self._low[core], self._high[core]
        inside = (low < high) & (low - near <= at) & (at <= high + near)
        pressed = inside & (self._overlaps[core] <= _ALWAYS * self.frames)
        return any(self.cores.solid_bone[s] not in but for s in np.flatnonzero(pressed))

    def counts(self, hits: _Hits) -> bool:
        """Whether hits have no excuse, by the frames so far."""
        always = _ALWAYS * self.frames
        return all(self._overlaps[hits.core, s] > always for s in hits.excuses)


class PiercedMeter:
    """Counts, over frames, the body parts that run through garments.

    Which parts are neighbours is decided by all frames, also by those after a hit.

    Args:
        colliders: The body's colliders.
    """

    def __init__(self, colliders: ColliderSet) -> None:
        self._looker = _Looker(colliders)
        self._found: list[list[_Hits]] = []

    def add(self, poses: ColliderPoses, garments: Posed) -> None:
        """Look at one frame.

        Args:
            poses: World poses of the colliders.
            garments: World positions [m], shape [v, 3], and triangles, shape [t, 3], by name.
        """
        self._found.append(self._looker.look(poses, garments))

    def result(self) -> Pierced:
        """What was found in all frames so far."""
        frames: dict[str, dict[str, set[int]]] = defaultdict(lambda: defaultdict(set))
        for frame, found in enumerate(self._found):
            for hits in filter(self._looker.counts, found):
                frames[hits.garment][self._looker.cores.bone[hits.core]].add(frame)
        by_garment = {name: set[int]().union(*bones.values()) for name, bones in frames.items()}
        return Pierced(
            frames=len(self._found),
            pierced=len(set[int]().union(*by_garment.values())),
            by_garment={name: len(found) for name, found in by_garment.items()},
            by_bone={n: {b: len(k) for b, k in bones.items()} for n, bones in frames.items()},
        )


class PiercedSoFar:
    """The same while frames come, in a fixed amount of memory.

    Each frame is judged once, when it comes: which parts are neighbours is decided by the frames
    up to it.

    Args:
        colliders: The body's colliders.
        names: Names of the garments.

    Attributes:
        now: Bones that run through each garment in the latest frame.
        cores_now: The cores that do, as rows of `posed_cores`.
    """

    def __init__(self, colliders: ColliderSet, names: Sequence[str]) -> None:
        self._looker = _Looker(colliders)
        self._garments: Counter[str] = Counter()
        self._any = 0
        self.now: dict[str, tuple[str, ...]] = dict.fromkeys(names, ())
        self.cores_now: dict[str, tuple[int, ...]] = dict.fromkeys(names, ())

    def add(self, poses: ColliderPoses, garments: Posed) -> None:
        """Look at one frame; see `PiercedMeter.add`."""
        looker = self._looker
        through: dict[str, set[int]] = {name: set() for name in self.now}
        for hits in filter(looker.counts, looker.look(poses, garments)):
            through[hits.garment].add(hits.core)
        self.cores_now = {name: tuple(sorted(cores)) for name, cores in through.items()}
        bone = looker.cores.bone
        self.now = {name: tuple(sorted({bone[k] for k in c})) for name, c in through.items()}
        self._garments.update(name for name, cores in through.items() if cores)
        self._any += any(through.values())

    def posed_cores(self, poses: ColliderPoses) -> FloatArray:
        """Ends of all cores in the world [m], shape [c, 2, 3]."""
        return self._looker.cores.posed(poses)

    def is_pressed(self, cores: Sequence[int], at: Sequence[int]) -> bool:
        """Whether the motion presses ends of cores into bones other than theirs, at the latest.

        Args:
            cores: The cores.
            at: Their ends: 0 or 1.
        """
        bones = [self._looker.cores.bone[k] for k in cores]
        pairs = zip(cores, at, strict=True)
        return any(self._looker.is_pressed(k, end, bones) for k, end in pairs)

    def share(self, name: str | None = None) -> float:
        """Share of the frames in which a garment was pierced; any of them where None."""
        count = self._any if name is None else self._garments[name]
        return count / max(self._looker.frames, 1)
