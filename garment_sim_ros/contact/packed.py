"""Collider shapes as flat arrays: packed once, posed once per step, met by all garments."""

from typing import Any, NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.kinds import KINDS
from garment_sim_ros.contact.kinds.kind import NO_SIZE, Own, Size
from garment_sim_ros.contact.kinds.packed_grids import PackedGrids
from garment_sim_ros.contact.kinds.packed_hulls import PackedHulls
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.jit import lean_kernel


class PackedShapes(NamedTuple):
    """The shapes of a collider set that can be touched; frames are left out.

    Attributes:
        kind: Code of the kind, see `kinds.kind.Kind`, shape [m].
        collider: Index into the set, shape [m].
        size: Size numbers of the kind, see its file in `kinds`, shape [m, 4].
        hull: Which each hull is in `hulls` and each sdf in `grids`, shape [m].
        bound: A capsule that holds the shape, in the shape's frame [m]: start, end and radius,
            shape [m, 7].
        box: Centre and half extents of a hull's or sdf's box, in its frame [m]; zero for other
            kinds, whose bounding capsule is as good, shape [m, 6].
        longest: Length of the longest of those capsules, a measure for the whole body [m].
        radii: Radii of ellipsoids, shape [m, 3]; None without any, like `hulls`.
        hulls: What hulls need besides; None without any, which keeps their code out of kernels.
        grids: The same of sdfs.
    """

    kind: IntArray
    collider: IntArray
    size: SingleArray
    hull: IntArray
    bound: FloatArray
    box: FloatArray
    longest: np.float32
    radii: SingleArray | None = None
    hulls: PackedHulls | None = None
    grids: PackedGrids | None = None


class Bounds(NamedTuple):
    """What of packed shapes `pose_shapes` needs.

    Attributes:
        collider: As in `PackedShapes`.
        bound: Likewise.
        box: Likewise.
    """

    collider: IntArray
    bound: FloatArray
    box: FloatArray

    @classmethod
    def of(cls, shapes: PackedShapes) -> "Bounds":
        """Those of packed shapes."""
        return cls(shapes.collider, shapes.bound, shapes.box)


class Poses(NamedTuple):
    """World poses of a collider set of n, for kernels.

    Attributes:
        position: [m], shape [n, 3].
        orientation: Unit quaternions, shape [n, 4].
    """

    position: FloatArray
    orientation: FloatArray

    @classmethod
    def of(cls, poses: ColliderPoses) -> "Poses":
        """The same arrays."""
        return cls(poses.position, poses.orientation)


class PosedShapes(NamedTuple):
    """Shapes at the end of one step, about a local origin; written by `pose`.

    Attributes:
        centre: Origins of the shapes' frames [m], shape [m, 3].
        rotation: Their rotation matrices, shape [m, 3, 3].
        carry: Displacement map of each shape in the step, how far a point fixed to it moves: the
            linear map (rotation less identity) and the offset, shape [m, 3, 4].
        bound: Capsules that hold the shapes [m]: start, unit axis, length and radius, shape
            [m, 8].
        box: Boxes along the axes of the world that hold the shapes: minimum, maximum [m], shape
            [m, 6].
    """

    centre: SingleArray
    rotation: SingleArray
    carry: SingleArray
    bound: SingleArray
    box: SingleArray

    @classmethod
    def room_for(cls, shapes: PackedShapes) -> "PosedShapes":
        """Arrays of the right sizes, to be filled by `pose`."""
        m = len(shapes.kind)
        return cls(
            centre=np.zeros((m, 3), np.float32),
            rotation=np.zeros((m, 3, 3), np.float32),
            carry=np.zeros((m, 3, 4), np.float32),
            bound=np.zeros((m, 8), np.float32),
            box=np.zeros((m, 6), np.float32),
        )


def pack(colliders: ColliderSet, T_world_rest: FloatArray | None = None) -> PackedShapes:
    """The touchable shapes of a set as flat arrays, a skinned mesh not among them.

    Args:
        colliders: The set.
        T_world_rest: Where its colliders are at rest, which tells what faces of hulls are buried,
            shape [n, 4, 4], NaN where that is not known; None if it is not for any.

    Raises:
        GeometryError: A shape of unknown kind or with unusable numbers.
    """
    touchable = [i for i, c in enumerate(colliders.colliders) if c.shape is not None]
    shapes = [colliders.colliders[i] for i in touchable]
    packed = [_size_and_bound(c) for c in shapes]
    size = np.array([size for size, _ in packed], dtype=np.float32).reshape(-1, 4)
    bound = np.array([bound for _, bound in packed], dtype=np.float64).reshape(-1, 7)
    longest = np.linalg.norm(bound[:, 3:6] - bound[:, :3], axis=1) + 2.0 * bound[:, 6]
    code = np.array([c.record.code for c in shapes], np.int32)
    box = np.zeros((len(shapes), 6))
    number = np.zeros(len(shapes), np.int32)
    tables: dict[str, Any] = {}
    for kind in KINDS.values():
        mine = np.flatnonzero(code == kind.code)
        if kind.shape is None or kind.shape.arrays is None or not len(mine):
            continue
        own = Own(
            geometry={shapes[i].name: shapes[i].geometry for i in mine},
            size=size,
            longest=longest.max(),
            T_world_rest=None if T_world_rest is None else T_world_rest[touchable][mine],
        )
        tables[kind.shape.table], boxes = kind.shape.arrays(own)
        number[mine] = np.arange(len(mine))
        if boxes is not None:
            box[mine] = _middle_and_half(boxes)
    return PackedShapes(
        kind=code,
        collider=np.array(touchable, dtype=np.int32),
        size=size,
        hull=number,
        bound=bound,
        box=box,
        longest=np.float32(longest.max(initial=0.0)),
        **tables,
    )


def _size_and_bound(collider: Collider) -> tuple[Size, tuple[float, ...]]:
    """Size numbers and bounding capsule of a collider with a shape, in its own frame."""
    shape, g = collider.shape, collider.geometry
    try:
        return (NO_SIZE, ()) if shape is None else (shape.size(g), shape.bound(g))
    except (TypeError, ValueError, GeometryError) as error:
        raise GeometryError(f"collider {collider.name!r}: {error}") from None


def _middle_and_half(box: SingleArray) -> SingleArray:
    """Centre and half extents of boxes that are given by their corners, shape [n, 6]."""
    low, high = box[:, :3], box[:, 3:]
    return np.hstack([0.5 * (low + high), 0.5 * (high - low)])


@lean_kernel(inner=True)
def _rotation_of(q, R):
    """Rotation matrix [3, 3] of a unit quaternion [4] in float64."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    R[0, 0] = 1 - 2 * (y * y + z * z)
    R[0, 1] = 2 * (x * y - z * w)
    R[0, 2] = 2 * (x * z + y * w)
    R[1, 0] = 2 * (x * y + z * w)
    R[1, 1] = 1 - 2 * (x * x + z * z)
    R[1, 2] = 2 * (y * z - x * w)
    R[2, 0] = 2 * (x * z - y * w)
    R[2, 1] = 2 * (y * z + x * w)
    R[2, 2] = 1 - 2 * (x * x + y * y)


@lean_kernel(forceinline=True)
def pose_shapes(shapes, start, end, origin, scratch, posed):
    """Fills `posed`; see `pose`. Computes in float64, in `scratch` of shape [3, 3, 3].

    Args:
        shapes: `Bounds` or `PackedShapes`.
        start: `Poses`.
        end: `Poses`.
        origin: As in `pose`.
        scratch: Scratch.
        posed: Output.
    """
    position0, orientation0, position1, orientation1 = start[0], start[1], end[0], end[1]
    R0 = scratch[0]
    R1 = scratch[1]
    ends = scratch[2]
    for k in range(shapes.collider.size):
        i = shapes.collider[k]
        bound = shapes.bound[k]
        box = shapes.box[k]
        _rotation_of(orientation0[i], R0)
        _rotation_of(orientation1[i], R1)
        squared = 0.0
        for r in range(3):
            centre = position1[i, r] - origin[r]
            offset = centre
            ends[0, r] = centre
            ends[1, r] = centre
            for c in range(3):
                posed.rotation[k, r, c] = R1[r, c]
                ends[0, r] += R1[r, c] * bound[c]
                ends[1, r] += R1[r, c] * bound[3 + c]
                turned = R1[r, 0] * R0[c, 0] + R1[r, 1] * R0[c, 1] + R1[r, 2] * R0[c, 2]
                posed.carry[k, r, c] = turned - (1.0 if r == c else 0.0)
                offset -= turned * (position0[i, c] - origin[c])
            posed.centre[k, r] = centre
            posed.carry[k, r, 3] = offset
            middle = centre + R1[r, 0] * box[0] + R1[r, 1] * box[1] + R1[r, 2] * box[2]
            half = abs(R1[r, 0]) * box[3] + abs(R1[r, 1]) * box[4] + abs(R1[r, 2]) * box[5]
            if half > 0.0:
                posed.box[k, r] = middle - half
                posed.box[k, 3 + r] = middle + half
            else:
                posed.box[k, r] = min(ends[0, r], ends[1, r]) - bound[6]
                posed.box[k, 3 + r] = max(ends[0, r], ends[1, r]) + bound[6]
            squared += (ends[1, r] - ends[0, r]) ** 2
        length = np.sqrt(squared)
        for r in range(3):
            posed.bound[k, r] = ends[0, r]
            posed.bound[k, 3 + r] = (ends[1, r] - ends[0, r]) / length if length > 0.0 else 0.0
        posed.bound[k, 6] = length
        posed.bound[k, 7] = bound[6]


_SCRATCH = np.zeros((3, 3, 3))


def pose(
    shapes: PackedShapes,
    start: ColliderPoses,
    end: ColliderPoses,
    origin: FloatArray,
    posed: PosedShapes,
) -> None:
    """Poses the shapes for one step.

    Args:
        shapes: Packed shapes of a set.
        start: World poses of the whole set when the step starts.
        end: World poses when it ends.
        origin: World position that particle positions are relative to [m], shape [3].
        posed: Output.
    """
    pose_shapes(Bounds.of(shapes), Poses.of(start), Poses.of(end), origin, _SCRATCH, posed)
