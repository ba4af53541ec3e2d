"""Convex outlines of a body's cross-sections.

The outline of a section in direction n is its support h(n) = max over the section of n.x: the
section's convex hull, which is what fabric stretched around it follows. Supports add, average and
take maxima as convex sets do: a sum offsets, an average is a Minkowski mean, a maximum is the
hull of a union, so profiles made of them stay convex (Schneider 1993, "Convex Bodies", 1.7). The
length of an outline is the integral of its support over the angle (Cauchy's formula).
"""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.topology import edge_table

DIRECTIONS = 72
"""Directions in which supports are sampled: every 5 degrees."""

_ANGLES = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False)
NORMALS: FloatArray = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
"""Sampled directions, shape [DIRECTIONS, 2]."""


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Convex outlines along an axis.

    Attributes:
        offset: Positions along the axis, increasing [m], shape [k].
        support: Support of the outline at each, NaN where there is no section [m],
            shape [k, DIRECTIONS].
    """

    offset: FloatArray
    support: FloatArray

    def at(self, offset: FloatArray) -> FloatArray:
        """Supports interpolated at other positions (ends held), shape [n, DIRECTIONS]."""
        offset = np.clip(np.asarray(offset, dtype=np.float64), self.offset[0], self.offset[-1])
        if len(self.offset) == 1:
            return np.repeat(self.support, offset.size, axis=0)
        i = np.clip(np.searchsorted(self.offset, offset) - 1, 0, len(self.offset) - 2)
        s = ((offset - self.offset[i]) / (self.offset[i + 1] - self.offset[i]))[:, None]
        return (1.0 - s) * self.support[i] + s * self.support[i + 1]

    @property
    def girth(self) -> FloatArray:
        """Length of each outline [m], shape [k]."""
        return self.support.sum(axis=1) * (2.0 * np.pi / DIRECTIONS)

    def filled(self) -> "Profile":
        """The profile without positions that have no section."""
        there = np.isfinite(self.support).all(axis=1)
        return Profile(offset=self.offset[there], support=self.support[there])


def sections(
    vertices: FloatArray,
    triangles: IntArray,
    share: FloatArray,
    frame: FloatArray,
    offsets: FloatArray,
) -> Profile:
    """Outlines of the sections of a part of a mesh with parallel planes.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        share: How much of each vertex belongs to the part; from 0.5 on it counts, shape [v].
        frame: Axes of the planes: two in the plane, then the normal, and the origin, as a rigid
            transform to the frame of `vertices`, shape [4, 4].
        offsets: Positions of the planes along the normal from the origin [m], shape [k].
    """
    local = (vertices - frame[:3, 3]) @ frame[:3, :3]
    edges = edge_table(triangles)[0]
    support = np.full((len(offsets), DIRECTIONS), np.nan)
    for k, offset in enumerate(offsets):
        points = crossings(local, edges, share, offset)
        if len(points):
            support[k] = (points[:, :2] @ NORMALS.T).max(axis=0)
    return Profile(offset=np.asarray(offsets, dtype=np.float64), support=support)


def crossings(x: FloatArray, edges: IntArray, share: FloatArray, level: float) -> FloatArray:
    """Points at which edges of a part cross the plane z = level.

    Args:
        x: Positions [m], shape [v, 3].
        edges: Vertex pairs, shape [e, 2].
        share: How much of each vertex belongs to the part; points from 0.5 on count, shape [v].
        level: Height of the plane [m].

    Returns:
        Positions [m], shape [n, 3].
    """
    above = x[:, 2] > level
    a, b = edges[above[edges[:, 0]] != above[edges[:, 1]]].T
    s = (level - x[a, 2]) / (x[b, 2] - x[a, 2])
    kept = share[a] + s * (share[b] - share[a]) >= 0.5
    a, b, s = a[kept], b[kept], s[kept, None]
    return x[a] + s * (x[b] - x[a])


def outline(support: FloatArray) -> FloatArray:
    """Corners of the polygon of one support, counter-clockwise, shape [DIRECTIONS, 2].

    Corner i is where the tangents in directions i and i + 1 meet; the polygon contains the
    section.
    """
    following = np.roll(support, -1)
    step = 2.0 * np.pi / DIRECTIONS
    tangent = np.stack([-NORMALS[:, 1], NORMALS[:, 0]], axis=1)
    return (
        support[:, None] * NORMALS
        + ((following - support * np.cos(step)) / np.sin(step))[:, None] * tangent
    )
