"""Point against a sampled signed distance; see `distance_grid`, whose numbers these are."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.jit import lean_kernel

_ONE = np.uint64(1)


class PackedGrids(NamedTuple):
    """Distance grids as flat arrays.

    Attributes:
        sample: All samples, grid by grid, x slowest, flat.
        first: Where each grid starts, shape [g].
        nodes: Samples along each axis, shape [g, 3].
        middle: Half of the cells along each axis, shape [g, 3].
        cell: Cell [m], cells per length, metres per unit of a sample, and how steep the
            interpolation is at most, shape [g, 4].
        box: Lowest and highest corner of each shape's box [m], shape [g, 6].
    """

    sample: NDArray[np.int16]
    first: IntArray
    nodes: IntArray
    middle: SingleArray
    cell: SingleArray
    box: SingleArray


def pack_grids(geometries: Mapping[str, Mapping[str, object]]) -> PackedGrids:
    """Grids given by a collider's name and geometry, as flat arrays.

    Raises:
        GeometryError: Unusable numbers.
    """
    grids = []
    for name, geometry in geometries.items():
        try:
            grids.append(DistanceGrid.of(geometry))
        except (TypeError, ValueError, GeometryError) as error:
            raise GeometryError(f"collider {name!r}: {error}") from None
    nodes = np.array([g.distance.shape for g in grids], np.int32).reshape(-1, 3)
    return PackedGrids(
        sample=np.concatenate([g.distance.ravel() for g in grids]),
        first=np.cumsum([0, *(g.distance.size for g in grids)])[:-1].astype(np.int32),
        nodes=nodes,
        middle=(0.5 * (nodes - 1.0)).astype(np.float32),
        cell=np.array(
            [[g.cell, 1.0 / g.cell, g.step, g.steepest()] for g in grids], np.float32
        ).reshape(-1, 4),
        box=np.array([g.box() for g in grids], np.float32).reshape(-1, 6),
    )


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
