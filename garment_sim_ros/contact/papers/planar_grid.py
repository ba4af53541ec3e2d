"""Which triangle of a planar triangulation holds a point: a grid of short lists."""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.jit import exact_kernel

_ROUNDING = 1e-13
"""Rounding of an area, as a share of the squared size."""


class PlanarGrid(NamedTuple):
    """Triangles per cell.

    Attributes:
        corner: Corners of the triangles, counter-clockwise, shape [t, 3, 2].
        low: Lowest corner of the grid, shape [2].
        per_length: Cells per length, shape [2].
        cells: Cells along each axis, shape [2].
        start: Where each cell's triangles start in `triangle`, y fastest, shape [cells + 1].
        triangle: Indices of triangles.
        tolerance: Twice the area by which a point may be outside a triangle that holds it.
    """

    corner: FloatArray
    low: FloatArray
    per_length: FloatArray
    cells: IntArray
    start: IntArray
    triangle: IntArray
    tolerance: float


def planar_grid(
    points: FloatArray, triangles: IntArray, *, per_triangle: float = 4.0
) -> PlanarGrid:
    """Build the search structure.

    Args:
        points: Vertices, shape [n, 2].
        triangles: Counter-clockwise triangles, shape [t, 3].
        per_triangle: About how many cells there are for each triangle.
    """
    corner = points[triangles]
    low, high = corner.min(axis=(0, 1)), corner.max(axis=(0, 1))
    extent = np.maximum(high - low, 1e-12)
    edge = np.sqrt(extent.prod() / (per_triangle * len(triangles)))
    count = np.maximum(np.ceil(extent / edge), 1.0).astype(np.int32)
    cell = extent / count
    middle = np.stack(
        np.meshgrid(
            *[low[k] + (np.arange(count[k]) + 0.5) * cell[k] for k in range(2)], indexing="ij"
        ),
        axis=-1,
    ).reshape(-1, 2)
    # A cell and a triangle are apart if an edge of one of them separates them.
    margin = 1e-9 * float(extent.max())
    touch = np.ones((len(middle), len(corner)), dtype=np.bool_)
    for k in range(2):
        reach = 0.5 * cell[k] + margin
        touch &= corner[:, :, k].max(axis=1) >= middle[:, None, k] - reach
        touch &= corner[:, :, k].min(axis=1) <= middle[:, None, k] + reach
    for k in range(3):
        a, b = corner[:, k], corner[:, (k + 1) % 3]
        inwards = np.stack([a[:, 1] - b[:, 1], b[:, 0] - a[:, 0]], axis=1)
        inside = middle @ inwards.T - (a * inwards).sum(axis=1)
        reach = np.abs(inwards) @ (0.5 * cell) + margin * np.linalg.norm(inwards, axis=1)
        touch &= inside >= -reach
    return PlanarGrid(
        corner=np.ascontiguousarray(corner),
        low=low,
        per_length=1.0 / cell,
        cells=count,
        start=np.concatenate([[0], np.cumsum(touch.sum(axis=1))]).astype(np.int32),
        triangle=np.nonzero(touch)[1].astype(np.int32),
        tolerance=_ROUNDING * float(extent.max()) ** 2,
    )


@exact_kernel()
def locate(grid, px, py):
    """The triangle that holds a point, -1 if there is none."""
    i = np.floor((px - grid.low[0]) * grid.per_length[0])
    j = np.floor((py - grid.low[1]) * grid.per_length[1])
    # A point on the upper rim belongs to the last cell.
    if i == grid.cells[0]:
        i -= 1.0
    if j == grid.cells[1]:
        j -= 1.0
    if not (i >= 0.0 and j >= 0.0 and i < grid.cells[0] and j < grid.cells[1]):
        return -1
    cell = np.int64(i) * grid.cells[1] + np.int64(j)
    for k in range(grid.start[cell], grid.start[cell + 1]):
        t = grid.triangle[k]
        a, b, c = grid.corner[t, 0], grid.corner[t, 1], grid.corner[t, 2]
        least = min(
            (b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0]),
            (c[0] - b[0]) * (py - b[1]) - (c[1] - b[1]) * (px - b[0]),
            (a[0] - c[0]) * (py - c[1]) - (a[1] - c[1]) * (px - c[0]),
        )
        if least >= -grid.tolerance:
            return t
    return -1
