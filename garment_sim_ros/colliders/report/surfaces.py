"""Triangle meshes of collider shapes, for pictures."""

import numpy as np
from scipy.spatial import ConvexHull

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.contact.shapes import Collider
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.marching_tetrahedra import marching_tetrahedra
from garment_sim_ros.geometry.triangles import area_vectors


def surface(
    collider: Collider, *, directions: int = 400, finest: float = 0.0
) -> tuple[FloatArray, IntArray]:
    """A collider's surface in its own frame.

    Args:
        collider: Any but a frame.
        directions: Points on a round shape.
        finest: Least size of the triangles of a sampled shape [m].

    Returns:
        Vertices [m], shape [v, 3], and triangles, counter-clockwise seen from outside, [t, 3].

    Raises:
        GeometryError: The kind has no surface.
    """
    g = collider.geometry
    if collider.kind == "hull":
        return np.asarray(g["vertices"], np.float64), np.asarray(g["faces"], np.int32)
    if collider.kind == "sdf":
        return _of_grid(DistanceGrid.of(g), finest)
    around = _directions(directions)
    if collider.kind == "sphere":
        points = around * _number(g["radius"])
    elif collider.kind == "capsule":
        end = np.array([0.0, 0.0, _number(g["length"])])
        points = np.concatenate(
            [around * _number(g["radius0"]), end + around * _number(g["radius1"])]
        )
    elif collider.kind == "ellipsoid":
        points = around * np.asarray(g["radii"], dtype=np.float64)
    else:
        raise GeometryError(f"collider {collider.name!r}: kind {collider.kind!r} has no surface")
    return _convex(points)


def _of_grid(grid: DistanceGrid, finest: float) -> tuple[FloatArray, IntArray]:
    """The surface of a sampled distance, sampled anew where that is finer than asked for."""
    if finest <= grid.cell:
        field = grid.distance.astype(np.float64)
        return marching_tetrahedra(field, grid.low, grid.cell)
    box = grid.box()
    low = box[:3] - finest
    nx, ny, nz = (int(n) + 1 for n in np.ceil((box[3:] + finest - low) / finest))
    at = low + finest * np.indices((nx, ny, nz)).reshape(3, -1).T
    return marching_tetrahedra(grid.value(at).reshape(nx, ny, nz), low, finest)


def _number(value: object) -> float:
    return float(value)  # type: ignore[arg-type]


def _directions(count: int) -> FloatArray:
    """Unit vectors spread evenly (Fibonacci lattice), shape [n, 3]."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * i
    r = np.sqrt(1.0 - z * z)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


def _convex(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """The convex hull of points with outward triangles."""
    hull = ConvexHull(points)
    triangles = hull.simplices
    inward = (area_vectors(points, triangles) * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    used, index = np.unique(triangles, return_inverse=True)
    return points[used], index.reshape(-1, 3).astype(np.int32)
