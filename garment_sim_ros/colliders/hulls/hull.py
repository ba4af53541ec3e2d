"""Convex hulls (QuickHull, by Qhull) and their inflation."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.exact import orientation
from garment_sim_ros.geometry.ties import to_nanometres
from garment_sim_ros.geometry.triangles import area_vectors

_FLAT = 1e-4
"""A set of points thinner than this share of its size has no usable hull."""


@dataclass(frozen=True)
class Hull:
    """A convex polyhedron.

    Attributes:
        vertices: Corners [m], shape [n, 3].
        faces: Triangles, counter-clockwise seen from outside, shape [f, 3].
    """

    vertices: FloatArray
    faces: IntArray

    @cached_property
    def planes(self) -> FloatArray:
        """Outward unit normals and offsets, ``n . x <= offset`` inside, shape [f, 4]."""
        normal = area_vectors(self.vertices, self.faces)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        offset = np.max(np.einsum("fk,fck->fc", normal, self.vertices[self.faces]), axis=1)
        return np.column_stack([normal, offset])

    @cached_property
    def volume(self) -> float:
        """Enclosed volume [m^3]."""
        a, b, c = (self.vertices[self.faces] - self.vertices[0]).transpose(1, 0, 2)
        return float(np.einsum("fk,fk->", a, np.cross(b, c)) / 6.0)

    def height(self, points: FloatArray) -> FloatArray:
        """Largest signed plane distance of each point: negative inside [m], shape [n]."""
        return (points @ self.planes[:, :3].T - self.planes[:, 3]).max(axis=1)

    def outside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Points in front of any face, decided without rounding, shape [n]."""
        corners = self.vertices[self.faces]
        # Only faces that a point comes near to rounding need the exact decision.
        size = float(np.abs(self.vertices).max())
        near = points @ self.planes[:, :3].T - self.planes[:, 3] > -1e-9 * size
        result = np.zeros(len(points), dtype=np.bool_)
        for f in np.flatnonzero(near.any(axis=0)):
            a, b, c = corners[f][:, None]
            asked = np.flatnonzero(near[:, f] & ~result)
            result[asked] = orientation(a, b, c, points[asked])[0] < 0
        return result


def convex_hull(points: FloatArray) -> Hull:
    """The hull of points, its faces triangles turned outwards.

    Args:
        points: Positions [m], shape [n, 3].

    Raises:
        GeometryError: Fewer than 4 points, not finite, or nearly in one plane.
    """
    points = np.asarray(points, dtype=np.float64)
    if not np.isfinite(points).all():
        raise GeometryError("the points of a hull must be finite")
    centred = points - to_nanometres(points.mean(axis=0)) if len(points) else points
    if len(points) < 4:
        raise GeometryError(f"a hull needs 4 points; found {len(points)}")
    spread = np.linalg.svd(centred, compute_uv=False)
    if spread[2] <= _FLAT * spread[0]:
        raise GeometryError("the points lie nearly in one plane")
    try:
        qhull = ConvexHull(centred)
    except QhullError as error:
        raise GeometryError(f"no convex hull: {str(error).splitlines()[0]}") from None
    number = np.full(len(points), -1, dtype=np.int32)
    number[qhull.vertices] = np.arange(len(qhull.vertices))
    faces = number[qhull.simplices]
    vertices = points[qhull.vertices]
    normal = area_vectors(vertices, faces)
    inwards = np.einsum("fk,fk->f", normal, qhull.equations[:, :3]) < 0.0
    faces[inwards] = faces[inwards][:, ::-1]
    return Hull(np.ascontiguousarray(vertices), np.ascontiguousarray(faces))


def corner_normals(hull: Hull) -> FloatArray:
    """Unit normals at the corners, faces weighted by their angle there, shape [n, 3]."""
    corner = hull.vertices[hull.faces]
    to_next = np.roll(corner, -1, axis=1) - corner
    to_last = np.roll(corner, 1, axis=1) - corner
    cross = np.linalg.norm(np.cross(to_next, to_last), axis=-1)
    angle = np.arctan2(cross, (to_next * to_last).sum(axis=-1))
    normals = np.zeros_like(hull.vertices)
    np.add.at(normals, hull.faces, angle[..., None] * hull.planes[:, None, :3])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def inflate_vertices(hull: Hull, delta: float) -> Hull:
    """Corners moved out by `delta` [m] along their normals, and the hull of that (the paper's).

    Faces get less than `delta`: a face whose corners' normals lean away from its own by the
    angles g gains about ``delta cos g``. `clearance` tells how much.
    """
    return convex_hull(hull.vertices + delta * corner_normals(hull))


def inflate_planes(hull: Hull, delta: float) -> Hull:
    """Every face moved out by exactly `delta` [m]; corners go further, far at sharp ones."""
    inside = hull.vertices.mean(axis=0)
    planes = hull.planes + np.array([0.0, 0.0, 0.0, delta])
    halfspaces = np.column_stack([planes[:, :3], planes[:, :3] @ inside - planes[:, 3]])
    corners = HalfspaceIntersection(halfspaces, np.zeros(3)).intersections
    return convex_hull(corners + inside)


def clearance(outer: Hull, inner: Hull) -> FloatArray:
    """How far each face of `outer` is from the hull `inner` [m], negative where it cuts it."""
    return outer.planes[:, 3] - (outer.planes[:, :3] @ inner.vertices.T).max(axis=1)
