"""Which body parts run through a garment: the measure of whether it is still worn.

A body part pierces a garment in a frame where its core (see `cores`) runs through one of the
garment's triangles. That is excused near where the motion presses two body parts into each other:
a hand inside the hip has cloth between the two, and cannot but run through it. Two parts that
overlap most of the time are neighbours, such as upper arm and shoulder, and excuse nothing.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import IntArray
from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.jit import exact_kernel

NEAR = 0.06
"""How far along a core an overlap with another body part excuses [m]."""
_ALWAYS = 0.5
"""Share of the frames in which neighbours overlap."""
_MOST = 64
"""Hits of one core and one garment that are kept: more change nothing."""


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

    frame: int
    garment: str
    core: int
    excuses: tuple[int, ...]


class PiercedMeter:
    """Counts, over frames, the body parts that run through garments.

    Args:
        colliders: The body's colliders.
    """

    def __init__(self, colliders: ColliderSet) -> None:
        self._cores = cores = Cores.of(colliders)
        shape = cores.same_bone.shape
        self._low, self._high = np.empty(shape), np.empty(shape)
        self._overlaps = np.zeros(shape, np.int64)
        self._at = np.empty(_MOST)
        self._found: list[_Hits] = []
        self._frames = 0

    def add(
        self, poses: ColliderPoses, garments: Mapping[str, tuple[NDArray[np.floating], IntArray]]
    ) -> None:
        """Look at one frame.

        Args:
            poses: World poses of the colliders.
            garments: World positions [m], shape [v, 3], and triangles, shape [t, 3], by name.
        """
        cores = self._cores
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
        near = NEAR / np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 1e-9)
        for name, (x, triangles) in garments.items():
            for k in range(len(ends)):
                count = find_hits(ends[k, 0], ends[k, 1], x, triangles, self._at)
                at = self._at[: min(count, _MOST), None]
                excused = (
                    inside[k] & (self._low[k] - near[k] <= at) & (at <= self._high[k] + near[k])
                )
                for excuses in {tuple(np.flatnonzero(row).tolist()) for row in excused}:
                    self._found.append(_Hits(self._frames, name, k, excuses))
        self._frames += 1

    def result(self) -> Pierced:
        """What was found in all frames so far."""
        neighbours = self._overlaps > _ALWAYS * self._frames
        frames: dict[str, dict[str, set[int]]] = defaultdict(lambda: defaultdict(set))
        for hits in self._found:
            if all(neighbours[hits.core, s] for s in hits.excuses):
                frames[hits.garment][self._cores.bone[hits.core]].add(hits.frame)
        by_garment = {name: set[int]().union(*bones.values()) for name, bones in frames.items()}
        return Pierced(
            frames=self._frames,
            pierced=len(set[int]().union(*by_garment.values())),
            by_garment={name: len(found) for name, found in by_garment.items()},
            by_bone={n: {b: len(k) for b, k in bones.items()} for n, bones in frames.items()},
        )


@exact_kernel()
def find_hits(start, end, x, triangles, at):
    """Where a segment runs through triangles.

    Args:
        start: One end [m], shape [3].
        end: The other end [m], shape [3].
        x: Vertices [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        at: Receives the places of the first hits, 0 at the start to 1 at the end.

    Returns:
        How many triangles are hit.
    """
    d0, d1, d2 = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    low = np.minimum(start, end)
    high = np.maximum(start, end)
    count = 0
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        apart = False
        for i in range(3):
            p, q, r = x[a, i], x[b, i], x[c, i]
            apart = apart or max(p, q, r) < low[i] or min(p, q, r) > high[i]
        if apart:
            continue
        ax, ay, az = np.float64(x[a, 0]), np.float64(x[a, 1]), np.float64(x[a, 2])
        ux, uy, uz = x[b, 0] - ax, x[b, 1] - ay, x[b, 2] - az
        vx, vy, vz = x[c, 0] - ax, x[c, 1] - ay, x[c, 2] - az
        hx, hy, hz = d1 * vz - d2 * vy, d2 * vx - d0 * vz, d0 * vy - d1 * vx
        det = ux * hx + uy * hy + uz * hz
        if not abs(det) > 1e-14:
            continue
        sx, sy, sz = start[0] - ax, start[1] - ay, start[2] - az
        u = (sx * hx + sy * hy + sz * hz) / det
        wx, wy, wz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
        v = (d0 * wx + d1 * wy + d2 * wz) / det
        s = (vx * wx + vy * wy + vz * wz) / det
        if u >= 0.0 and v >= 0.0 and u + v <= 1.0 and 0.0 <= s <= 1.0:
            if count < len(at):
                at[count] = s
            count += 1
    return count


@exact_kernel()
def overlaps(ends, position, rotation, planes, plane_start, same_bone, low, high):
    """From where to where every core runs inside every convex solid of another bone.

    Args:
        ends: Of the cores in the world [m], shape [c, 2, 3].
        position: Of the solids in the world [m], shape [s, 3].
        rotation: Rotation matrices of the solids, shape [s, 3, 3].
        planes: Outward normals and offsets of all solids, shape [p, 4].
        plane_start: First plane of each solid and the end, shape [s + 1].
        same_bone: Pairs to leave out, shape [c, s].
        low: Receives where each run begins, 0 to 1 along the core, shape [c, s].
        high: Receives where it ends; not above `low` where there is none, shape [c, s].
    """
    for s in range(len(position)):
        R = rotation[s]
        for k in range(len(ends)):
            low[k, s], high[k, s] = 0.0, 0.0
            if same_bone[k, s]:
                continue
            first, last = 0.0, 1.0
            px, py, pz = ends[k, 0] - position[s]
            dx, dy, dz = ends[k, 1] - ends[k, 0]
            for j in range(plane_start[s], plane_start[s + 1]):
                nx, ny, nz = R @ planes[j, :3]
                above = nx * px + ny * py + nz * pz + planes[j, 3]
                rise = nx * dx + ny * dy + nz * dz
                if rise > 1e-12:
                    last = min(last, -above / rise)
                elif rise < -1e-12:
                    first = max(first, -above / rise)
                elif above > 0.0:
                    last = -1.0
                if first >= last:
                    break
            if first < last:
                low[k, s], high[k, s] = first, last
