"""Poses over time: kept until they are used, interpolated, never extrapolated."""

from collections import deque

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.geometry.transforms import interpolate_poses

_KEPT = 4096


class PoseBuffer:
    """Stamped poses in the order of their stamps [ns]."""

    def __init__(self) -> None:
        self._entries: deque[tuple[int, ColliderPoses]] = deque(maxlen=_KEPT)

    def __len__(self) -> int:
        return len(self._entries)

    def clear(self) -> None:
        """Forget all poses."""
        self._entries.clear()

    def add(self, stamp: int, poses: ColliderPoses) -> None:
        """Add poses that are newer than all others."""
        self._entries.append((stamp, poses))

    @property
    def newest(self) -> tuple[int, ColliderPoses]:
        """The last entry."""
        return self._entries[-1]

    def forget_before(self, stamp: int) -> None:
        """Drop entries that no time from `stamp` on needs."""
        while len(self._entries) >= 2 and self._entries[1][0] <= stamp:
            self._entries.popleft()

    def at(self, stamp: int, out: ColliderPoses) -> None:
        """Poses at a time, written to `out`; those of the first or last entry outside."""
        before = after = self._entries[0]
        for entry in self._entries:
            after = entry
            if entry[0] >= stamp:
                break
            before = entry
        if stamp <= before[0] or after[0] <= stamp:
            source = before if stamp <= before[0] else after
            out.position[:] = source[1].position
            out.orientation[:] = source[1].orientation
            return
        interpolate_poses(
            before[1].position,
            before[1].orientation,
            after[1].position,
            after[1].orientation,
            (stamp - before[0]) / (after[0] - before[0]),
            out.position,
            out.orientation,
        )
