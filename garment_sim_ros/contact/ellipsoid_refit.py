"""Ellipsoids at joints, fitted again in every pose.

Skin that several bones share does not keep its shape when they turn against each other. Such an
ellipsoid carries those points of its skin that bound it in some pose, by linear blending on the
frames of the set; in each pose it is the smallest one around them. It takes part in friction as if
it was fixed to its own bone.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.kinds.ellipsoid import REFIT_KEYS, REFITTED
from garment_sim_ros.contact.packed import PackedShapes, PosedShapes
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.mvee import enclose, room_to_enclose
from garment_sim_ros.geometry.transforms import rotate
from garment_sim_ros.jit import lean_kernel

MAX_POINTS = 4096
_TOLERANCE = 0.005
"""Of volumes; what is found holds its points in any case."""
_MIN_RADIUS = 1e-4


class _Carried(NamedTuple):
    """Points on frames, as flat arrays.

    Attributes:
        shape: Which packed shape each ellipsoid is, shape [j].
        inflation: Added to its radii [m], shape [j].
        points: Number of its points, shape [j].
        first: Where its blocks begin, shape [j + 1].
        frame: Index into the set of the frame of each block, shape [b].
        start: Where the points of each block begin, shape [b].
        part: Points in the frame, times their weights [m], shape [p, 3].
        weight: The weights, shape [p].
        guess: What the last ellipsoid began with for the next, see `enclose`; each ellipsoid's
            begin at `own`.
        own: Shape [j + 1].
    """

    shape: IntArray
    inflation: FloatArray
    points: IntArray
    first: IntArray
    frame: IntArray
    start: IntArray
    part: FloatArray
    weight: FloatArray
    guess: FloatArray
    own: IntArray


class EllipsoidRefit:
    """The ellipsoids of a set that are fitted again in every pose; allocates only here.

    Args:
        colliders: The set.
        shapes: The same, packed.

    Raises:
        GeometryError: Entries that do not fit together.
    """

    def __init__(self, colliders: ColliderSet, shapes: PackedShapes) -> None:
        entries = refit_entries(colliders)
        mine = [k for k, i in enumerate(shapes.collider) if int(i) in entries]
        blocks: list[tuple[int, FloatArray, FloatArray]] = []
        count, first, inflation = [], [0], []
        for k in mine:
            frames, points, weights, added = entries[int(shapes.collider[k])]
            blocks += zip(frames.tolist(), points, weights)
            count.append(points.shape[1])
            first.append(len(blocks))
            inflation.append(added)
        sizes = [len(weight) for _, _, weight in blocks]
        self._carried = _Carried(
            shape=np.array(mine, np.int32),
            inflation=np.array(inflation, np.float64),
            points=np.array(count, np.int32),
            first=np.array(first, np.int32),
            frame=np.array([frame for frame, _, _ in blocks], np.int32),
            start=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32),
            part=np.concatenate([np.zeros((0, 3)), *(p * w[:, None] for _, p, w in blocks)]),
            weight=np.concatenate([np.zeros(0), *(w for _, _, w in blocks)]),
            guess=np.zeros(sum(count)),
            own=np.concatenate([[0], np.cumsum(count)]).astype(np.int32),
        )
        most = max(count, default=1)
        self._scratch = (np.empty((most, 3)), np.empty((5, 3)), room_to_enclose(most))

    def __len__(self) -> int:
        return len(self._carried.shape)

    def forget(self) -> None:
        """What follows does not depend on what was: the next fit begins anew."""
        self._carried.guess[:] = 0.0

    def pose(
        self, poses: ColliderPoses, origin: FloatArray, shapes: PackedShapes, posed: PosedShapes
    ) -> None:
        """Changes shapes that have just been posed, and their sizes.

        Args:
            poses: World poses of the whole set at the end of the step.
            origin: World position that positions are relative to [m], shape [3].
            shapes: The packed shapes; size, radii and bound of mine are changed.
            posed: The same, posed; all but `carry` of mine is changed.
        """
        if len(self):
            _refit(
                self._carried, poses.position, poses.orientation, origin, shapes, posed,
                *self._scratch,
            )  # fmt: skip


def refit_entries(
    colliders: ColliderSet,
) -> dict[int, tuple[IntArray, FloatArray, FloatArray, float]]:
    """Values of `REFIT_KEYS` of each ellipsoid that has them, by its index in the set.

    Raises:
        GeometryError: They do not fit together.
    """
    result = {}
    of_frames = {i for i, c in enumerate(colliders.colliders) if c.is_frame}
    for i, c in enumerate(colliders.colliders):
        if c.record.variant_of(c.geometry) == REFITTED:
            try:
                result[i] = _entries(c.geometry, of_frames)
            except (GeometryError, KeyError, ValueError) as error:
                raise GeometryError(f"collider {c.name!r}: {error}") from None
    return result


def _entries(
    geometry: Mapping[str, object], of_frames: set[int]
) -> tuple[IntArray, FloatArray, FloatArray, float]:
    """Checked values of `REFIT_KEYS`; `of_frames` are the indices of the set's frames."""
    frames = np.asarray(geometry["frames"])
    points, weights, inflation = (np.asarray(geometry[key], np.float64) for key in REFIT_KEYS[1:])
    b = len(frames) if frames.ndim == 1 else 0
    n = points.shape[1] if points.ndim == 3 else 0
    if points.shape != (b, n, 3) or weights.shape != (b, n) or not (b and 0 < n <= MAX_POINTS):
        raise GeometryError(
            f"frames {frames.shape}, points {points.shape}, weights {weights.shape}; allowed: "
            f"[b], [b, n, 3] and [b, n] with n up to {MAX_POINTS}"
        )
    if frames.dtype.kind not in "iu" or not set(frames.tolist()) <= of_frames:
        raise GeometryError(
            f"frames {frames.tolist()}; allowed: indices of colliders of that kind"
        )
    if not (weights >= 0.0).all() or np.abs(weights.sum(axis=0) - 1.0).max() > 1e-6:
        raise GeometryError("weights of a point must be 0 or more and add up to 1")
    if inflation.shape != () or not 0.0 <= inflation <= 1.0:
        raise GeometryError("inflation must be a number from 0 to 1 m")
    return frames.astype(np.int32), points, weights, float(inflation)


@lean_kernel()
def _refit(carried, position, orientation, origin, shapes, posed, points, found, scratch):
    """See `EllipsoidRefit.pose`."""
    for j in range(carried.shape.size):
        n = carried.points[j]
        _carry(carried, j, position, orientation, origin, points)
        guess = carried.guess[carried.own[j] : carried.own[j + 1]]
        enclose(points, n, _TOLERANCE, _MIN_RADIUS, guess, scratch, found)
        k = carried.shape[j]
        for r in range(3):
            radius = found[4, r] + carried.inflation[j]
            found[4, r] = radius
            shapes.size[k, r] = radius
            shapes.radii[k, r] = radius
            posed.centre[k, r] = found[0, r]
        # The longest radius is the first: a capsule along x holds the ellipsoid.
        half = found[4, 0] - found[4, 1]
        for r in range(3):
            extent = 0.0
            for c in range(3):
                posed.rotation[k, r, c] = found[1 + r, c]
                extent += (found[1 + r, c] * found[4, c]) ** 2
            extent = np.sqrt(extent)
            posed.bound[k, r] = found[0, r] - half * found[1 + r, 0]
            posed.bound[k, 3 + r] = found[1 + r, 0]
            posed.box[k, r] = found[0, r] - extent
            posed.box[k, 3 + r] = found[0, r] + extent
        posed.bound[k, 6] = 2.0 * half
        posed.bound[k, 7] = found[4, 1]


@lean_kernel(inner=True)
def _carry(carried, j, position, orientation, origin, points):
    """Where the points of ellipsoid j are, about the origin; shape [at least n, 3]."""
    n = carried.points[j]
    for p in range(n):
        for r in range(3):
            points[p, r] = 0.0
    for block in range(carried.first[j], carried.first[j + 1]):
        i = carried.frame[block]
        q = orientation[i]
        r00, r10, r20 = rotate(q[0], q[1], q[2], q[3], 1.0, 0.0, 0.0)
        r01, r11, r21 = rotate(q[0], q[1], q[2], q[3], 0.0, 1.0, 0.0)
        r02, r12, r22 = rotate(q[0], q[1], q[2], q[3], 0.0, 0.0, 1.0)
        tx = position[i, 0] - origin[0]
        ty = position[i, 1] - origin[1]
        tz = position[i, 2] - origin[2]
        start = carried.start[block]
        for p in range(n):
            w = carried.weight[start + p]
            x = carried.part[start + p, 0]
            y = carried.part[start + p, 1]
            z = carried.part[start + p, 2]
            points[p, 0] += r00 * x + r01 * y + r02 * z + w * tx
            points[p, 1] += r10 * x + r11 * y + r12 * z + w * ty
            points[p, 2] += r20 * x + r21 * y + r22 * z + w * tz
