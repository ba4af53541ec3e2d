"""Distances of all nodes of a grid to a triangle mesh, by sweeping closest triangles.

Nodes around a triangle are told its distance; then each node takes over its neighbours' closest
triangle where the point on it is closer than its own, in sweeps along all eight diagonals.
After: Tsai 2002, "Rapid and accurate computation of the distance function using grids". Every
distance is exactly that to some triangle, near the mesh the closest one, far from it nearly so.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.geometry.mesh_distance import closest_point
from garment_sim_ros.jit import exact_kernel


def grid_distances(
    points: FloatArray, triangles: NDArray[np.int32], count: NDArray[np.int64]
) -> FloatArray:
    """Distance of every node to the nearest triangle, in cells, shape [nx, ny, nz].

    Args:
        points: Corners in cells from the first node, shape [v, 3].
        triangles: At least one, shape [t, 3].
        count: Nodes along x, y and z.
    """
    squared = np.full(tuple(count), np.inf)
    nearest = np.full(tuple(count), -1, np.int32)
    foot = np.zeros((*count, 3))
    _sweep(np.ascontiguousarray(points), triangles, nearest, foot, squared)
    return np.sqrt(squared)


@exact_kernel(inner=True)
def _offer(x, triangles, t, i, j, k, nearest, foot, squared):
    """Notes triangle t where it is closer to a node than what that has."""
    d2, px, py, pz, _ = closest_point(x, triangles[t], float(i), float(j), float(k))
    if d2 < squared[i, j, k]:
        squared[i, j, k] = d2
        nearest[i, j, k] = t
        foot[i, j, k, 0], foot[i, j, k, 1], foot[i, j, k, 2] = px, py, pz


@exact_kernel()
def _sweep(x, triangles, nearest, foot, squared):
    """Fills each node's closest triangle, the closest point on it and its squared distance."""
    count = squared.shape
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for t in range(triangles.shape[0]):
        for axis in range(3):
            a = x[triangles[t, 0], axis]
            b = x[triangles[t, 1], axis]
            c = x[triangles[t, 2], axis]
            low[axis] = max(int(np.floor(min(a, b, c))), 0)
            high[axis] = min(int(np.ceil(max(a, b, c))), count[axis] - 1)
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    _offer(x, triangles, t, i, j, k, nearest, foot, squared)
    for sweep in range(8):
        di = 1 - 2 * (sweep & 1)
        dj = 1 - (sweep & 2)
        dk = 1 - ((sweep & 4) >> 1)
        for a in range(count[0]):
            i = a if di > 0 else count[0] - 1 - a
            for b in range(count[1]):
                j = b if dj > 0 else count[1] - 1 - b
                for c in range(count[2]):
                    k = c if dk > 0 else count[2] - 1 - c
                    for corner in range(1, 8):
                        p = i - di * (corner & 1)
                        q = j - dj * ((corner >> 1) & 1)
                        r = k - dk * (corner >> 2)
                        if min(p, q, r) < 0 or p >= count[0] or q >= count[1] or r >= count[2]:
                            continue
                        t = nearest[p, q, r]
                        if t < 0 or t == nearest[i, j, k]:
                            continue
                        u = foot[p, q, r, 0] - i
                        v = foot[p, q, r, 1] - j
                        w = foot[p, q, r, 2] - k
                        if u * u + v * v + w * w < squared[i, j, k]:
                            _offer(x, triangles, t, i, j, k, nearest, foot, squared)
