"""Signed distance to any shape, of a point or a block, and which of several is the deepest.

Kernels cannot call what a record holds: here is what they call instead, by the kind's code.
"""

import numpy as np

from garment_sim_ros.contact.block import FIRM, NEAREST, PLANE
from garment_sim_ros.contact.kinds.capsule import CAPSULE, capsule_distance, capsule_distances
from garment_sim_ros.contact.kinds.ellipsoid import (
    ELLIPSOID,
    ellipsoid_distance_if_any,
    ellipsoid_distances_if_any,
)
from garment_sim_ros.contact.kinds.hull import HULL, hull_distance_if_any, hull_normal_if_any
from garment_sim_ros.contact.kinds.hull_block import hull_distances_if_any
from garment_sim_ros.contact.kinds.sdf import SDF, sdf_distance_if_any, sdf_distances_if_any
from garment_sim_ros.contact.kinds.sphere import SPHERE, sphere_distance
from garment_sim_ros.jit import lean_kernel

_SPHERE = SPHERE.code
_CAPSULE = CAPSULE.code
_ELLIPSOID = ELLIPSOID.code
_HULL = HULL.code
_SDF = SDF.code


@lean_kernel(inner=True)
def shape_distance(shapes, posed, k, px, py, pz, reach):
    """Signed distance of a point to shape k, infinite above `reach`, and the direction out."""
    qx = px - posed.centre[k, 0]
    qy = py - posed.centre[k, 1]
    qz = pz - posed.centre[k, 2]
    if shapes.kind[k] == _SPHERE:
        return sphere_distance(qx, qy, qz, shapes.size[k, 0], reach)
    if shapes.kind[k] == _HULL:
        return hull_distance_if_any(shapes, posed, k, qx, qy, qz, reach)
    if shapes.kind[k] == _ELLIPSOID:
        return ellipsoid_distance_if_any(shapes, posed, k, qx, qy, qz, reach)
    if shapes.kind[k] == _SDF:
        return sdf_distance_if_any(shapes, posed, k, qx, qy, qz, reach)
    return capsule_distance(
        qx,
        qy,
        qz,
        posed.rotation[k, 0, 2],
        posed.rotation[k, 1, 2],
        posed.rotation[k, 2, 2],
        shapes.size[k, 0],
        shapes.size[k, 1],
        shapes.size[k, 2],
        shapes.size[k, 3],
        reach,
    )


@lean_kernel(inner=True)
def shape_distances(shapes, posed, k, thickness, block, cell, lane):
    """Distances of a block to shape k: to `DISTANCE`; above `thickness` lower bounds.

    Args: as `hull_distances`.
    """
    kind = shapes.kind[k]
    if kind == _HULL:
        hull_distances_if_any(shapes, posed, k, thickness, block, cell, lane)
    elif kind == _SDF:
        sdf_distances_if_any(shapes, posed, k, thickness, block, lane)
    else:
        capsule_distances(shapes, posed, k, block, kind == _CAPSULE)
        if kind == _ELLIPSOID:
            ellipsoid_distances_if_any(shapes, posed, k, block)


@lean_kernel(inner=True)
def nearest_of_block(shapes, posed, k, block, lane, px, py, pz, reach):
    """As `shape_distance` of a particle in a block to shape k, the nearest by `keep_nearest`.

    Returns:
        Distance and direction, and how far along the surface they stay as they are, at least [m].
    """
    if shapes.kind[k] == _HULL:
        nx, ny, nz = hull_normal_if_any(shapes, posed, k, block[PLANE + lane])
        return block[NEAREST + lane], nx, ny, nz, block[FIRM + lane]
    d, nx, ny, nz = shape_distance(shapes, posed, np.int64(k), px, py, pz, reach)
    return d, nx, ny, nz, np.float32(0.0)


@lean_kernel(inner=True)
def deepest_shape(shapes, posed, near, least, count, moved, point, reach, known, outside):
    """The one of some shapes that is nearest to a point, signed.

    Args:
        shapes: Packed shapes.
        posed: The same, posed.
        near: The shapes to look at, the first `count`.
        least: Lower bounds of their distances where the point was before [m].
        count: Their number.
        moved: How far the point has come since [m].
        point: The point [m].
        reach: Distances above this need not be known [m].
        known: A shape whose distance is known; -1 for none.
        outside: That distance [m], infinite for none, and the unit direction out of the shape.

    Returns:
        Distance [m], unit direction out of the shape, and the shape's index; infinity and -1
        where no distance is at most `reach`.
    """
    best, bx, by, bz = outside
    found = known
    for c in range(count):
        k = np.int64(near[c])
        if least[c] - moved > min(best, reach) or k == known:
            continue
        d, nx, ny, nz = shape_distance(shapes, posed, k, point[0], point[1], point[2], reach)
        if d < best:
            best = d
            bx = nx
            by = ny
            bz = nz
            found = np.int64(k)
    return best, bx, by, bz, found
