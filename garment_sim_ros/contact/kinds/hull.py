"""The kind ``hull``: convex, given by its corners and outward triangles.

A point's distance is the signed one to its planes, from a grid of candidates.

Inside, the distance is exact, but for faces that lie inside other hulls, see `buried_faces`: there
is no way out through them. Outside it is that to the nearest face's plane, as if faces were moved
out: less than the true distance off edges and corners.
"""

from functools import partial

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.kinds.buried_faces import buried_planes
from garment_sim_ros.contact.kinds.entries import Entries
from garment_sim_ros.contact.kinds.kind import (
    NO_SIZE,
    Cloud,
    Geometry,
    Kind,
    Own,
    Shape,
    Size,
    Surface,
    numbers,
)
from garment_sim_ros.contact.kinds.packed_hulls import (
    LISTED,
    WHOLE,
    PackedHulls,
    hull_bound,
    pack_hulls,
)
from garment_sim_ros.geometry.four import (
    counted,
    each_number,
    four_at,
    higher_four,
    lower_four,
    same_four,
    turned_by_one,
    turned_by_two,
    where_above,
)
from garment_sim_ros.geometry.transforms import transform_points
from garment_sim_ros.jit import lean_kernel

_BURIED = 0.05
"""Share of the longest shape that hulls go on for outside of a buried face: 2 cm on a human."""
_LISTED, _ONE = np.uint64(LISTED), np.uint64(1)
_WHOLE = np.int32(WHOLE)


@lean_kernel(inner=True)
def _cell_of(shapes, h, x, y, z):
    """The cell of hull h's grid that holds a point in the hull's frame."""
    i = np.int64((x - shapes.hulls.grid[h, 0]) * shapes.hulls.grid[h, 3])
    j = np.int64((y - shapes.hulls.grid[h, 1]) * shapes.hulls.grid[h, 4])
    m = np.int64((z - shapes.hulls.grid[h, 2]) * shapes.hulls.grid[h, 5])
    # At the rim of the grid rounding may lead one cell out of it.
    i = min(i, np.int64(shapes.hulls.cells[h, 0] - 1))
    j = min(j, np.int64(shapes.hulls.cells[h, 1] - 1))
    m = min(m, np.int64(shapes.hulls.cells[h, 2] - 1))
    cell = (i * shapes.hulls.cells[h, 1] + j) * shapes.hulls.cells[h, 2] + m
    return np.uint64(cell + shapes.hulls.first_cell[h])


@lean_kernel(inner=True)
def _four_heights(shapes, four, x, y, z):
    """Heights over four planes of a point whose coordinates are fours of the same number."""
    at = np.uint64(four) * np.uint64(20)
    planes = shapes.hulls.plane
    height = (
        four_at(planes, at) * x
        + four_at(planes, at + np.uint64(4)) * y
        + four_at(planes, at + np.uint64(8)) * z
        - four_at(planes, at + np.uint64(12))
    )
    buried = height - four_at(planes, at + np.uint64(16))
    return where_above(height, same_four(np.float32(0.0)), height, buried)


@lean_kernel(inner=True)
def two_highest(shapes, h, cell, x, y, z):
    """The two greatest heights of a point over the planes that a cell of hull h lists.

    Returns:
        The greatest height, the one after it, and which plane has the greatest; heights that are
        very great where none is listed.
    """
    at = _LISTED * cell
    count = np.int32(shapes.hulls.near[at + _LISTED - _ONE])
    first = shapes.hulls.first[h]
    is_whole = count == _WHOLE
    if is_whole:
        count = shapes.hulls.first[h + 1] - first
    best = second = same_four(np.float32(-np.inf if count > 0 else np.inf))
    which = counted()
    x, y, z = same_four(x), same_four(y), same_four(z)
    for n in range(count):
        four = first + (
            np.int32(n) if is_whole else np.int32(shapes.hulls.near[at + np.uint64(n)])
        )
        height = _four_heights(shapes, four, x, y, z)
        planes = counted() + same_four(np.float32(4 * four))
        second = higher_four(lower_four(height, best), second)
        which = where_above(height, best, planes, which)
        best = higher_four(height, best)
    # Of the four best and the four after them to those of all: two by two, without a branch.
    best, second, which = _of_both(
        *(best, second, which),
        *(turned_by_two(best), turned_by_two(second), turned_by_two(which)),
    )
    best, second, which = _of_both(
        *(best, second, which),
        *(turned_by_one(best), turned_by_one(second), turned_by_one(which)),
    )
    return each_number(best)[0], each_number(second)[0], each_number(which)[0]


@lean_kernel(inner=True)
def _of_both(best, second, which, other_best, other_second, other_which):
    """Of two sets of planes the two greatest heights, and the plane with the greatest."""
    low = lower_four(best, other_best)
    return (
        higher_four(best, other_best),
        higher_four(low, higher_four(second, other_second)),
        where_above(best, other_best, which, other_which),
    )


@lean_kernel(inner=True)
def whole_hull(shapes):
    """The cell that lists all planes, of whatever hull."""
    return np.uint64(shapes.hulls.near.size // LISTED - 1)


@lean_kernel(inner=True)
def cell_near(shapes, h, x, y, z, reach):
    """The cell that lists the planes that can be the nearest to a point.

    Args:
        shapes: Packed shapes with hulls.
        h: Which hull.
        x: Point in the hull's frame, in the hull's box inflated by `reach` [m].
        y: See `x`.
        z: See `x`.
        reach: Heights above this need not be known [m].
    """
    if reach <= shapes.hulls.around:
        return _cell_of(shapes, h, x, y, z)
    return whole_hull(shapes)


@lean_kernel(inner=True)
def _place_of(plane):
    """Where a plane that `two_highest` told begins among the planes."""
    number = np.uint64(plane)
    return np.uint64(20) * (number >> np.uint64(2)) + (number & np.uint64(3))


@lean_kernel(inner=True)
def hull_normal(shapes, posed, k, plane):
    """Unit direction out of shape k, a hull, over a plane that `two_highest` told."""
    at = _place_of(plane)
    nx = shapes.hulls.plane[at]
    ny = shapes.hulls.plane[at + np.uint64(4)]
    nz = shapes.hulls.plane[at + np.uint64(8)]
    return (
        posed.rotation[k, 0, 0] * nx + posed.rotation[k, 0, 1] * ny + posed.rotation[k, 0, 2] * nz,
        posed.rotation[k, 1, 0] * nx + posed.rotation[k, 1, 1] * ny + posed.rotation[k, 1, 2] * nz,
        posed.rotation[k, 2, 0] * nx + posed.rotation[k, 2, 1] * ny + posed.rotation[k, 2, 2] * nz,
    )


def hull_normal_if_any(shapes, posed, k, plane):
    """As `hull_normal`; zero where ``shapes.hulls`` is None."""
    if shapes.hulls is None:
        return np.float32(0.0), np.float32(0.0), np.float32(0.0)
    return hull_normal(shapes, posed, k, plane)


@overload(hull_normal_if_any, inline="always")
def _compiled_hull_normal_if_any(shapes, posed, k, plane):
    if isinstance(shapes.types[shapes.fields.index("hulls")], types.NoneType):
        return lambda shapes, posed, k, plane: (np.float32(0.0), np.float32(0.0), np.float32(0.0))
    return lambda shapes, posed, k, plane: hull_normal(shapes, posed, k, plane)


@lean_kernel(inner=True)
def hull_distance(shapes, posed, k, qx, qy, qz, reach):
    """Signed distance to shape k, a hull, infinite above `reach`, and the unit direction out.

    Arrays are asked for their elements only, never held in a variable: held, they are counted as
    references, which costs more than all of the arithmetic.

    Args:
        shapes: Packed shapes with hulls.
        posed: The same, posed.
        k: Which one.
        qx: Point relative to the origin of the hull's frame [m].
        qy: See `qx`.
        qz: See `qx`.
        reach: Distances above this need not be known [m].
    """
    zero = np.float32(0.0)
    r00, r01, r02 = posed.rotation[k, 0, 0], posed.rotation[k, 0, 1], posed.rotation[k, 0, 2]
    r10, r11, r12 = posed.rotation[k, 1, 0], posed.rotation[k, 1, 1], posed.rotation[k, 1, 2]
    r20, r21, r22 = posed.rotation[k, 2, 0], posed.rotation[k, 2, 1], posed.rotation[k, 2, 2]
    x = r00 * qx + r10 * qy + r20 * qz
    y = r01 * qx + r11 * qy + r21 * qz
    z = r02 * qx + r12 * qy + r22 * qz
    h = shapes.hull[k]
    low = min(x - shapes.hulls.box[h, 0], y - shapes.hulls.box[h, 1], z - shapes.hulls.box[h, 2])
    high = max(x - shapes.hulls.box[h, 3], y - shapes.hulls.box[h, 4], z - shapes.hulls.box[h, 5])
    if low < -reach or high > reach:
        return np.float32(np.inf), zero, zero, zero
    best, _, plane = two_highest(shapes, h, cell_near(shapes, h, x, y, z, reach), x, y, z)
    if best > reach:
        return np.float32(np.inf), zero, zero, zero
    found = _place_of(plane)
    nx = shapes.hulls.plane[found]
    ny = shapes.hulls.plane[found + np.uint64(4)]
    nz = shapes.hulls.plane[found + np.uint64(8)]
    return (
        best,
        r00 * nx + r01 * ny + r02 * nz,
        r10 * nx + r11 * ny + r12 * nz,
        r20 * nx + r21 * ny + r22 * nz,
    )


def hull_distance_if_any(shapes, posed, k, qx, qy, qz, reach):
    """As `hull_distance`; infinite, at no cost, where ``shapes.hulls`` is None."""
    if shapes.hulls is None:
        return np.float32(np.inf), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    return hull_distance(shapes, posed, k, qx, qy, qz, reach)


@overload(hull_distance_if_any, inline="always")
def _compiled_hull_distance_if_any(shapes, posed, k, qx, qy, qz, reach):
    # Decided by type: where there are no hulls their code is not in the kernels at all, which
    # makes those that meet other shapes up to twice as fast.
    if isinstance(shapes.types[shapes.fields.index("hulls")], types.NoneType):
        return lambda shapes, posed, k, qx, qy, qz, reach: (
            np.float32(np.inf),
            np.float32(0.0),
            np.float32(0.0),
            np.float32(0.0),
        )
    return lambda shapes, posed, k, qx, qy, qz, reach: hull_distance(
        shapes, posed, k, qx, qy, qz, reach
    )


def _parse(entries: Entries) -> dict[str, object]:
    vertices = entries.array("vertices").astype(np.float64)
    faces = entries.array("faces")
    for label, array in (("vertices", vertices), ("faces", faces)):
        if array.ndim != 2 or array.shape[1] != 3 or len(array) < 4:
            entries.refuse(f"{label} has shape {array.shape}; allowed: [4 or more, 3]")
    if faces.dtype.kind == "f" or faces.min() < 0 or faces.max() >= len(vertices):
        entries.refuse(f"faces must be indices 0..{len(vertices) - 1}")
    return {"vertices": vertices, "faces": faces.astype(np.int32), **entries.share()}


def _size(geometry: Geometry) -> Size:
    return NO_SIZE


def _bound(geometry: Geometry) -> tuple[float, ...]:
    return hull_bound(numbers(geometry, "vertices"))


def _inscribed_radius(geometry: Geometry) -> float:
    """Of a ball about the mean of the corners."""
    vertices = numbers(geometry, "vertices")
    a, b, c = (vertices[np.asarray(geometry["faces"])[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    height = np.einsum("fi,fi->f", a - vertices.mean(axis=0), normal)[length > 0.0]
    return max(float((height / length[length > 0.0]).min()), 0.0) if len(height) else 0.0


def _surface(geometry: Geometry, points: int, finest: float) -> Surface:
    return Surface(numbers(geometry, "vertices"), np.asarray(geometry["faces"], np.int32))


def _clouds(geometry: Geometry) -> tuple[Cloud]:
    return (Cloud(numbers(geometry, "vertices")),)


def _arrays(own: Own) -> tuple[PackedHulls, NDArray[np.float32]]:
    buried = None
    if own.T_world_rest is not None:
        way = _BURIED * own.longest
        buried = partial(_buried, list(own.geometry.values()), own.T_world_rest, way)
    hulls = {name: (g["vertices"], g["faces"]) for name, g in own.geometry.items()}
    packed = pack_hulls(hulls, buried)
    return packed, packed.box


def _buried(
    hulls: list[Geometry], T: FloatArray, way: float, planes: list[FloatArray]
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


_CORNERS = 0.1 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
_FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)

HULL = Kind(
    name="hull",
    code=3,
    keys=("vertices", "faces"),
    optional=("share",),
    parse=_parse,
    shape=Shape(
        size=_size,
        bound=_bound,
        inscribed_radius=_inscribed_radius,
        surface=_surface,
        table="hulls",
        arrays=_arrays,
    ),
    clouds=_clouds,
    variants={"hull": {"vertices": _CORNERS, "faces": _FACES}},
)
"""Size: nothing; see `PackedHulls`."""
