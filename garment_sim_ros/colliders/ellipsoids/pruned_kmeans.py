"""Clusters of skin points with an ellipsoid each, refined where the fit is worst.

Gong et al., 3.3.

Refinement always ends: every round either makes one cluster more, of at least `FEWEST` points
each, or takes one cluster off the list of those that may be split; both are finite, and so is the
number of k-means passes within a round.
"""

from dataclasses import dataclass, field

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.mvee import Ellipsoid, mvee
from garment_sim_ros.jit import exact_kernel

FEWEST = 4
"""Fewest points of a cluster."""
MAX_PASSES = 60
"""Most k-means passes of one round."""


@exact_kernel()
def reassign(points, centre, label, error, use_rule, sigma, max_passes, fewest):
    """K-means with the paper's two changes, in place.

    A point may move from cluster i to j only if ``error[i] > error[j]`` (where `use_rule`), and
    passes end when the mean of the centres moves by no more than `sigma` (equation 7), or
    with sigma = 0 when no point moves. No cluster is left with fewer than `fewest` points.
    """
    n = points.shape[0]
    k = centre.shape[0]
    size = np.zeros(k, dtype=np.int64)
    for p in range(n):
        size[label[p]] += 1
    mean = np.zeros((k, 3))
    for _ in range(max_passes):
        moved = 0
        for p in range(n):
            i = label[p]
            if size[i] <= fewest:
                continue
            best = i
            nearest = 0.0
            for c in range(3):
                nearest += (points[p, c] - centre[i, c]) ** 2
            for j in range(k):
                if j == i or (use_rule and not error[i] > error[j]):
                    continue
                d = 0.0
                for c in range(3):
                    d += (points[p, c] - centre[j, c]) ** 2
                if d < nearest:
                    nearest = d
                    best = j
            if best != i:
                size[i] -= 1
                size[best] += 1
                label[p] = best
                moved += 1
        mean[:, :] = 0.0
        for p in range(n):
            for c in range(3):
                mean[label[p], c] += points[p, c]
        shift = 0.0
        for c in range(3):
            total = 0.0
            for j in range(k):
                if size[j] > 0:
                    value = mean[j, c] / size[j]
                    total += value - centre[j, c]
                    centre[j, c] = value
            shift += (total / k) ** 2
        if moved == 0 or np.sqrt(shift) <= sigma:
            break


@dataclass
class Cluster:
    """Points with their ellipsoid.

    Attributes:
        ellipsoid: The smallest one around the points.
        error: Mean radial distance of the points to it, equation (6) [m].
        final: It cannot be split.
    """

    ellipsoid: Ellipsoid
    error: float
    final: bool = False


@dataclass
class Clustering:
    """The clusters of one part of a body.

    Attributes:
        points: Positions [m], shape [n, 3].
        label: Cluster of each point, shape [n].
        centre: Means of the clusters [m], shape [k, 3].
        sigma: Where k-means stops, equation (7) [m].
        use_rule: Points only move to clusters of smaller error.
    """

    points: FloatArray
    label: IntArray
    centre: FloatArray
    sigma: float
    use_rule: bool = True
    clusters: list[Cluster] = field(default_factory=list)

    @classmethod
    def start(
        cls, points: FloatArray, label: IntArray, *, sigma: float, use_rule: bool = True
    ) -> "Clustering":
        """Step a): clusters around the means of a first division, and their ellipsoids."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        names, number = np.unique(label, return_inverse=True)
        label = number.astype(np.int32)
        k = len(names)
        count = np.bincount(label, minlength=k)[:, None]
        centre = np.stack([np.bincount(label, points[:, c], k) for c in range(3)], axis=1) / count
        made = cls(points, label, centre, sigma, use_rule)
        made.clusters = [made._fit(i) for i in range(k)]
        if k > 1:
            made._settle()
        return made

    def errors(self) -> FloatArray:
        """Fit error of each cluster [m]."""
        return np.array([c.error for c in self.clusters])

    def worst(self) -> tuple[int, float]:
        """The cluster of largest error that can be split, and its error; -1 and 0 if none."""
        best, error = -1, 0.0
        for i, c in enumerate(self.clusters):
            if not c.final and c.error > error:
                best, error = i, c.error
        return best, error

    def split(self, i: int) -> bool:
        """Steps b) to d): two clusters for one, from the ends of its longest axis."""
        mine = np.flatnonzero(self.label == i)
        e = self.clusters[i].ellipsoid
        side = (self.points[mine] - e.centre) @ e.axes[:, 0] > 0.0
        smaller = min(int(side.sum()), int((~side).sum()))
        if smaller < FEWEST:
            self.clusters[i].final = True
            return False
        k = len(self.clusters)
        self.label[mine[side]] = k
        ends = e.centre + np.outer([-1.0, 1.0], e.radii[0] * e.axes[:, 0])
        self.centre = np.concatenate([self.centre, ends[1:]])
        self.centre[i] = ends[0]
        self.clusters[i] = self._fit(i)
        self.clusters.append(self._fit(k))
        self._settle()
        return True

    def _fit(self, i: int) -> Cluster:
        points = self.points[self.label == i]
        ellipsoid = mvee(points, tolerance=5e-3)
        return Cluster(ellipsoid, float(ellipsoid.radial_error(points).mean()))

    def _settle(self) -> None:
        """K-means, and new ellipsoids where it moved points."""
        before = self.label.copy()
        reassign(
            self.points,
            self.centre,
            self.label,
            self.errors(),
            self.use_rule,
            self.sigma,
            MAX_PASSES,
            FEWEST,
        )
        moved = before != self.label
        for i in np.union1d(before[moved], self.label[moved]):
            self.clusters[int(i)] = self._fit(int(i))


def refine(parts: list[Clustering], mu: list[float], most: int) -> None:
    """Step e): split the worst cluster of all parts until no error exceeds its part's threshold.

    Args:
        parts: Clusterings, changed in place.
        mu: Threshold of each part [m].
        most: Most clusters of all parts together.
    """
    count = sum(len(part.clusters) for part in parts)
    worst = [part.worst() for part in parts]
    while count < most:
        excess = [error / m if error > m else 0.0 for (_, error), m in zip(worst, mu)]
        at = int(np.argmax(excess)) if excess else 0
        if not excess or excess[at] == 0.0:
            return
        if parts[at].split(worst[at][0]):
            count += 1
        worst[at] = parts[at].worst()
