"""Point against convex hull: the signed distance to its planes, from a grid of candidates.

Inside, the distance is exact. Outside it is that to the nearest face's plane, as if faces were
moved out: less than the true distance off edges and corners.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.face_grid import face_grid
from garment_sim_ros.geometry.jit import kernel

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
IntArray = NDArray[np.int32]

_AROUND = 0.006
"""How far out the grid knows distances [m]; beyond, all planes are asked."""


class PackedHulls(NamedTuple):
    """Hulls as flat arrays.

    Attributes:
        plane: Outward unit normals and offsets of all faces of all hulls, shape [f, 4].
        first_plane: Where each hull's planes start, one more at the end, shape [h + 1].
        box: Lowest and highest corner of each hull [m], shape [h, 6].
        grid: Lowest corner of each hull's grid [m], and cells per length, shape [h, 6].
        cells: Cells along each axis, shape [h, 3].
        first_cell: Where each hull's cells start in `start`, shape [h].
        start: Where each cell's faces start in `face`, shape [all cells + h].
        face: Indices into `plane`.
    """

    plane: SingleArray
    first_plane: IntArray
    box: SingleArray
    grid: SingleArray
    cells: IntArray
    first_cell: IntArray
    start: IntArray
    face: IntArray


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


def pack_hulls(hulls: Mapping[str, tuple[object, object]]) -> PackedHulls:
    """Hulls given by name, vertices and outward faces, as flat arrays.

    Raises:
        GeometryError: One is not a closed convex polyhedron.
    """
    planes, boxes, grids = [], [], []
    for name, (vertices, faces) in hulls.items():
        try:
            own = hull_planes(vertices, faces)
        except GeometryError as error:
            raise GeometryError(f"collider {name!r}: {error}") from None
        x = np.asarray(vertices, dtype=np.float64)
        planes.append(own)
        low, high = x.min(axis=0), x.max(axis=0)
        boxes.append([*low, *high])
        grids.append(face_grid(own, low - _AROUND, high + _AROUND, far=_AROUND))
    first_plane = np.cumsum([0, *(len(p) for p in planes)])
    first_cell = np.cumsum([0, *(len(g.start) for g in grids)])
    first_face = np.cumsum([0, *(len(g.face) for g in grids)])
    joined: list[NDArray[np.int32]] = [np.zeros(0, np.int32)]
    return PackedHulls(
        plane=np.concatenate([np.zeros((0, 4)), *planes]).astype(np.float32),
        first_plane=first_plane.astype(np.int32),
        box=np.array(boxes, np.float32).reshape(-1, 6),
        grid=np.array([[*g.low, *(1.0 / g.cell)] for g in grids], np.float32).reshape(-1, 6),
        cells=np.array([g.count for g in grids], np.int32).reshape(-1, 3),
        first_cell=first_cell[:-1].astype(np.int32),
        start=np.concatenate(joined + [g.start + at for g, at in zip(grids, first_face)]).astype(
            np.int32
        ),
        face=np.concatenate(joined + [g.face + at for g, at in zip(grids, first_plane)]).astype(
            np.int32
        ),
    )


@kernel(forceinline=True)
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
    best = np.float32(-np.inf)
    found = -1
    if reach <= np.float32(_AROUND):
        i = np.int32((x - shapes.hulls.grid[h, 0]) * shapes.hulls.grid[h, 3])
        j = np.int32((y - shapes.hulls.grid[h, 1]) * shapes.hulls.grid[h, 4])
        m = np.int32((z - shapes.hulls.grid[h, 2]) * shapes.hulls.grid[h, 5])
        # At the rim of the grid rounding may lead one cell out of it.
        i = min(i, shapes.hulls.cells[h, 0] - 1)
        j = min(j, shapes.hulls.cells[h, 1] - 1)
        m = min(m, shapes.hulls.cells[h, 2] - 1)
        cell = (i * shapes.hulls.cells[h, 1] + j) * shapes.hulls.cells[h, 2] + m
        cell += shapes.hulls.first_cell[h]
        for at in range(shapes.hulls.start[cell], shapes.hulls.start[cell + 1]):
            f = shapes.hulls.face[at]
            height = (
                shapes.hulls.plane[f, 0] * x
                + shapes.hulls.plane[f, 1] * y
                + shapes.hulls.plane[f, 2] * z
                - shapes.hulls.plane[f, 3]
            )
            if height > best:
                best = height
                found = f
    else:
        for f in range(shapes.hulls.first_plane[h], shapes.hulls.first_plane[h + 1]):
            height = (
                shapes.hulls.plane[f, 0] * x
                + shapes.hulls.plane[f, 1] * y
                + shapes.hulls.plane[f, 2] * z
                - shapes.hulls.plane[f, 3]
            )
            if height > best:
                best = height
                found = f
    if found < 0 or best > reach:
        return np.float32(np.inf), zero, zero, zero
    nx = shapes.hulls.plane[found, 0]
    ny = shapes.hulls.plane[found, 1]
    nz = shapes.hulls.plane[found, 2]
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
