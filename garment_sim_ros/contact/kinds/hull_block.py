"""A block of particles against a hull."""

import numpy as np
from numba import types
from numba.extending import overload

from garment_sim_ros.contact.block import (
    DISTANCE,
    ROW_DISTANCE,
    ROW_FIRM,
    ROW_PLANE,
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
    lower,
)
from garment_sim_ros.contact.kinds.hull import two_highest, whole_hull
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.jit import lean_kernel


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
        block[U + p] = u
        block[V + p] = v
        block[W + p] = w
        block[DISTANCE + p] = higher(
            higher(higher(x0 - u, u - x1), higher(y0 - v, v - y1)), higher(z0 - w, w - z1)
        )
        a = np.int32(lower(higher((u - gx) * sx, zero), nx))
        b = np.int32(lower(higher((v - gy) * sy, zero), ny))
        c = np.int32(lower(higher((w - gz) * sz, zero), nz))
        cell[p] = a * stride_x + b * stride_y + c + first
    found = 0
    for p in range(BLOCK):
        lane[found] = p
        found += 1 if block[DISTANCE + p] <= thickness else 0
    whole = whole_hull(shapes)
    in_grid = thickness <= shapes.hulls.around
    # Beyond a grid distances are not known, beyond the overlap of its cells faces are not.
    most = shapes.hulls.around if in_grid else np.float32(np.inf)
    reach = shapes.hulls.overlap[h] if in_grid else np.float32(np.inf)
    for n in range(found):
        i = np.uint64(lane[n])
        best, second, plane = two_highest(
            shapes,
            h,
            np.uint64(cell[i]) if in_grid else whole,
            block[i + ROW_U],
            block[i + ROW_V],
            block[i + ROW_W],
        )
        block[i + ROW_DISTANCE] = lower(best, most)
        block[i + ROW_PLANE] = plane
        # Inside, a plane that is buried may be the nearest as soon as it is crossed.
        block[i + ROW_FIRM] = lower(best - second, reach) if best > zero else zero


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
