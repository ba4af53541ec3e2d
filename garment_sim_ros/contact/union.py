"""Distance from points to a whole set of shapes."""

import numpy as np

from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.jit import kernel


@kernel()
def union_distance(shapes, posed, points, but, reach, result):
    """Distances to the surface of the nearest shape, negative inside.

    Args:
        shapes: `PackedShapes`.
        posed: `PosedShapes`.
        points: Positions about the local origin [m], float32, shape [n, 3].
        but: A shape that is left out, -1 for none.
        reach: Larger distances are given as this [m].
        result: Distances [m], output, shape [n].
    """
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        best = reach
        for k in range(shapes.kind.size):
            if k == but:
                continue
            qx = x - posed.bound[k, 0]
            qy = y - posed.bound[k, 1]
            qz = z - posed.bound[k, 2]
            t = qx * posed.bound[k, 3] + qy * posed.bound[k, 4] + qz * posed.bound[k, 5]
            t = min(max(t, np.float32(0.0)), posed.bound[k, 6])
            qx -= t * posed.bound[k, 3]
            qy -= t * posed.bound[k, 4]
            qz -= t * posed.bound[k, 5]
            far = posed.bound[k, 7] + max(best, np.float32(0.0))
            if qx * qx + qy * qy + qz * qz > far * far:
                continue
            d, _, _, _ = shape_distance(shapes, posed, k, x, y, z, best)
            best = min(best, d)
        result[p] = best
