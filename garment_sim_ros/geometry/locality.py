"""Order of points in memory: near in space, near in memory, in compact blocks."""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import IntArray

BLOCK = 32
"""Points per block: contact tests reject colliders for a block at a time."""


def spatial_order(points: NDArray[np.floating]) -> IntArray:
    """An order of the points in which every aligned run of `BLOCK` points is compact.

    Sets of points are halved at the median of their longest extent, at a multiple of `BLOCK`,
    until one block is left. Equal coordinates keep their order.

    Args:
        points: Positions, shape [n, 3].

    Returns:
        Indices into `points`, shape [n].
    """
    points = np.asarray(points, dtype=np.float64)
    order = np.arange(len(points), dtype=np.int32)
    pending = [(0, len(points))]
    while pending:
        begin, end = pending.pop()
        part = order[begin:end]
        if len(part) > 1:
            axis = int(np.argmax(np.ptp(points[part], axis=0)))
            part = part[np.argsort(points[part, axis], kind="stable")]
            order[begin:end] = part
        if len(part) > BLOCK:
            middle = begin + -(-(end - begin) // BLOCK) // 2 * BLOCK
            pending += [(begin, middle), (middle, end)]
    return order


def near_together(points: NDArray[np.floating], triangles: IntArray) -> IntArray:
    """Triangles in an order in which every run of some is compact.

    Args:
        points: Their vertices, shape [v, 3].
        triangles: Vertex indices, shape [t, 3].

    Returns:
        The same triangles, shape [t, 3], read-only.
    """
    triangles = triangles[spatial_order(points[triangles].mean(axis=1))]
    triangles.setflags(write=False)
    return triangles
