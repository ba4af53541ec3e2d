"""Polygons as they stand in a mesh file, nothing repaired, and what every such file must hold to.

Polygons are a flat list of corners with their sizes, so that a quad can later be split along
either diagonal.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, LongArray
from garment_sim_ros.errors import InputFileError

MAX_MESH_BYTES = 128 * 2**20
"""Largest text mesh file that is read."""

MAX_VERTICES = 5_000_000
"""Largest number of vertices, and of polygons, in one file."""

MAX_COORDINATE = 1e9
"""Largest magnitude of a coordinate, in the file's units."""


@dataclass(frozen=True, kw_only=True)
class Polygons:
    """Polygons of one file.

    Attributes:
        vertices: Positions in the file's units and axes, shape [v, 3].
        corners: Vertex indices of all polygons one after the other, shape [sum of sizes].
        sizes: Corners of each polygon, at least 3, shape [p].
        group: Which of `groups` each polygon is in, shape [p]; all in the first where the format
            has none.
        groups: Names of the groups, in order of first use.
        colours: Painted colours of the vertices, red, green and blue from 0 to 1 as screens show
            them, shape [v, 3]; None: there are none.
        marked: Vertices of further groups, by name, shape [v].
        texture: Number of the texture point at each corner, shape [sum of sizes]; None: the file
            has none.
    """

    vertices: FloatArray
    corners: LongArray
    sizes: LongArray
    group: LongArray = field(default_factory=lambda: np.zeros(0, np.int64))
    groups: tuple[str, ...] = ("",)
    colours: FloatArray | None = None
    marked: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    texture: LongArray | None = None

    def vertex_groups(self) -> dict[str, NDArray[np.bool_]]:
        """Which vertices are in each group that has a name, shape [v]; those of its polygons."""
        found = dict(self.marked)
        if len(self.group) == len(self.sizes):
            of_corner = np.repeat(self.group, self.sizes)
            for k, name in enumerate(self.groups):
                if name:
                    found[name] = np.zeros(len(self.vertices), bool)
                    found[name][self.corners[of_corner == k]] = True
        return found

    def fans(self) -> tuple[LongArray, LongArray]:
        """Triangles with each polygon as a fan about its first corner, and their polygons.

        Returns:
            Vertex indices in the order of the polygons, shape [t, 3], and the polygon of each
            triangle, shape [t].
        """
        first = np.cumsum(self.sizes) - self.sizes
        count = self.sizes - 2
        polygon = np.repeat(np.arange(len(self.sizes)), count)
        k = np.arange(len(polygon)) - np.repeat(np.cumsum(count) - count, count)
        start = first[polygon]
        return self.corners[np.stack([start, start + k + 1, start + k + 2], axis=1)], polygon


def checked(path: str | Path, polygons: Polygons) -> Polygons:
    """The polygons of a file, if they are a surface.

    Raises:
        InputFileError: No polygon, too many, or one of fewer than 3 corners; a position that is
            not finite or too far away; an index out of range.
    """
    v, p = len(polygons.vertices), len(polygons.sizes)
    if p == 0:
        raise InputFileError(path, "has no polygons", "allowed: a surface of 1 or more")
    if max(v, p) > MAX_VERTICES:
        raise InputFileError(
            path, f"has {v} vertices and {p} polygons", f"allowed: up to {MAX_VERTICES} each"
        )
    if polygons.sizes.min() < 3:
        raise InputFileError(path, "has a polygon of fewer than 3 corners", "allowed: 3 or more")
    near = (np.abs(polygons.vertices) <= MAX_COORDINATE).all(axis=1)  # false for NaN, too
    if not near.all():
        raise InputFileError(
            path,
            f"vertex {int(np.argmin(near))} is not finite or over {MAX_COORDINATE:g}",
            "allowed: finite numbers; vertices are counted from 0",
        )
    low, high = int(polygons.corners.min()), int(polygons.corners.max())
    if low < 0 or high >= v:
        raise InputFileError(
            path,
            f"a corner is not there: vertex {low if low < 0 else high}",
            f"allowed: 0 to {v - 1}",
        )
    return polygons
