"""Which faces of a convex polyhedron can be the nearest, cell by cell of a grid around it.

Inside a convex polyhedron the signed distance is the largest of the signed plane distances
``n . x - d`` of its faces. The difference of two of them is linear: in a box with centre c and
half extent e, face g is above face f everywhere if
``(n_g - n_f) . c - (d_g - d_f) > |n_g - n_f| . e``. Then f is never the nearest there. What is
left is a list of a few per cell, and the distance at a point costs those few planes, however many
faces there are. Cells that are far outside have an empty list.
"""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.jit import exact_kernel

_ROUNDING = 1e-6
"""Share of the grid's size that counts as equal: queries are in single precision."""


@dataclass(frozen=True)
class FaceGrid:
    """Candidate faces per cell.

    Attributes:
        low: Lowest corner of the grid [m], shape [3].
        cell: Size of a cell [m], shape [3].
        count: Number of cells along each axis, shape [3].
        start: Where each cell's faces start in `face`, cells in order (x, y, z), z fastest; one
            more at the end, shape [cells + 1].
        face: Faces, shape [start[-1]]; none for cells that are all `far` outside.
    """

    low: FloatArray
    cell: FloatArray
    count: IntArray
    start: IntArray
    face: IntArray


def face_grid(
    planes: FloatArray,
    low: FloatArray,
    high: FloatArray,
    *,
    far: float = np.inf,
    cells: int = 2048,
    overlap: float = 0.0,
) -> FaceGrid:
    """A grid over the box from `low` to `high`.

    Args:
        planes: Outward unit normals and offsets of the faces, shape [f, 4].
        low: Lowest corner [m], shape [3].
        high: Highest corner, above it in every coordinate [m], shape [3].
        far: Distances above this need not be known [m].
        cells: About how many cells, nearly cubic.
        overlap: How far beyond a cell its list holds, too, as a share of the cell's size.
    """
    extent = high - low
    edge = (extent.prod() / cells) ** (1.0 / 3.0)
    count = np.maximum(np.round(extent / edge), 1.0).astype(np.int32)
    cell = extent / count
    start = np.zeros(int(count.prod()) + 1, np.int32)
    face = np.empty(int(count.prod()) * len(planes), np.int32)
    margin = _ROUNDING * float(extent.max())
    half = (0.5 + overlap) * cell
    _fill(np.ascontiguousarray(planes), low, cell, half, count, far, margin, start, face)
    return FaceGrid(low=low, cell=cell, count=count, start=start, face=face[: start[-1]].copy())


@exact_kernel()
def _fill(planes, low, cell, half, count, far, margin, start, face):
    """Lists for all cells; a face stays unless another is above it by `margin` everywhere."""
    faces = planes.shape[0]
    height = np.empty(faces)
    loose = np.empty(faces)
    possible = np.empty(faces, dtype=np.int32)
    ex, ey, ez = half[0], half[1], half[2]
    for f in range(faces):
        n = planes[f]
        loose[f] = abs(n[0]) * ex + abs(n[1]) * ey + abs(n[2]) * ez + margin
    at = 0
    row = 0
    for i in range(count[0]):
        x = low[0] + (i + 0.5) * cell[0]
        for j in range(count[1]):
            y = low[1] + (j + 0.5) * cell[1]
            for k in range(count[2]):
                z = low[2] + (k + 0.5) * cell[2]
                least = -np.inf
                top = 0
                for f in range(faces):
                    n = planes[f]
                    height[f] = n[0] * x + n[1] * y + n[2] * z - n[3]
                    least = max(least, height[f] - loose[f])
                    if height[f] > height[top]:
                        top = f
                found = 0
                row += 1
                if least > far:
                    start[row] = at
                    continue
                for f in range(faces):
                    if height[f] + loose[f] >= least and not _is_below(
                        planes, height, f, top, ex, ey, ez, margin
                    ):
                        possible[found] = f
                        found += 1
                for c in range(found):
                    one = np.int64(possible[c])
                    hidden = False
                    for d in range(found):
                        other = np.int64(possible[d])
                        if _is_below(planes, height, one, other, ex, ey, ez, margin):
                            hidden = True
                            break
                    if not hidden:
                        face[at] = one
                        at += 1
                start[row] = at


@exact_kernel(inner=True)
def _is_below(planes, height, f, g, ex, ey, ez, margin):
    """Whether face g is above face f in all of a cell."""
    n = planes[f]
    m = planes[g]
    return height[g] - height[f] > (
        abs(m[0] - n[0]) * ex + abs(m[1] - n[1]) * ey + abs(m[2] - n[2]) * ez + margin
    )
