"""The triangle of another garment that is nearest to each particle, by a hashed grid."""

import numpy as np

from garment_sim_ros.geometry.mesh_distance import closest_on_triangle
from garment_sim_ros.geometry.vectors import row
from garment_sim_ros.jit import lean_kernel

_FAR = np.float32(1.5)
"""The first corner of a triangle in reach may itself be half as far again."""


@lean_kernel(inner=True)
def _cell(ix, iy, iz, cells):
    """A cell of a hashed grid; primes after Teschner et al. 2003."""
    return ((ix * 73856093) ^ (iy * 19349663) ^ (iz * 83492791)) & (cells - 1)


@lean_kernel(inner=True)
def _cell_of(place, scale, cells):
    """The cell of a place, for so many cells in a metre."""
    return _cell(
        int(np.floor(place[0] * scale)),
        int(np.floor(place[1] * scale)),
        int(np.floor(place[2] * scale)),
        cells,
    )


@lean_kernel(inner=True)
def closest(x, triangles, t, place):
    """Squared distance to triangle t, weights of its last two corners there, and the feature."""
    px, py, pz = place
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    b, c, feature = closest_on_triangle(x[i], x[j], x[k], px, py, pz)
    b = np.float32(b)
    c = np.float32(c)
    a = np.float32(1.0) - b - c
    dx = px - (a * x[i, 0] + b * x[j, 0] + c * x[k, 0])
    dy = py - (a * x[i, 1] + b * x[j, 1] + c * x[k, 1])
    dz = pz - (a * x[i, 2] + b * x[j, 2] + c * x[k, 2])
    return dx * dx + dy * dy + dz * dz, b, c, feature


@lean_kernel(inner=True)
def _sort(other, triangles, scale, start, entry):
    """Counting sort of triangles by the cell of their first corner.

    Afterwards `start[c + 1]` is the first entry of cell c; the next cell's first ends it.
    """
    cells = start.size - 1
    start[:] = 0
    for t in range(triangles.shape[0]):
        start[_cell_of(row(other, triangles[t, 0]), scale, cells) + 1] += 1
    for c in range(cells):
        start[c + 1] += start[c]
    for t in range(triangles.shape[0] - 1, -1, -1):
        c = _cell_of(row(other, triangles[t, 0]), scale, cells)
        start[c + 1] -= 1
        entry[start[c + 1]] = t


@lean_kernel(inner=True)
def _box(x):
    """The lowest and the highest corner of a box around all particles [m]."""
    x0 = y0 = z0 = np.float32(np.inf)
    x1 = y1 = z1 = np.float32(-np.inf)
    for i in range(x.shape[0]):
        x0 = min(x0, x[i, 0])
        x1 = max(x1, x[i, 0])
        y0 = min(y0, x[i, 1])
        y1 = max(y1, x[i, 1])
        z0 = min(z0, x[i, 2])
        z1 = max(z1, x[i, 2])
    return (x0, y0, z0), (x1, y1, z1)


@lean_kernel(inner=True)
def _nearest(place, other, triangles, reach, start, entry):
    """The triangle nearest to a place [m]; -1 where none is in reach. Arguments as `_sort`."""
    cells = start.size - 1
    far = _FAR * reach
    scale = np.float32(1.0) / far
    px, py, pz = place
    ix = int(np.floor(px * scale))
    iy = int(np.floor(py * scale))
    iz = int(np.floor(pz * scale))
    best = reach * reach
    nearest = -1
    for dx in range(-1, 2):
        for dy in range(-1, 2):
            for dz in range(-1, 2):
                c = _cell(ix + dx, iy + dy, iz + dz, cells)
                end = start[c + 2] if c + 2 <= cells else triangles.shape[0]
                for e in range(start[c + 1], end):
                    i = triangles[entry[e], 0]
                    if (
                        abs(other[i, 0] - px) > far
                        or abs(other[i, 1] - py) > far
                        or abs(other[i, 2] - pz) > far
                    ):
                        continue
                    distance, _, _, _ = closest(other, triangles, entry[e], place)
                    if distance < best:
                        best = distance
                        nearest = entry[e]
    return nearest


@lean_kernel()
def find_triangles(x, other, triangles, reach, start, entry, near):
    """The triangle nearest to each particle that has none, if it is in reach.

    Args:
        x: Positions of the particles [m], shape [n, 3].
        other: Positions of the other garment's particles [m], shape [m, 3].
        triangles: Its triangles as particles, shape [t, 3].
        reach: Triangles farther away are none of the particle's business [m].
        start: Scratch: where the entries of each cell start, for a number of cells that is a power
            of 2, shape [cells + 1].
        entry: Scratch: triangles by cell, shape [t].
        near: The triangle of each particle, -1 for none, changed in place, shape [n].
    """
    _sort(other, triangles, np.float32(1.0) / (_FAR * reach), start, entry)
    (x0, y0, z0), (x1, y1, z1) = _box(other)
    for p in range(x.shape[0]):
        if near[p] >= 0:
            continue
        px, py, pz = x[p, 0], x[p, 1], x[p, 2]
        # Most of a shirt is far above the skirt.
        if not (
            max(x0 - px, px - x1) > reach
            or max(y0 - py, py - y1) > reach
            or max(z0 - pz, pz - z1) > reach
        ):
            near[p] = _nearest((px, py, pz), other, triangles, reach, start, entry)


@lean_kernel()
def take_from_neighbours(edges, near):
    """Gives particles without a triangle that of a neighbour to start from, one ring at a time.

    Args:
        edges: Pairs of particles, shape [e, 2].
        near: The triangle of each particle, -1 for none, changed in place, shape [n].
    """
    for e in range(edges.shape[0]):
        i, j = edges[e, 0], edges[e, 1]
        # What is taken is marked until the end, else it would run through the whole garment.
        if near[i] == -1 and near[j] >= 0:
            near[i] = -2 - near[j]
        elif near[j] == -1 and near[i] >= 0:
            near[j] = -2 - near[i]
    for p in range(near.size):
        if near[p] < -1:
            near[p] = -2 - near[p]
