"""Point in convex hull and its response point, as Sun et al. 2007, sections 2.3 and 2.4.

In the frame of the hull's oriented box, z its longest axis: a point outside the box is outside.
Else the faces that look up and those that look down are two planar meshes with the same outline;
the point is inside if and only if it is below the face above it and above the face below it. The
response point is where the ray of the outer map through it leaves the hull.

The simulation meets hulls by `contact.kinds.hull` unless it is asked for `contact.papers.rays`:
that needs one short list of planes for both questions. This is one hull, for checks and figures.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.papers import kirkpatrick, planar_grid
from garment_sim_ros.contact.papers.kirkpatrick import hierarchy
from garment_sim_ros.contact.papers.outer_map import exit_point, outer_map
from garment_sim_ros.contact.papers.planar_grid import planar_grid as build_planar_grid
from garment_sim_ros.jit import exact_kernel

_UPRIGHT = 1e-9
"""A face whose normal's z is smaller than this is in neither planar mesh."""


class HullLocator:
    """Queries against one hull in the frame of its oriented box.

    Args:
        vertices: Corners [m], shape [n, 3].
        faces: Outward triangles, shape [f, 3].
        search: "kirkpatrick" or "grid".
        around: Ranges of angle of the outer map.
        rows: Its ranges of height or polar angle.
        kind: Its kind, see `outer_map`.
    """

    def __init__(
        self,
        vertices: FloatArray,
        faces: IntArray,
        *,
        search: str = "grid",
        around: int = 12,
        rows: int = 8,
        kind: str = "auto",
    ) -> None:
        self.map = outer_map(vertices, faces, around=around, rows=rows, kind=kind)
        self._box = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
        up = self.map.plane[:, 2]
        flat = np.ascontiguousarray(vertices[:, :2])
        build = hierarchy if search == "kirkpatrick" else build_planar_grid
        self._sides = [
            (build(flat, triangles), chosen) for chosen, triangles in planar_meshes(faces, up)
        ]
        self._inside = _inside_kirkpatrick if search == "kirkpatrick" else _inside_grid

    def inside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Whether each point [n, 3] is inside or on the hull, shape [n]."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        result = np.zeros(len(points), dtype=np.bool_)
        (upper, up), (lower, down) = self._sides
        self._inside(points, self._box, upper, up, lower, down, self.map.plane, result)
        return result

    def exits(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Response points of points [n, 3] [m], and their faces, -1 where there is none."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        found = np.full_like(points, np.nan)
        face = np.full(len(points), -1, dtype=np.int32)
        _exits(points, self.map, found, face)
        return found, face


def planar_meshes(faces: IntArray, up: FloatArray) -> list[tuple[IntArray, IntArray]]:
    """The upper and the lower planar mesh: their faces, and these counter-clockwise from above.

    Args:
        faces: Outward triangles, shape [f, 3].
        up: The z of their unit normals, shape [f].
    """
    upper = np.flatnonzero(up > _UPRIGHT).astype(np.int32)
    lower = np.flatnonzero(up < -_UPRIGHT).astype(np.int32)
    return [(upper, faces[upper]), (lower, faces[lower][:, ::-1])]


@exact_kernel(inner=True)
def in_box(box, p):
    """Whether a point is in the box of two corners, shape [2, 3]."""
    return (
        box[0, 0] <= p[0] <= box[1, 0]
        and box[0, 1] <= p[1] <= box[1, 1]
        and box[0, 2] <= p[2] <= box[1, 2]
    )


@exact_kernel(inner=True)
def between(plane, top, bottom, p):
    """Whether a point is below the plane of face `top` and above that of face `bottom`."""
    for f in (top, bottom):
        n = plane[f]
        if n[0] * p[0] + n[1] * p[1] + n[2] * p[2] > n[3]:
            return False
    return True


@exact_kernel()
def _inside_kirkpatrick(points, box, upper, up, lower, down, plane, result):
    for i in range(points.shape[0]):
        p = points[i]
        if not in_box(box, p):
            continue
        above = kirkpatrick.locate(upper, p[0], p[1])
        below = kirkpatrick.locate(lower, p[0], p[1])
        if above >= 0 and below >= 0:
            result[i] = between(plane, up[above], down[below], p)


@exact_kernel()
def _inside_grid(points, box, upper, up, lower, down, plane, result):
    for i in range(points.shape[0]):
        p = points[i]
        if not in_box(box, p):
            continue
        above = planar_grid.locate(upper, p[0], p[1])
        below = planar_grid.locate(lower, p[0], p[1])
        if above >= 0 and below >= 0:
            result[i] = between(plane, up[above], down[below], p)


@exact_kernel()
def _exits(points, table, found, face):
    for i in range(points.shape[0]):
        x, y, z, f = exit_point(table, points[i, 0], points[i, 1], points[i, 2])
        face[i] = f
        if f >= 0:
            found[i, 0], found[i, 1], found[i, 2] = x, y, z
