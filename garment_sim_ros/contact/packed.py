"""Collider shapes as flat arrays: packed once, posed once per step, met by all garments."""

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.kinds.buried_faces import buried_planes
from garment_sim_ros.contact.kinds.capsule import capsule_size
from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.contact.kinds.ellipsoid import ellipsoid_bound, ellipsoid_size
from garment_sim_ros.contact.kinds.hull import PackedHulls, hull_bound, pack_hulls
from garment_sim_ros.contact.kinds.sdf import PackedGrids, pack_grids
from garment_sim_ros.contact.shapes import KINDS, Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.transforms import transform_points
from garment_sim_ros.jit import lean_kernel

_BURIED = 0.05
"""Share of the longest shape that hulls go on for outside of a buried face: 2 cm on a human."""


class PackedShapes(NamedTuple):
    """The shapes of a collider set that can be touched; frames are left out.

    Attributes:
        kind: Index into `KINDS`, shape [m].
        collider: Index into the set, shape [m].
        size: Numbers of the kind, see ``contact_<kind>.py``, shape [m, 4].
        hull: Index of each hull in `hulls` and of each sdf in `grids`, 0 for other kinds, shape
            [m].
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
    radii: SingleArray | None
    hulls: PackedHulls | None
    grids: PackedGrids | None


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


def _packed(collider: Collider) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Size numbers and bounding capsule of one collider, in its own frame."""
    g = collider.geometry
    try:
        if collider.kind == "sphere":
            r, _, _, _ = capsule_size(float(g["radius"]), 0.0, 0.0)  # type: ignore[arg-type]
            return (r, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, r)
        if collider.kind == "capsule":
            r0, r1, length = (float(g[k]) for k in ("radius0", "radius1", "length"))  # type: ignore[arg-type]
            return capsule_size(r0, r1, length), (0.0, 0.0, 0.0, 0.0, 0.0, length, max(r0, r1))
        if collider.kind == "ellipsoid":
            size = ellipsoid_size(g["radii"])
            return size, ellipsoid_bound(size)
        if collider.kind == "hull":
            return (0.0, 0.0, 0.0, 0.0), hull_bound(np.asarray(g["vertices"], np.float64))
        return (0.0, 0.0, 0.0, 0.0), hull_bound(DistanceGrid.of(g).rim())
    except (TypeError, ValueError, GeometryError) as error:
        raise GeometryError(f"collider {collider.name!r}: {error}") from None


def pack(colliders: ColliderSet, T_world_rest: FloatArray | None = None) -> PackedShapes:
    """The touchable shapes of a set as flat arrays, a skinned mesh not among them.

    Args:
        colliders: The set.
        T_world_rest: Where its colliders are at rest, which tells what faces of hulls are buried,
            shape [n, 4, 4], NaN where that is not known; None if it is not for any.

    Raises:
        GeometryError: A shape of unknown kind or with unusable numbers.
    """
    touchable = [i for i, c in enumerate(colliders.colliders) if c.kind not in ("frame", "mesh")]
    packed = [_packed(colliders.colliders[i]) for i in touchable]
    size = np.array([size for size, _ in packed], dtype=np.float32).reshape(-1, 4)
    bound = np.array([bound for _, bound in packed], dtype=np.float64).reshape(-1, 7)
    longest = np.linalg.norm(bound[:, 3:6] - bound[:, :3], axis=1) + 2.0 * bound[:, 6]
    kind = np.array([KINDS.index(colliders.colliders[i].kind) for i in touchable], np.int32)
    box = np.zeros((len(kind), 6))
    hulls, is_hull = _named(colliders, touchable, "hull")
    grids, is_grid = _named(colliders, touchable, "sdf")
    packed_hulls = packed_grids = None
    if hulls:
        T = None if T_world_rest is None else T_world_rest[touchable][is_hull]
        packed_hulls = pack_hulls(
            {name: (g["vertices"], g["faces"]) for name, g in hulls.items()},
            None
            if T is None
            else partial(_buried, list(hulls.values()), T, _BURIED * longest.max()),
        )
        box[is_hull] = _middle_and_half(packed_hulls.box)
    if grids:
        packed_grids = pack_grids(grids)
        box[is_grid] = _middle_and_half(packed_grids.box)
    return PackedShapes(
        kind=kind,
        collider=np.array(touchable, dtype=np.int32),
        size=size,
        hull=np.where(
            is_hull, np.cumsum(is_hull) - 1, np.where(is_grid, np.cumsum(is_grid) - 1, 0)
        ).astype(np.int32),
        bound=bound,
        box=box,
        longest=np.float32(longest.max(initial=0.0)),
        radii=size[:, :3].copy() if (kind == KINDS.index("ellipsoid")).any() else None,
        hulls=packed_hulls,
        grids=packed_grids,
    )


def _buried(
    hulls: list[Mapping[str, object]], T: FloatArray, way: float, planes: list[FloatArray]
) -> list[NDArray[np.bool_]]:
    """`buried_planes` of hulls at T [h, 4, 4], with planes in their own frames."""
    known = np.asarray(np.isfinite(T).all(axis=(1, 2)))
    there, corners = [], []
    for hull, own, T_hull, is_known in zip(hulls, planes, T, known):
        placed = np.zeros((0, 4))
        if is_known:
            normal = own[:, :3] @ T_hull[:3, :3].T
            placed = np.column_stack([normal, own[:, 3] + normal @ T_hull[:3, 3]])
        there.append(placed)
        x = np.asarray(hull["vertices"], np.float64)
        corners.append(transform_points(T_hull, x) if is_known else x)
    return [
        found if is_known else np.zeros(len(own), bool)
        for found, own, is_known in zip(buried_planes(there, corners, way), planes, known)
    ]


def _named(
    colliders: ColliderSet, touchable: list[int], kind: str
) -> tuple[dict[str, Mapping[str, object]], NDArray[np.bool_]]:
    """Geometry by name of the shapes of one kind, and which of the touchable ones they are."""
    shapes = [colliders.colliders[i] for i in touchable]
    own = [c.kind == kind for c in shapes]
    return {c.name: c.geometry for c in shapes if c.kind == kind}, np.array(own, np.bool_)


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
