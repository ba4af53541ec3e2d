"""Hulls as flat arrays, with a grid that tells which of their faces can be the nearest.

Inside, the distance is exact, but for faces that lie inside other hulls, see `buried_faces`: there
is no way out through them. Outside it is that to the nearest face's plane, as if faces were moved
out: less than the true distance off edges and corners.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.kinds.face_grid import FaceGrid, face_grid
from garment_sim_ros.errors import GeometryError

_AROUND = 0.025
"""How far out the grids know distances, as a share of the largest hull: 1 cm on a human's trunk.
Beyond, all planes are asked."""
_FAR = 1e30
LISTED = 8
"""Numbers of a cell: 16 bytes, read at once. One in a hundred cells has more than 7 fours."""
WHOLE = 65535
"""Instead of a count: all of the hull's fours."""
_OVERLAP = 0.1
"""How far beyond a cell of the grids its list of planes holds, too, as a share of the cell."""


class PackedHulls(NamedTuple):
    """Hulls as flat arrays.

    Planes stand in fours that look in similar directions, so that four heights are found at once:
    four normals' x, y and z, the offsets, and how much farther away planes are for points below
    them, which is nothing or, where they are buried, very much. A hull's last four ends with
    planes that all is far below. Cells list the fours that hold a plane that can be the
    nearest: planes themselves, once for each cell, would be fifty times as much to read, more
    than a processor keeps at hand.

    Attributes:
        plane: The planes, flat, hull by hull.
        first: Where each hull's planes start among the fours, one more at the end, shape [h + 1].
        box: Lowest and highest corner of each hull [m], shape [h, 6].
        grid: Lowest corner of each hull's grid [m], and cells per length, shape [h, 6].
        cells: Cells along each axis, shape [h, 3].
        first_cell: Where each hull's cells start among all, shape [h].
        near: `LISTED` numbers for each cell and one more: which of its hull's own fours, from 0
            on, may be the nearest; the last says how many these are, or `WHOLE`; flat.
        around: How far out the grids know distances [m].
        overlap: How far beyond a cell of each hull its list holds, too [m], shape [h].
    """

    plane: SingleArray
    first: IntArray
    box: SingleArray
    grid: SingleArray
    cells: IntArray
    first_cell: IntArray
    near: NDArray[np.uint16]
    around: np.float32
    overlap: SingleArray


def _groups(planes: FloatArray) -> IntArray:
    """The four that each plane goes to, with those that look in similar directions, shape [f].

    Directions are halved across where they are widest, until four are left; the last has the rest.
    """
    group = np.zeros(len(planes), np.int32)
    parts, number = [np.arange(len(planes))], 0
    while parts:
        part = parts.pop()
        if len(part) <= 4:
            group[part] = number
            number += 1
            continue
        axis = int(np.argmax(np.ptp(planes[part, :3], axis=0)))
        order = part[np.argsort(planes[part, axis], kind="stable")]
        half = -(-len(part) // 8) * 4
        parts += [order[half:], order[:half]]
    return group


def _in_fours(planes: FloatArray, group: IntArray) -> SingleArray:
    """Planes with their groups together, the last one padded, flat."""
    order = np.argsort(group, kind="stable")
    missing = -len(planes) % 4
    full = np.vstack([planes[order], np.tile([0.0, 0.0, 0.0, _FAR, 0.0], (missing, 1))])
    return np.ascontiguousarray(full.reshape(-1, 4, 5).transpose(0, 2, 1), np.float32).ravel()


def _listed(grid: FaceGrid, group: IntArray) -> NDArray[np.uint16]:
    """The numbers of each cell: the groups of its planes, and how many these are."""
    cells, groups = len(grid.start) - 1, int(group.max()) + 1
    cell = np.repeat(np.arange(cells), np.diff(grid.start))
    row, which = np.divmod(np.unique(cell * groups + group[grid.face]), groups)
    count = np.bincount(row, minlength=cells)
    slot = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    near = np.zeros((cells, LISTED), np.uint16)
    listed = (count < LISTED) & (groups <= WHOLE)
    fits = listed[row]
    near[row[fits], slot[fits]] = which[fits]
    near[:, -1] = np.where(listed, count, WHOLE)
    return near.ravel()


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
    cells = len(grid.start) - 1
    cell, other = (np.repeat(np.arange(cells), np.diff(g.start)) for g in (grid, inner))
    both = np.concatenate(
        [cell * len(planes) + grid.face, other * len(planes) + exposed[inner.face]]
    )
    # Cells that are far outside stay empty.
    listed = np.unique(both[np.diff(grid.start)[both // len(planes)] > 0])
    count = np.bincount(listed // len(planes), minlength=cells)
    start = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    face = (listed % len(planes)).astype(np.int32)
    return replace(grid, start=start, face=face)


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
    groups = [_groups(own) for own in planes]
    packed = [
        _in_fours(np.column_stack([own, _FAR * under]), group)
        for own, under, group in zip(planes, hidden, groups)
    ]
    lists = [_listed(grid, group) for grid, group in zip(grids, groups)]
    whole = np.full(LISTED, WHOLE, np.uint16)
    return PackedHulls(
        plane=np.concatenate([np.zeros(0, np.float32), *packed]),
        first=np.cumsum([0, *(len(p) // 20 for p in packed)]).astype(np.int32),
        box=box.astype(np.float32),
        grid=np.array([[*g.low, *(1.0 / g.cell)] for g in grids], np.float32).reshape(-1, 6),
        cells=np.array([g.count for g in grids], np.int32).reshape(-1, 3),
        first_cell=np.cumsum([0, *(len(n) // LISTED for n in lists)])[:-1].astype(np.int32),
        near=np.concatenate([*lists, whole]),
        around=around,
        overlap=np.array([_OVERLAP * g.cell.min() for g in grids], np.float32),
    )
