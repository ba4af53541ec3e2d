"""Points of the skin: vertices, and places on edges and triangles where clusters meet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.mvee import Ellipsoid
from garment_sim_ros.geometry.topology import edge_table

_HALVINGS = 12


@dataclass(frozen=True)
class SkinPoints:
    """Points on triangles of the skin.

    Attributes:
        corner: Skin vertices around each point, shape [n, 3].
        share: What each contributes; 1, 0, 0 at a vertex, shape [n, 3].
    """

    corner: IntArray
    share: FloatArray

    def __len__(self) -> int:
        return len(self.corner)

    @classmethod
    def at(cls, vertices: IntArray) -> "SkinPoints":
        """Skin vertices."""
        corner = np.repeat(np.asarray(vertices, np.int32)[:, None], 3, axis=1)
        return cls(corner, np.tile([1.0, 0.0, 0.0], (len(corner), 1)))

    def take(self, index: NDArray[np.integer]) -> "SkinPoints":
        """Some of them."""
        return SkinPoints(self.corner[index], self.share[index])

    def with_more(self, other: list["SkinPoints"]) -> "SkinPoints":
        """These, then others."""
        parts = [self, *other]
        return SkinPoints(
            np.concatenate([p.corner for p in parts]), np.concatenate([p.share for p in parts])
        )

    def of(self, values: FloatArray) -> FloatArray:
        """What values at the skin's vertices are at the points, shape [n, ...]."""
        result: FloatArray = np.einsum("nk,nk...->n...", self.share, values[self.corner])
        return result


def border_points(
    x: FloatArray, triangles: IntArray, label: IntArray, ellipsoids: list[Ellipsoid]
) -> list[list[SkinPoints]]:
    """For each ellipsoid the points that it needs beside its own vertices, to cover the skin.

    Triangles whose corners belong to several are cut between them, at edges where both ellipsoids
    have to grow alike; of three a middle is taken. Each piece is then convex, and its corners are
    in one ellipsoid.

    Args:
        x: Skin vertices [m], shape [v, 3].
        triangles: Shape [t, 3].
        label: Ellipsoid of each vertex, shape [v].
        ellipsoids: Around their own vertices.
    """
    result: list[list[SkinPoints]] = [[] for _ in ellipsoids]
    corner = label[triangles]
    edges = edge_table(triangles)[0]
    edges = edges[label[edges[:, 0]] != label[edges[:, 1]]]
    if not len(edges):
        return result
    i, j = edges.T
    share = _even_cut(x, i, j, label, ellipsoids)
    cuts = SkinPoints(
        np.stack([i, j, j], axis=1).astype(np.int32),
        np.stack([1.0 - share, share, np.zeros(len(i))], axis=1),
    )
    for one in (label[i], label[j]):
        for o in np.unique(one):
            result[o].append(cuts.take(np.flatnonzero(one == o)))
    three = (
        (corner[:, 0] != corner[:, 1])
        & (corner[:, 1] != corner[:, 2])
        & (corner[:, 2] != corner[:, 0])
    )
    middles = SkinPoints(
        triangles[three].astype(np.int32), np.full((int(three.sum()), 3), 1.0 / 3.0)
    )
    for k in range(3):
        for o in np.unique(corner[three, k]):
            result[o].append(middles.take(np.flatnonzero(corner[three, k] == o)))
    return result


def _even_cut(
    x: FloatArray, i: IntArray, j: IntArray, label: IntArray, ellipsoids: list[Ellipsoid]
) -> FloatArray:
    """How far from i to j both ellipsoids hold the point alike: 0 to 1, shape [n]."""

    def zeta(owner: IntArray, points: FloatArray) -> FloatArray:
        values = np.empty(len(points))
        for o in np.unique(owner):
            mine = owner == o
            values[mine] = ellipsoids[o].zeta(points[mine])
        return values

    low, high = np.zeros(len(i)), np.ones(len(i))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        points = x[i] + middle[:, None] * (x[j] - x[i])
        nearer_i = zeta(label[i], points) < zeta(label[j], points)
        low, high = np.where(nearer_i, middle, low), np.where(nearer_i, high, middle)
    return 0.5 * (low + high)
