"""Cloth inside of one part of the body alone, where a place outside of all parts is near.

Where an arm lies to the trunk, or a thigh to the belly, skins of two parts run through each other:
a point between them is inside of both, and so is every other one there. The winding number of the
skin tells them: 1 inside of one part, 2 inside of two. What is left is `inside` (`docs/worn.md`)
without the area for which the body leaves no place.
"""

from collections.abc import Mapping

import numpy as np
from numba import njit

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.recording.metrics import DEEP, GarmentMesh

_TWICE = 1.5
"""Winding number from which on a point is inside of two parts."""


@njit(cache=True)
def winding_numbers(points, x, triangles):
    """How often a closed surface goes around each point, shape [n].

    By solid angles (van Oosterom & Strackee 1983, eq. 8).

    Args:
        points: [m], shape [n, 3].
        x: Vertices [m], shape [v, 3].
        triangles: Shape [t, 3].
    """
    result = np.zeros(len(points))
    for n in range(len(points)):
        total = 0.0
        for t in range(len(triangles)):
            a = x[triangles[t, 0]] - points[n]
            b = x[triangles[t, 1]] - points[n]
            c = x[triangles[t, 2]] - points[n]
            la, lb, lc = np.sqrt((a * a).sum()), np.sqrt((b * b).sum()), np.sqrt((c * c).sum())
            volume = (
                a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0])
            )
            below = la * lb * lc + (a * b).sum() * lc + (b * c).sum() * la + (c * a).sum() * lb
            total += 2.0 * np.arctan2(volume, below)
        result[n] = total / (4.0 * np.pi)
    return result


class OverlapMeter:
    """Collects `inside` of one part alone, over frames and garments."""

    def __init__(self, skin: FloatArray, triangles: IntArray, meshes: Mapping[str, GarmentMesh]):
        self._skin = MeshDistance(skin, triangles)
        self._triangles, self._meshes = triangles, meshes
        self.shares: list[float] = []

    def add(self, skin: FloatArray, garments: Mapping[str, FloatArray]) -> None:
        """One frame: the posed skin [m], and each garment's vertices [m]."""
        self._skin.refit(skin)
        for name, x in garments.items():
            samples = self._meshes[name].samples(x)
            distance = self._skin.signed_distance(samples)[0].copy()
            deep = np.flatnonzero(distance < -DEEP)
            around = winding_numbers(samples[deep], np.asarray(skin, float), self._triangles)
            distance[deep[around > _TWICE]] = 0.0
            self.shares.append(self._meshes[name].inside(distance))

    @property
    def p99(self) -> float:
        """The 99th percentile of all frames and garments."""
        return float(np.percentile(self.shares, 99.0)) if self.shares else 0.0
