"""Horizontal and other plane sections of a body's skin, and their girths."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from garment_sim_ros.arrays import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class Level:
    """A horizontal section of the trunk.

    Attributes:
        height: Height over the ground [m].
        girth: Length of its convex outline [m].
        centre: Middle of its bounding box: x forward, y to the left [m].
        size: Its depth along x and its width along y [m].
        outline: Corners of its convex outline in order [m], shape [k, 2].
    """

    height: float
    girth: float
    centre: tuple[float, float]
    size: tuple[float, float]
    outline: FloatArray

    @property
    def front(self) -> float:
        """Its foremost x [m]."""
        return self.centre[0] + 0.5 * self.size[0]

    @property
    def back(self) -> float:
        """Its hindmost x [m]."""
        return self.centre[0] - 0.5 * self.size[0]

    def before(self, x: float) -> float:
        """Length of the part of its outline that lies in front of a plane across x [m]."""
        a, b = self.outline, np.roll(self.outline, -1, axis=0)
        ahead = np.maximum(a[:, 0], b[:, 0]) - x
        span = np.maximum(np.abs(a[:, 0] - b[:, 0]), 1e-12)
        return float((np.clip(ahead / span, 0.0, 1.0) * np.linalg.norm(b - a, axis=1)).sum())


@dataclass(frozen=True)
class Loops:
    """Closed sections of a surface at one height."""

    points: list[FloatArray]

    @property
    def middle(self) -> list[FloatArray]:
        """Middles of their bounding boxes [m], shape [2] each."""
        return [0.5 * (p.min(axis=0) + p.max(axis=0)) for p in self.points]


def loops_at(x: FloatArray, triangles: IntArray, level: float, axis: int) -> Loops:
    """Connected sections of a surface with a plane across an axis, as points in the plane."""
    height = x[:, axis] - level
    above = height > 0.0
    count = above[triangles].sum(axis=1)
    hit = triangles[(count == 1) | (count == 2)]
    if not len(hit):
        return Loops([])
    ends = np.sort(hit[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    crossed = above[ends[..., 0]] != above[ends[..., 1]]
    pairs = ends[crossed].reshape(-1, 2)  # two for each triangle, one after the other
    keys, index = np.unique(pairs, axis=0, return_inverse=True)
    index = index.reshape(-1, 2)
    a, b = keys[:, 0], keys[:, 1]
    s = (height[a] / (height[a] - height[b]))[:, None]
    points = np.delete(x[a] + s * (x[b] - x[a]), axis, axis=1)
    n = len(keys)
    links = coo_matrix((np.ones(len(index)), (index[:, 0], index[:, 1])), shape=(n, n))
    _, label = connected_components(links, directed=False)
    return Loops([points[label == k] for k in range(label.max() + 1)])


def girth_of(points: FloatArray) -> float:
    """Length of the convex outline of points in a plane [m]."""
    if len(points) < 3:
        return 0.0
    try:
        return float(ConvexHull(points).area)  # in the plane: the perimeter
    except QhullError:
        return 0.0


def _outline(points: FloatArray) -> FloatArray:
    """Corners of the convex outline in order, of points on a line those [m], shape [k, 2]."""
    try:
        corners: FloatArray = points[ConvexHull(points).vertices]
    except QhullError:
        return points
    return corners


def level_of(height: float, points: FloatArray) -> Level:
    """A section of the trunk from its points."""
    low, high = points.min(axis=0), points.max(axis=0)
    centre, size = 0.5 * (low + high), high - low
    return Level(
        height=float(height),
        girth=girth_of(points),
        centre=(float(centre[0]), float(centre[1])),
        size=(float(size[0]), float(size[1])),
        outline=_outline(points),
    )


def trunk_of(loops: Loops, mid: float) -> FloatArray | None:
    """The section that the mid-plane passes through; the largest of those."""
    through = [p for p in loops.points if p[:, 1].min() < mid < p[:, 1].max()]
    return max(through, key=girth_of) if through else None
