"""Distances of a block of particles to one shape at a time, several particles at once.

What is not an exact distance here is a lower bound of it. These passes tell which particles need a
closer look, and which shape is the deepest; of hulls also which face, so that nothing is asked
twice. Of other shapes positions come from `contact.distance`.

The scratch array of a block is flat, `BLOCK` numbers for each quantity: with offsets that are
known when the kernel is compiled the loops run without branches, in the processor's vectors.
"""

import numpy as np
from numba import types
from numba.extending import overload

from garment_sim_ros.contact.kinds.hull import two_highest
from garment_sim_ros.contact.kinds.sdf import sdf_height
from garment_sim_ros.contact.shapes import KINDS
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.jit import lean_kernel

_ONE = np.uint64(1)
_TWO = np.uint64(2)
_THREE = np.uint64(3)
_CAPSULE = KINDS.index("capsule")

X, Y, Z = 0, BLOCK, 2 * BLOCK
"""Offsets: positions [m]."""
NEAREST, NEXT, WHICH = 3 * BLOCK, 4 * BLOCK, 5 * BLOCK
"""Distance to the nearest and the next shape under the cloth [m], and which the nearest is."""
OUTER = 6 * BLOCK
"""Distance to the nearest of all other shapes [m]."""
_U, _V, _W = 7 * BLOCK, 8 * BLOCK, 9 * BLOCK
"""Positions in the frame of the hull or grid at hand [m]."""
DISTANCE = 10 * BLOCK
"""Distance to the shape at hand [m]."""
PLANE, FIRM = 11 * BLOCK, 12 * BLOCK
"""If the nearest shape is a hull: its plane, and how far along it that stays the nearest [m].
Numbers of planes are exact in single precision up to a quarter of a gigabyte of them."""
_PLANE, _FIRM = 13 * BLOCK, 14 * BLOCK
"""The same of the hull at hand."""
ROWS = 15
_ROW_DISTANCE = np.uint64(DISTANCE)
_ROW_PLANE, _ROW_FIRM = np.uint64(_PLANE), np.uint64(_FIRM)
_ROW_U, _ROW_V, _ROW_W = np.uint64(_U), np.uint64(_V), np.uint64(_W)


@lean_kernel(inner=True)
def load_block(x, begin, end, block):
    """Copies positions of particles begin to end - 1; repeats the last one up to `BLOCK`.

    Args:
        x: Positions, flat [m], shape [3 n].
        begin: First particle.
        end: One after the last.
        block: Scratch, filled.

    Returns:
        Their box: lowest and highest x, y and z.
    """
    if end - begin == BLOCK:
        for p in range(BLOCK):
            block[X + p] = x[3 * (begin + p)]
            block[Y + p] = x[3 * (begin + p) + 1]
            block[Z + p] = x[3 * (begin + p) + 2]
    else:
        for p in range(BLOCK):
            q = 3 * min(begin + p, end - 1)
            block[X + p] = x[q]
            block[Y + p] = x[q + 1]
            block[Z + p] = x[q + 2]
    for p in range(BLOCK):
        block[NEAREST + p] = np.float32(np.inf)
        block[NEXT + p] = np.float32(np.inf)
        block[OUTER + p] = np.float32(np.inf)
        block[WHICH + p] = np.float32(-1.0)
    x0, x1 = _extremes(block, X + BLOCK)
    y0, y1 = _extremes(block, Y + BLOCK)
    z0, z1 = _extremes(block, Z + BLOCK)
    return x0, y0, z0, x1, y1, z1


@lean_kernel(inner=True)
def _lower(a, b):
    return a if a < b else b


@lean_kernel(inner=True)
def _higher(a, b):
    return a if a > b else b


@lean_kernel(inner=True)
def _extremes(numbers, end):
    """Lowest and highest of a block of numbers, in four chains at once."""
    begin = end - BLOCK
    at = np.uint64(begin)
    a0 = a1 = numbers[at]
    b0 = b1 = numbers[at + _ONE]
    c0 = c1 = numbers[at + _TWO]
    d0 = d1 = numbers[at + _THREE]
    for p in range(begin + 4, end, 4):
        at = np.uint64(p)
        a0 = _lower(a0, numbers[at])
        a1 = _higher(a1, numbers[at])
        b0 = _lower(b0, numbers[at + _ONE])
        b1 = _higher(b1, numbers[at + _ONE])
        c0 = _lower(c0, numbers[at + _TWO])
        c1 = _higher(c1, numbers[at + _TWO])
        d0 = _lower(d0, numbers[at + _THREE])
        d1 = _higher(d1, numbers[at + _THREE])
    return _lower(_lower(a0, b0), _lower(c0, d0)), _higher(_higher(a1, b1), _higher(c1, d1))


@lean_kernel(inner=True)
def capsule_distances(shapes, posed, k, block):
    """Distances of a block to the capsule that is, or else holds, shape k: to `DISTANCE`."""
    zero = np.float32(0.0)
    cx = posed.bound[k, 0]
    cy = posed.bound[k, 1]
    cz = posed.bound[k, 2]
    ax = posed.bound[k, 3]
    ay = posed.bound[k, 4]
    az = posed.bound[k, 5]
    length = posed.bound[k, 6]
    radius = posed.bound[k, 7]
    taper = lean = zero
    if shapes.kind[k] == _CAPSULE:
        radius = shapes.size[k, 0]
        taper = shapes.size[k, 1]
        lean = shapes.size[k, 3]
    for p in range(BLOCK):
        qx = block[X + p] - cx
        qy = block[Y + p] - cy
        qz = block[Z + p] - cz
        along = qx * ax + qy * ay + qz * az
        across = max(qx * qx + qy * qy + qz * qz - along * along, zero)
        t = along - lean * np.sqrt(across)
        t = zero if t < zero else (length if t > length else t)
        qx -= t * ax
        qy -= t * ay
        qz -= t * az
        block[DISTANCE + p] = np.sqrt(qx * qx + qy * qy + qz * qz) - radius + taper * t


@lean_kernel()
def hull_distances(shapes, posed, k, thickness, block, cell, lane):
    """Distances of a block to shape k, a hull: to `DISTANCE`; above `thickness` a lower bound.

    Args:
        shapes: Packed shapes with hulls.
        posed: The same, posed.
        k: Which one.
        thickness: Distances above this need not be known [m].
        block: The block's scratch.
        cell: Scratch: cell of the hull's grid that each particle is in, shape [BLOCK].
        lane: Scratch: particles in the hull's box, shape [BLOCK + 1].
    """
    zero = np.float32(0.0)
    cx = posed.centre[k, 0]
    cy = posed.centre[k, 1]
    cz = posed.centre[k, 2]
    r00, r01, r02 = posed.rotation[k, 0, 0], posed.rotation[k, 0, 1], posed.rotation[k, 0, 2]
    r10, r11, r12 = posed.rotation[k, 1, 0], posed.rotation[k, 1, 1], posed.rotation[k, 1, 2]
    r20, r21, r22 = posed.rotation[k, 2, 0], posed.rotation[k, 2, 1], posed.rotation[k, 2, 2]
    h = shapes.hull[k]
    x0 = shapes.hulls.box[h, 0]
    y0 = shapes.hulls.box[h, 1]
    z0 = shapes.hulls.box[h, 2]
    x1 = shapes.hulls.box[h, 3]
    y1 = shapes.hulls.box[h, 4]
    z1 = shapes.hulls.box[h, 5]
    gx = shapes.hulls.grid[h, 0]
    gy = shapes.hulls.grid[h, 1]
    gz = shapes.hulls.grid[h, 2]
    sx = shapes.hulls.grid[h, 3]
    sy = shapes.hulls.grid[h, 4]
    sz = shapes.hulls.grid[h, 5]
    nx = np.float32(shapes.hulls.cells[h, 0] - 1)
    ny = np.float32(shapes.hulls.cells[h, 1] - 1)
    nz = np.float32(shapes.hulls.cells[h, 2] - 1)
    stride_x = shapes.hulls.cells[h, 1] * shapes.hulls.cells[h, 2]
    stride_y = shapes.hulls.cells[h, 2]
    first = shapes.hulls.first_cell[h]
    for p in range(BLOCK):
        qx = block[X + p] - cx
        qy = block[Y + p] - cy
        qz = block[Z + p] - cz
        u = r00 * qx + r10 * qy + r20 * qz
        v = r01 * qx + r11 * qy + r21 * qz
        w = r02 * qx + r12 * qy + r22 * qz
        block[_U + p] = u
        block[_V + p] = v
        block[_W + p] = w
        block[DISTANCE + p] = _higher(
            _higher(_higher(x0 - u, u - x1), _higher(y0 - v, v - y1)), _higher(z0 - w, w - z1)
        )
        a = np.int32(_lower(_higher((u - gx) * sx, zero), nx))
        b = np.int32(_lower(_higher((v - gy) * sy, zero), ny))
        c = np.int32(_lower(_higher((w - gz) * sz, zero), nz))
        cell[p] = a * stride_x + b * stride_y + c + first
    found = 0
    for p in range(BLOCK):
        lane[found] = p
        found += 1 if block[DISTANCE + p] <= thickness else 0
    in_grid = thickness <= shapes.hulls.around
    # Beyond a grid distances are not known, beyond the overlap of its cells faces are not.
    most = shapes.hulls.around if in_grid else np.float32(np.inf)
    reach = shapes.hulls.overlap[h] if in_grid else np.float32(np.inf)
    for n in range(found):
        i = np.uint64(lane[n])
        begin, end = shapes.hulls.first[h], shapes.hulls.first[h + 1]
        if in_grid:
            at = np.uint64(cell[i])
            begin, end = shapes.hulls.start[at], shapes.hulls.start[at + _ONE]
        best, second, plane = two_highest(
            shapes, begin, end, block[i + _ROW_U], block[i + _ROW_V], block[i + _ROW_W]
        )
        block[i + _ROW_DISTANCE] = _lower(best, most)
        block[i + _ROW_PLANE] = np.float32(plane)
        # Inside, a plane that is buried may be the nearest as soon as it is crossed.
        block[i + _ROW_FIRM] = _lower(best - second, reach) if best > zero else zero


def hull_distances_if_any(shapes, posed, k, thickness, block, cell, lane):
    """As `hull_distances`; nothing where ``shapes.hulls`` is None."""
    if shapes.hulls is not None:
        hull_distances(shapes, posed, k, thickness, block, cell, lane)


@overload(hull_distances_if_any, inline="always")
def _compiled_hull_distances_if_any(shapes, posed, k, thickness, block, cell, lane):
    if isinstance(shapes.types[shapes.fields.index("hulls")], types.NoneType):
        return lambda shapes, posed, k, thickness, block, cell, lane: None
    return lambda shapes, posed, k, thickness, block, cell, lane: hull_distances(
        shapes, posed, k, thickness, block, cell, lane
    )


@lean_kernel()
def ellipsoid_distances(shapes, posed, k, block):
    """Raises the lower bounds in `DISTANCE` that shape k, an ellipsoid, has of its capsule.

    Scaled to a unit ball, a point at s from its centre is |s - 1| from it. No direction is
    scaled to less than the shortest radius, nor to more than the longest.
    """
    one = np.float32(1.0)
    cx = posed.centre[k, 0]
    cy = posed.centre[k, 1]
    cz = posed.centre[k, 2]
    rx = shapes.radii[k, 0]
    ry = shapes.radii[k, 1]
    rz = shapes.radii[k, 2]
    shortest = min(rx, ry, rz)
    longest = max(rx, ry, rz)
    u0 = posed.rotation[k, 0, 0] / rx
    u1 = posed.rotation[k, 1, 0] / rx
    u2 = posed.rotation[k, 2, 0] / rx
    v0 = posed.rotation[k, 0, 1] / ry
    v1 = posed.rotation[k, 1, 1] / ry
    v2 = posed.rotation[k, 2, 1] / ry
    w0 = posed.rotation[k, 0, 2] / rz
    w1 = posed.rotation[k, 1, 2] / rz
    w2 = posed.rotation[k, 2, 2] / rz
    for p in range(BLOCK):
        qx = block[X + p] - cx
        qy = block[Y + p] - cy
        qz = block[Z + p] - cz
        u = u0 * qx + u1 * qy + u2 * qz
        v = v0 * qx + v1 * qy + v2 * qz
        w = w0 * qx + w1 * qy + w2 * qz
        over = np.sqrt(u * u + v * v + w * w) - one
        bound = over * (shortest if over > np.float32(0.0) else longest)
        block[DISTANCE + p] = _higher(block[DISTANCE + p], bound)


def ellipsoid_distances_if_any(shapes, posed, k, block):
    """As `ellipsoid_distances`; nothing where ``shapes.radii`` is None."""
    if shapes.radii is not None:
        ellipsoid_distances(shapes, posed, k, block)


@overload(ellipsoid_distances_if_any, inline="always")
def _compiled_ellipsoid_distances_if_any(shapes, posed, k, block):
    if isinstance(shapes.types[shapes.fields.index("radii")], types.NoneType):
        return lambda shapes, posed, k, block: None
    return lambda shapes, posed, k, block: ellipsoid_distances(shapes, posed, k, block)


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
        block[_U + p] = u
        block[_V + p] = v
        block[_W + p] = w
        block[DISTANCE + p] = _higher(
            _higher(_higher(x0 - u, u - x1), _higher(y0 - v, v - y1)), _higher(z0 - w, w - z1)
        )
    found = 0
    for p in range(BLOCK):
        lane[found] = p
        found += 1 if block[DISTANCE + p] <= thickness else 0
    flat = np.float32(1.0) / shapes.grids.cell[g, 3]
    for n in range(found):
        i = np.uint64(lane[n])
        height = sdf_height(shapes, g, block[i + _ROW_U], block[i + _ROW_V], block[i + _ROW_W])
        # The interpolation may fall faster than the way to the surface is long.
        over = height - thickness
        block[i + _ROW_DISTANCE] = thickness + over * flat if over > np.float32(0.0) else height


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


@lean_kernel(inner=True)
def keep_nearest(k, block):
    """Notes the distances to shape k, which is under all of a block."""
    which = np.float32(k)
    for p in range(BLOCK):
        d = block[DISTANCE + p]
        n = block[NEAREST + p]
        closer = d < n
        other = n if closer else d
        block[NEXT + p] = min(block[NEXT + p], other)
        block[NEAREST + p] = d if closer else n
        block[WHICH + p] = which if closer else block[WHICH + p]
        block[PLANE + p] = block[_PLANE + p] if closer else block[PLANE + p]
        block[FIRM + p] = block[_FIRM + p] if closer else block[FIRM + p]


@lean_kernel(inner=True)
def keep_nearest_by_side(k, side, begin, block):
    """Notes the distances to shape k, which is under some particles of a block only."""
    which = np.float32(k)
    far = np.float32(np.inf)
    last = side.shape[1] - 1 - begin
    for p in range(BLOCK):
        d = block[DISTANCE + p]
        under = side[k, begin + min(p, last)] == 0
        outer = far if under else d
        d = d if under else far
        n = block[NEAREST + p]
        closer = d < n
        other = n if closer else d
        block[OUTER + p] = min(block[OUTER + p], outer)
        block[NEXT + p] = min(block[NEXT + p], other)
        block[NEAREST + p] = d if closer else n
        block[WHICH + p] = which if closer else block[WHICH + p]
        block[PLANE + p] = block[_PLANE + p] if closer else block[PLANE + p]
        block[FIRM + p] = block[_FIRM + p] if closer else block[FIRM + p]
