"""Signed distances sampled on a regular grid: the shape of a collider of kind ``sdf``.

The shape is where the trilinear interpolation of the samples is negative. Beyond the grid the
distance is at least ``sqrt(gap^2 + value^2)``, with the gap to the nearest point of the grid's box
and the value there: the way on to the surface leaves that point at a right angle or more, because
the box is convex.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from garment_sim_ros.arrays import FloatArray, ShortArray
from garment_sim_ros.errors import GeometryError

MOST_NODES = 2**22
"""Most samples of one grid: 8 MiB."""
CORNERS = np.indices((2, 2, 2)).reshape(3, -1).T
"""Corners of a cell, 0 or 1 along each axis, shape [8, 3]."""


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Samples of a signed distance; the grid's middle is the origin of its frame.

    Attributes:
        cell: Distance of neighbouring samples [m].
        step: Distance that one unit of a sample stands for [m].
        distance: Samples along x, y and z in `step`, negative inside, positive on the grid's
            faces, shape [nx, ny, nz].
    """

    cell: float
    step: float
    distance: ShortArray

    def __post_init__(self) -> None:
        d = self.distance
        if not (0.0 < self.cell < np.inf and 0.0 < self.step < np.inf):
            raise GeometryError(
                f"cell {self.cell:g} and step {self.step:g} m; allowed: positive numbers"
            )
        if d.ndim != 3 or d.dtype != np.int16 or min(d.shape) < 3 or d.size > MOST_NODES:
            raise GeometryError(
                f"samples have shape {d.shape} and type {d.dtype}; allowed: 16-bit integers, 3 or "
                f"more along each axis, {MOST_NODES} in all"
            )
        faces = [np.take(d, (0, -1), axis=axis) for axis in range(3)]
        if min(int(face.min()) for face in faces) <= 0:
            raise GeometryError("the shape reaches the faces of its grid; allowed: within them")
        if int(d.min()) >= 0:
            raise GeometryError("no sample is inside the shape; allowed: one or more")

    @classmethod
    def of(cls, geometry: Mapping[str, object]) -> "DistanceGrid":
        """The grid of a collider's geometry.

        Raises:
            GeometryError: Unusable numbers.
        """
        return cls(
            cell=float(geometry["cell"]),  # type: ignore[arg-type]
            step=float(geometry["step"]),  # type: ignore[arg-type]
            distance=np.ascontiguousarray(geometry["distance"]),
        )

    @classmethod
    def sampled(cls, cell: float, values: FloatArray) -> "DistanceGrid":
        """A grid with given distances [m], shape [nx, ny, nz], rounded down by at most a step."""
        step = max(float(np.abs(values).max()), 1e-6) / np.iinfo(np.int16).max
        return cls(cell=cell, step=step, distance=np.floor(values / step).astype(np.int16))

    def geometry(self) -> dict[str, object]:
        """The geometry of a collider."""
        return {"cell": self.cell, "step": self.step, "distance": self.distance}

    @property
    def low(self) -> FloatArray:
        """The first sample's place [m], shape [3]."""
        return -0.5 * self.cell * (np.array(self.distance.shape) - 1.0)

    def value(self, points: FloatArray) -> FloatArray:
        """Signed distance of points [n, 3] in the grid's frame [m], beyond it a lower bound.

        What `sdf.sdf_height` computes in single precision.
        """
        last = np.array(self.distance.shape) - 1
        at = (points - self.low) / self.cell
        within = np.clip(at, 0.0, last)
        value = self.step * trilinear(self.distance, within)
        gap = self.cell * np.linalg.norm(at - within, axis=1)
        beyond = np.sqrt(gap * gap + np.square(np.maximum(value, 0.0)))
        return np.where(gap > 0.0, beyond, value)

    def box(self) -> FloatArray:
        """Lowest and highest corner of a box that holds the shape, shape [6].

        Between two layers of samples the interpolation is nowhere less than that of the layers'
        least samples.
        """
        box = np.empty(6)
        for axis in range(3):
            others = tuple(a for a in range(3) if a != axis)
            least = self.distance.min(axis=others).astype(np.float64)
            first, last = np.flatnonzero(least < 0.0)[[0, -1]]
            box[axis] = first - least[first] / (least[first] - least[first - 1])
            box[3 + axis] = last + least[last] / (least[last] - least[last + 1])
        return self.cell * box + np.tile(self.low, 2)

    def rim(self) -> FloatArray:
        """Samples around the shape: it is within their convex hull, shape [n, 3]."""
        inside = self.distance < 0
        around = binary_dilation(inside, np.ones((3, 3, 3))) & ~inside
        return self.low + self.cell * np.argwhere(around)

    def steepest(self) -> float:
        """A bound of how fast the interpolation changes with the way; 1 or a little more."""
        samples = self.distance.astype(np.int32)
        squared = np.zeros([n - 1 for n in samples.shape])
        for axis in range(3):
            change = np.abs(np.diff(samples, axis=axis))
            for other in range(3):
                if other != axis:
                    change = _greater_neighbour(change, other)
            squared += np.square(change.astype(np.float64))
        return max(float(np.sqrt(squared.max())) * self.step / self.cell, 1.0)


def _greater_neighbour(values: NDArray[np.int32], axis: int) -> NDArray[np.int32]:
    """The greater of each two neighbours along an axis."""
    moved = np.moveaxis(values, axis, 0)
    return np.moveaxis(np.maximum(moved[:-1], moved[1:]), 0, axis)


def trilinear(samples: NDArray[np.generic], at: FloatArray) -> FloatArray:
    """Samples [nx, ny, nz] interpolated at places in cells, within the grid, [n, 3]."""
    first, share = cells_and_shares(samples.shape, at)
    value = np.zeros(len(at))
    for corner in CORNERS:
        weight = np.where(corner, share, 1.0 - share).prod(axis=1)
        value += weight * samples[tuple((first + corner).T)]
    return value


def cells_and_shares(
    shape: tuple[int, ...], at: FloatArray
) -> tuple[NDArray[np.int64], FloatArray]:
    """The cell that each place [n, 3], in cells, is in, and where in it, 0 to 1."""
    first = np.clip(np.floor(at).astype(np.int64), 0, np.array(shape) - 2)
    return first, at - first
