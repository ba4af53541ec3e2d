"""Point against convex hull: the signed distance to its planes, from a grid of candidates.

Inside, the distance is exact, but for faces that lie inside other hulls, see `buried_faces`: there
is no way out through them. Outside it is that to the nearest face's plane, as if faces were moved
out: less than the true distance off edges and corners.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.kinds.face_grid import FaceGrid, face_grid
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.jit import lean_kernel

_AROUND = 0.025
"""How far out the grids know distances, as a share of the largest hull: 1 cm on a human's trunk.
Beyond, all planes are asked."""
_FAR = 1e30
_OVERLAP = 0.1
"""How far beyond a cell of the grids its list of planes holds, too, as a share of the cell."""


class PackedHulls(NamedTuple):
    """Hulls as flat arrays.

    Planes stand in fours, so that four heights are found at once: four normals' x, y and z, the
    offsets, and how much farther away planes are for points below them, which is nothing or, where
    they are buried, very much. Lists that do not fill their last four end with planes that all is
    far below.

    Attributes:
        plane: The planes, flat: lists of the cells, hull by hull, and then whole hulls.
        first: Where each hull's planes start among the fours, one more at the end, shape [h + 1].
        box: Lowest and highest corner of each hull [m], shape [h, 6].
        grid: Lowest corner of each hull's grid [m], and cells per length, shape [h, 6].
        cells: Cells along each axis, shape [h, 3].
        first_cell: Where each hull's cells start in `start`, shape [h].
        start: Where each cell's list starts among the fours, one more per hull, shape
            [all cells + h].
        around: How far out the grids know distances [m].
        overlap: How far beyond a cell of each hull its list holds, too [m], shape [h].
    """

    plane: SingleArray
    first: IntArray
    box: SingleArray
    grid: SingleArray
    cells: IntArray
    first_cell: IntArray
    start: IntArray
    around: np.float32
    overlap: SingleArray


def _in_fours(
    planes: FloatArray, lists: IntArray, start: IntArray
) -> tuple[SingleArray, IntArray]:
    """Lists of planes, each padded to whole fours; and where each of the lists starts.

    An empty list becomes four planes that everything is far above.
    """
    length = np.diff(start)
    fours = np.maximum(-(-length // 4), 1)
    first = np.concatenate([[0], np.cumsum(fours)])
    row = np.repeat(np.arange(len(length)), 4 * fours)
    slot = np.arange(len(row)) - 4 * first[row]
    which = np.append(lists, 0)[np.minimum(start[row] + slot, len(lists))]
    which[slot >= length[row]] = len(planes)
    which[length[row] == 0] = len(planes) + 1
    planes = np.vstack([planes, [0.0, 0.0, 0.0, _FAR, 0.0], [0.0, 0.0, 0.0, -_FAR, 0.0]])
    packed = planes[which].reshape(-1, 4, 5).transpose(0, 2, 1)
    return np.ascontiguousarray(packed, np.float32).ravel(), first.astype(np.int32)


def hull_planes(vertices: object, faces: object) -> FloatArray:
    """Distinct face planes of a hull, shape [f, 4].

    Raises:
        GeometryError: Not a closed convex polyhedron with outward triangles.
    """
    x = np.asarray(vertices, dtype=np.float64)
    f = np.asarray(faces)
    if x.ndim != 2 or x.shape[1:] != (3,) or f.ndim != 2 or f.shape[1:] != (3,) or len(f) < 4:
        raise GeometryError("a hull needs vertices [n, 3] and at least 4 faces [f, 3]")
    if not np.isfinite(x).all() or f.min() < 0 or f.max() >= len(x):
        raise GeometryError("a hull needs finite vertices and faces that index them")
    a, b, c = x[f].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    solid = length > 1e-12 * size * size
    if solid.sum() < 4:
        raise GeometryError("a hull needs 4 faces with area")
    normal = normal[solid] / length[solid, None]
    offset = np.einsum("fk,fck->fc", normal, x[f[solid]]).max(axis=1)
    planes = np.column_stack([normal, offset])
    height = x @ normal.T - offset
    if height.max() > 1e-4 * size:
        raise GeometryError(f"a hull must be convex; a corner is out by {height.max():.3g} m")
    # Faces of one polygon share a plane.
    key = np.round(np.column_stack([normal, offset / size]) * 1e6).astype(np.int64)
    _, first = np.unique(key, axis=0, return_index=True)
    return planes[np.sort(first)]


def hull_bound(vertices: FloatArray) -> tuple[float, ...]:
    """A capsule that holds points, along the longest axis: start, end and radius [m]."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre = 0.5 * (low + high)
    axis = int(np.argmax(high - low))
    local = vertices - centre
    across = np.linalg.norm(np.delete(local, axis, axis=1), axis=1)
    radius = float(across.max())
    cap = np.sqrt(np.maximum(radius * radius - across * across, 0.0))
    end = np.zeros(3)
    end[axis] = max(float((np.abs(local[:, axis]) - cap).max()), 0.0)
    return (*(centre - end).tolist(), *(centre + end).tolist(), radius)


def _with_exposed(
    planes: FloatArray, buried: NDArray[np.bool_], low: FloatArray, high: FloatArray, far: float
) -> FaceGrid:
    """A grid of candidates of all planes, and of those that are not buried if some are."""
    grid = face_grid(planes, low, high, far=far, overlap=_OVERLAP)
    if not buried.any():
        return grid
    exposed = np.flatnonzero(~buried).astype(np.int32)
    inner = face_grid(planes[exposed], low, high, far=far, overlap=_OVERLAP)
    lists = []
    for c in range(len(grid.start) - 1):
        own = grid.face[grid.start[c] : grid.start[c + 1]]
        other = exposed[inner.face[inner.start[c] : inner.start[c + 1]]]
        lists.append(np.union1d(own, other).astype(np.int32) if len(own) else own)
    start = np.cumsum([0, *map(len, lists)]).astype(np.int32)
    return replace(grid, start=start, face=np.concatenate(lists))


def pack_hulls(
    hulls: Mapping[str, tuple[object, object]],
    buried: Callable[[list[FloatArray]], list[NDArray[np.bool_]]] | None = None,
) -> PackedHulls:
    """Hulls given by name, vertices and outward faces, as flat arrays.

    Args:
        hulls: The hulls.
        buried: Tells of the distinct planes of each, as `hull_planes` has them, which are buried;
            None for none.

    Raises:
        GeometryError: One is not a closed convex polyhedron.
    """
    planes, boxes = [], []
    for name, (vertices, faces) in hulls.items():
        try:
            own = hull_planes(vertices, faces)
        except GeometryError as error:
            raise GeometryError(f"collider {name!r}: {error}") from None
        x = np.asarray(vertices, dtype=np.float64)
        planes.append(own)
        boxes.append([*x.min(axis=0), *x.max(axis=0)])
    box = np.array(boxes).reshape(-1, 6)
    around = np.float32(_AROUND * (box[:, 3:] - box[:, :3]).max(initial=0.0))
    hidden = [np.zeros(len(own), bool) for own in planes] if buried is None else buried(planes)
    grids = [
        _with_exposed(own, under, low - around, high + around, float(around))
        for own, under, low, high in zip(planes, hidden, box[:, :3], box[:, 3:])
    ]
    planes = [np.column_stack([own, _FAR * under]) for own, under in zip(planes, hidden)]
    lists = [_in_fours(own, g.face, g.start) for own, g in zip(planes, grids)]
    whole = [
        _in_fours(p, np.arange(len(p), dtype=np.int32), np.array([0, len(p)], np.int32))
        for p in planes
    ]
    packed = [p for p, _ in (*lists, *whole)]
    at = np.cumsum([0, *(len(p) // 20 for p in packed)])
    first_cell = np.cumsum([0, *(len(g.start) for g in grids)])
    none: list[NDArray[np.int32]] = [np.zeros(0, np.int32)]
    return PackedHulls(
        plane=np.concatenate([np.zeros(0, np.float32), *packed]),
        first=at[len(hulls) :].astype(np.int32),
        box=box.astype(np.float32),
        grid=np.array([[*g.low, *(1.0 / g.cell)] for g in grids], np.float32).reshape(-1, 6),
        cells=np.array([g.count for g in grids], np.int32).reshape(-1, 3),
        first_cell=first_cell[:-1].astype(np.int32),
        start=np.concatenate(none + [s + k for (_, s), k in zip(lists, at)]).astype(np.int32),
        around=around,
        overlap=np.array([_OVERLAP * g.cell.min() for g in grids], np.float32),
    )


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
    """Heights of a point over four planes."""
    at = np.uint64(four) * np.uint64(20)
    planes = shapes.hulls.plane
    a = (
        planes[at] * x
        + planes[at + np.uint64(4)] * y
        + planes[at + np.uint64(8)] * z
        - planes[at + np.uint64(12)]
    )
    b = (
        planes[at + np.uint64(1)] * x
        + planes[at + np.uint64(5)] * y
        + planes[at + np.uint64(9)] * z
        - planes[at + np.uint64(13)]
    )
    c = (
        planes[at + np.uint64(2)] * x
        + planes[at + np.uint64(6)] * y
        + planes[at + np.uint64(10)] * z
        - planes[at + np.uint64(14)]
    )
    d = (
        planes[at + np.uint64(3)] * x
        + planes[at + np.uint64(7)] * y
        + planes[at + np.uint64(11)] * z
        - planes[at + np.uint64(15)]
    )
    zero = np.float32(0.0)
    return (
        a if a > zero else a - planes[at + np.uint64(16)],
        b if b > zero else b - planes[at + np.uint64(17)],
        c if c > zero else c - planes[at + np.uint64(18)],
        d if d > zero else d - planes[at + np.uint64(19)],
    )


@lean_kernel(inner=True)
def two_highest(shapes, begin, end, x, y, z):
    """The two greatest heights of a point over planes, in fours from `begin` to `end` - 1.

    Returns:
        The greatest height, the one after it, and which plane has the greatest.
    """
    best = second = np.float32(-np.inf)
    which = np.int32(0)
    for four in range(begin, end):
        a, b, c, d = _four_heights(shapes, four, x, y, z)
        ab, ba = (a, b) if a > b else (b, a)
        cd, dc = (c, d) if c > d else (d, c)
        i = np.int32(0) if a > b else np.int32(1)
        j = np.int32(2) if c > d else np.int32(3)
        high, low = (ab, cd) if ab > cd else (cd, ab)
        i = (i if ab > cd else j) + np.int32(4) * np.int32(four)
        low = low if low > ba else ba
        low = low if low > dc else dc
        under = best if high > best else high
        second = second if second > under else under
        second = second if second > low else low
        which = i if high > best else which
        best = high if high > best else best
    return best, second, which


@lean_kernel(inner=True)
def planes_near(shapes, h, x, y, z, reach):
    """Where the planes stand that can be the nearest to a point, in fours: first, one past last.

    Args:
        shapes: Packed shapes with hulls.
        h: Which hull.
        x: Point in the hull's frame, in the hull's box inflated by `reach` [m].
        y: See `x`.
        z: See `x`.
        reach: Heights above this need not be known [m].
    """
    if reach <= shapes.hulls.around:
        cell = _cell_of(shapes, h, x, y, z)
        return shapes.hulls.start[cell], shapes.hulls.start[cell + np.uint64(1)]
    return shapes.hulls.first[h], shapes.hulls.first[h + 1]


@lean_kernel(inner=True)
def hull_normal(shapes, posed, k, plane):
    """Unit direction out of shape k, a hull, over a plane that `two_highest` told."""
    at = np.uint64(plane)
    at = np.uint64(20) * (at >> np.uint64(2)) + (at & np.uint64(3))
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
    begin, end = planes_near(shapes, h, x, y, z, reach)
    best = np.float32(-np.inf)
    found = np.uint64(0)
    for four in range(begin, end):
        a, b, c, d = _four_heights(shapes, four, x, y, z)
        highest = max(max(a, b), max(c, d))
        if highest > best:
            best = highest
            which = 0 if a == highest else (1 if b == highest else (2 if c == highest else 3))
            found = np.uint64(20 * four + which)
    if best > reach:
        return np.float32(np.inf), zero, zero, zero
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
