"""The kind ``sdf``: a sampled signed distance; see `distance_grid`, whose numbers these are."""

import numpy as np
from numba import types
from numba.extending import overload

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.contact.block import (
    DISTANCE,
    ROW_DISTANCE,
    ROW_U,
    ROW_V,
    ROW_W,
    U,
    V,
    W,
    X,
    Y,
    Z,
    higher,
)
from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
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
)
from garment_sim_ros.contact.kinds.packed_grids import PackedGrids, pack_grids
from garment_sim_ros.contact.kinds.packed_hulls import hull_bound
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.geometry.marching_tetrahedra import marching_tetrahedra
from garment_sim_ros.jit import lean_kernel

_ONE = np.uint64(1)
_FEWEST = 20
"""Samples inside that a shape needs to stand for something in cloth."""


@lean_kernel(inner=True)
def _within(value, last):
    """A coordinate in cells, moved into the grid."""
    value = value if value > np.float32(0.0) else np.float32(0.0)  # also where it is no number
    return value if value < last else last


@lean_kernel(inner=True)
def _cell_of(shapes, g, x, y, z):
    """The cell of grid g that is the nearest to a point in its frame.

    Returns:
        Where its samples start, the strides along x and y, where in the cell the nearest place is,
        0 to 1, and how far beyond the point is, in cells: along x, y and z each.
    """
    per = shapes.grids.cell[g, 1]
    mx = shapes.grids.middle[g, 0]
    my = shapes.grids.middle[g, 1]
    mz = shapes.grids.middle[g, 2]
    u = x * per + mx
    v = y * per + my
    w = z * per + mz
    a = _within(u, mx + mx)
    b = _within(v, my + my)
    c = _within(w, mz + mz)
    ny = shapes.grids.nodes[g, 1]
    nz = shapes.grids.nodes[g, 2]
    i = min(np.int32(a), shapes.grids.nodes[g, 0] - np.int32(2))
    j = min(np.int32(b), ny - np.int32(2))
    k = min(np.int32(c), nz - np.int32(2))
    first = np.uint64(shapes.grids.first[g] + (i * ny + j) * nz + k)
    along_x = np.uint64(ny * nz)
    along_y = np.uint64(nz)
    return (
        first,
        along_x,
        along_y,
        a - np.float32(i),
        b - np.float32(j),
        c - np.float32(k),
        u - a,
        v - b,
        w - c,
    )


@lean_kernel(inner=True)
def _samples(shapes, first, along_x, along_y):
    """The eight samples of a cell, z fastest."""
    at = first + along_y
    far = first + along_x
    corner = far + along_y
    return (
        np.float32(shapes.grids.sample[first]),
        np.float32(shapes.grids.sample[first + _ONE]),
        np.float32(shapes.grids.sample[at]),
        np.float32(shapes.grids.sample[at + _ONE]),
        np.float32(shapes.grids.sample[far]),
        np.float32(shapes.grids.sample[far + _ONE]),
        np.float32(shapes.grids.sample[corner]),
        np.float32(shapes.grids.sample[corner + _ONE]),
    )


@lean_kernel(inner=True)
def sdf_height(shapes, g, x, y, z):
    """Signed distance of a point to grid g, both in the grid's frame [m]; beyond it a bound."""
    first, along_x, along_y, a, b, c, u, v, w = _cell_of(shapes, g, x, y, z)
    s000, s001, s010, s011, s100, s101, s110, s111 = _samples(shapes, first, along_x, along_y)
    s00 = s000 + c * (s001 - s000)
    s01 = s010 + c * (s011 - s010)
    s10 = s100 + c * (s101 - s100)
    s11 = s110 + c * (s111 - s110)
    s0 = s00 + b * (s01 - s00)
    s1 = s10 + b * (s11 - s10)
    value = (s0 + a * (s1 - s0)) * shapes.grids.cell[g, 2]
    beyond = u * u + v * v + w * w
    if beyond > np.float32(0.0):
        value = max(value, np.float32(0.0))
        cell = shapes.grids.cell[g, 0]
        return np.sqrt(beyond * cell * cell + value * value)
    return value


@lean_kernel(inner=True)
def sdf_distance(shapes, posed, k, qx, qy, qz, reach):
    """Signed distance to shape k, an sdf, infinite above `reach`, and the unit direction out.

    Args:
        shapes: Packed shapes with grids.
        posed: The same, posed.
        k: Which one.
        qx: Point relative to the origin of the grid's frame [m].
        qy: See `qx`.
        qz: See `qx`.
        reach: Distances above this need not be known [m].
    """
    zero = np.float32(0.0)
    one = np.float32(1.0)
    r00, r01, r02 = posed.rotation[k, 0, 0], posed.rotation[k, 0, 1], posed.rotation[k, 0, 2]
    r10, r11, r12 = posed.rotation[k, 1, 0], posed.rotation[k, 1, 1], posed.rotation[k, 1, 2]
    r20, r21, r22 = posed.rotation[k, 2, 0], posed.rotation[k, 2, 1], posed.rotation[k, 2, 2]
    x = r00 * qx + r10 * qy + r20 * qz
    y = r01 * qx + r11 * qy + r21 * qz
    z = r02 * qx + r12 * qy + r22 * qz
    g = shapes.hull[k]
    low = min(x - shapes.grids.box[g, 0], y - shapes.grids.box[g, 1], z - shapes.grids.box[g, 2])
    high = max(x - shapes.grids.box[g, 3], y - shapes.grids.box[g, 4], z - shapes.grids.box[g, 5])
    if low < -reach or high > reach:
        return np.float32(np.inf), zero, zero, zero
    first, along_x, along_y, a, b, c, u, v, w = _cell_of(shapes, g, x, y, z)
    s000, s001, s010, s011, s100, s101, s110, s111 = _samples(shapes, first, along_x, along_y)
    s00 = s000 + c * (s001 - s000)
    s01 = s010 + c * (s011 - s010)
    s10 = s100 + c * (s101 - s100)
    s11 = s110 + c * (s111 - s110)
    s0 = s00 + b * (s01 - s00)
    s1 = s10 + b * (s11 - s10)
    nx = s1 - s0
    ny = (one - a) * (s01 - s00) + a * (s11 - s10)
    z0 = (one - b) * (s001 - s000) + b * (s011 - s010)
    z1 = (one - b) * (s101 - s100) + b * (s111 - s110)
    nz = (one - a) * z0 + a * z1
    value = (s0 + a * nx) * shapes.grids.cell[g, 2]
    beyond = u * u + v * v + w * w
    if beyond > zero:
        cell = shapes.grids.cell[g, 0]
        value = max(value, zero)
        # Away from the nearest place of the grid, and on from there.
        steep = value / max(np.sqrt(nx * nx + ny * ny + nz * nz), np.float32(1e-6))
        nx = nx * steep + u * cell
        ny = ny * steep + v * cell
        nz = nz * steep + w * cell
        value = np.sqrt(beyond * cell * cell + value * value)
    if value > reach:
        return np.float32(np.inf), zero, zero, zero
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length > zero:
        length = one / length
        nx *= length
        ny *= length
        nz *= length
    else:  # in the middle between two sides
        nx = one
    return (
        value,
        r00 * nx + r01 * ny + r02 * nz,
        r10 * nx + r11 * ny + r12 * nz,
        r20 * nx + r21 * ny + r22 * nz,
    )


def sdf_distance_if_any(shapes, posed, k, qx, qy, qz, reach):
    """As `sdf_distance`; infinite, at no cost, where ``shapes.grids`` is None."""
    if shapes.grids is None:
        return np.float32(np.inf), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    return sdf_distance(shapes, posed, k, qx, qy, qz, reach)


@overload(sdf_distance_if_any, inline="always")
def _compiled_sdf_distance_if_any(shapes, posed, k, qx, qy, qz, reach):
    # Decided by type, as for hulls.
    if isinstance(shapes.types[shapes.fields.index("grids")], types.NoneType):
        return lambda shapes, posed, k, qx, qy, qz, reach: (
            np.float32(np.inf),
            np.float32(0.0),
            np.float32(0.0),
            np.float32(0.0),
        )
    return lambda shapes, posed, k, qx, qy, qz, reach: sdf_distance(
        shapes, posed, k, qx, qy, qz, reach
    )


@lean_kernel()
def sdf_distances(shapes, posed, k, thickness, block, lane):
    """Distances of a block to shape k, an sdf: to `DISTANCE`; above `thickness` a lower bound.

    Args:
        shapes: Packed shapes with grids.
        posed: The same, posed.
        k: Which one.
        thickness: Distances above this need not be known [m].
        block: The block's scratch.
        lane: Scratch: particles in the shape's box, shape [BLOCK + 1].
    """
    cx = posed.centre[k, 0]
    cy = posed.centre[k, 1]
    cz = posed.centre[k, 2]
    r00, r01, r02 = posed.rotation[k, 0, 0], posed.rotation[k, 0, 1], posed.rotation[k, 0, 2]
    r10, r11, r12 = posed.rotation[k, 1, 0], posed.rotation[k, 1, 1], posed.rotation[k, 1, 2]
    r20, r21, r22 = posed.rotation[k, 2, 0], posed.rotation[k, 2, 1], posed.rotation[k, 2, 2]
    g = shapes.hull[k]
    x0 = shapes.grids.box[g, 0]
    y0 = shapes.grids.box[g, 1]
    z0 = shapes.grids.box[g, 2]
    x1 = shapes.grids.box[g, 3]
    y1 = shapes.grids.box[g, 4]
    z1 = shapes.grids.box[g, 5]
    for p in range(BLOCK):
        qx = block[X + p] - cx
        qy = block[Y + p] - cy
        qz = block[Z + p] - cz
        u = r00 * qx + r10 * qy + r20 * qz
        v = r01 * qx + r11 * qy + r21 * qz
        w = r02 * qx + r12 * qy + r22 * qz
        block[U + p] = u
        block[V + p] = v
        block[W + p] = w
        block[DISTANCE + p] = higher(
            higher(higher(x0 - u, u - x1), higher(y0 - v, v - y1)), higher(z0 - w, w - z1)
        )
    found = 0
    for p in range(BLOCK):
        lane[found] = p
        found += 1 if block[DISTANCE + p] <= thickness else 0
    flat = np.float32(1.0) / shapes.grids.cell[g, 3]
    for n in range(found):
        i = np.uint64(lane[n])
        height = sdf_height(shapes, g, block[i + ROW_U], block[i + ROW_V], block[i + ROW_W])
        # The interpolation may fall faster than the way to the surface is long.
        over = height - thickness
        block[i + ROW_DISTANCE] = thickness + over * flat if over > np.float32(0.0) else height


def sdf_distances_if_any(shapes, posed, k, thickness, block, lane):
    """As `sdf_distances`; nothing where ``shapes.grids`` is None."""
    if shapes.grids is not None:
        sdf_distances(shapes, posed, k, thickness, block, lane)


@overload(sdf_distances_if_any, inline="always")
def _compiled_sdf_distances_if_any(shapes, posed, k, thickness, block, lane):
    if isinstance(shapes.types[shapes.fields.index("grids")], types.NoneType):
        return lambda shapes, posed, k, thickness, block, lane: None
    return lambda shapes, posed, k, thickness, block, lane: sdf_distances(
        shapes, posed, k, thickness, block, lane
    )


def _parse(entries: Entries) -> dict[str, object]:
    grid = DistanceGrid(
        cell=entries.number("cell", 1e-9),
        step=entries.number("step", 1e-12),
        distance=entries.samples("distance"),
    )
    return {**grid.geometry(), **entries.share()}


def _size(geometry: Geometry) -> Size:
    return NO_SIZE


def _bound(geometry: Geometry) -> tuple[float, ...]:
    return hull_bound(DistanceGrid.of(geometry).rim())


def _inscribed_radius(geometry: Geometry) -> float:
    grid = DistanceGrid.of(geometry)
    return max(-float(grid.distance.min()) * grid.step, 0.0)


def _surface(geometry: Geometry, points: int, finest: float) -> Surface:
    """Where the distance is 0; sampled anew where that is finer than asked for."""
    grid = DistanceGrid.of(geometry)
    if finest <= grid.cell:
        field = grid.distance.astype(np.float64)
        return Surface(*marching_tetrahedra(field, grid.low, grid.cell))
    box = grid.box()
    low = box[:3] - finest
    nx, ny, nz = (int(n) + 1 for n in np.ceil((box[3:] + finest - low) / finest))
    at = low + finest * np.indices((nx, ny, nz)).reshape(3, -1).T
    return Surface(*marching_tetrahedra(grid.value(at).reshape(nx, ny, nz), low, finest))


def _clouds(geometry: Geometry) -> tuple[Cloud, ...]:
    grid = DistanceGrid.of(geometry)
    middle = 0.5 * (np.array(grid.distance.shape) - 1)
    points = grid.cell * (np.argwhere(grid.distance < 0) - middle)
    return (Cloud(points),) if len(points) >= _FEWEST and np.ptp(points, axis=0).all() else ()


def _distance(geometry: Geometry, points: FloatArray) -> FloatArray:
    return DistanceGrid.of(geometry).value(points)


def _arrays(own: Own) -> tuple[PackedGrids, SingleArray]:
    packed = pack_grids(own.geometry)
    return packed, packed.box


_FROM_MIDDLE = 0.02 * (np.indices((13, 13, 13)).transpose(1, 2, 3, 0) - 6.0)
_BALL = DistanceGrid.sampled(0.02, np.linalg.norm(_FROM_MIDDLE, axis=-1) - 0.1)

SDF = Kind(
    name="sdf",
    code=4,
    keys=("cell", "step", "distance"),
    optional=("share",),
    parse=_parse,
    shape=Shape(
        size=_size,
        bound=_bound,
        inscribed_radius=_inscribed_radius,
        surface=_surface,
        table="grids",
        arrays=_arrays,
        distance=_distance,
    ),
    clouds=_clouds,
    variants={"sdf": _BALL.geometry()},
)
"""Size: nothing; see `PackedGrids`."""
