"""What is wrong with a mesh from a file as a garment of a body, in one line."""

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.attachments import highest_edge
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import UNITS, UP_AXES
from garment_sim_ros.garment.mesh_data import GarmentMesh
from garment_sim_ros.garment.patterns.tape_sections import loops_at
from garment_sim_ros.geometry.connectivity import components
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP

OFF_THE_BODY = 0.3
"""Median distance to the skin from which a garment is not on it [m]."""
_SMALLEST = 0.05
"""Smallest extent of a garment on a person of 1.65 m [m]."""
_LIKELY = 0.15
"""Likewise, of one that is told to be in another unit [m]."""
_SHEETS = 0.25
"""How far apart two sheets are that lie on each other, in sizes of their triangles."""
_OPPOSITE = -0.9
_NEIGHBOURS = 8
"""How many triangles around one are looked at for its other side."""
_MOST_STRETCH = 1.5
"""How much longer edges may become as a surface is put outside of a body: folds and holes are
left beyond."""
_LEAST_INSIDE = 0.5
"""Share of a section through the legs that is in a waist below the crotch."""
OTHER_BODY = "was it made for another body? name that: made_on, or --made-on of dress"


def check_sheet(mesh: GarmentMesh) -> None:
    """Sees whether a surface can be worn by anybody: it has openings, and one sheet.

    Raises:
        GeometryError: It is closed, or has a second sheet that faces the other way.
    """
    count = edge_table(mesh.triangles)[2]
    if count.min() > 1:
        raise GeometryError(
            "is closed: it has no open edge (a solid, or cloth with two sides?); allowed: one "
            "sheet, with openings for the body"
        )
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    centre, cross = (a + b + c) / 3.0, np.cross(b - a, c - a)
    double = np.maximum(np.linalg.norm(cross, axis=1), 1e-300)
    normal, size = cross / double[:, None], np.sqrt(double)
    apart, near = cKDTree(centre).query(centre, k=min(_NEIGHBOURS, len(centre)))
    opposite = np.einsum("ti,tki->tk", normal, normal[near]) < _OPPOSITE
    double_sided = (opposite & (apart < _SHEETS * size[:, None])).any(axis=1)
    if 2 * double_sided.sum() > len(centre):
        raise GeometryError(
            f"is two-sided: {double_sided.sum()} of {len(centre)} triangles have others on them "
            "that face the other way; allowed: one sheet"
        )


def check_place(mesh: GarmentMesh, measures: Measures, unit: str, up: str) -> None:
    """Sees whether a surface is near the body, and no speck of dust.

    Args:
        mesh: The surface in the frame of the body.
        measures: The body.
        unit: The unit that its file was read in.
        up: The axis that its file was read with.

    Raises:
        GeometryError: It is not; the message tells the unit or the axis with which it would be.
    """
    size, away = _size_and_distance(mesh.vertices, measures)
    if size >= _SMALLEST * measures.unit and away <= OFF_THE_BODY * measures.unit:
        return
    what = f"is {away:.3g} m away from {measures.body.name}"
    if size < _SMALLEST * measures.unit:
        what = f"is {size:.2g} m long"
    raise GeometryError(
        f"{what}; allowed: a garment from {_SMALLEST * measures.unit:.2f} m on, in its place on "
        f"the body ({_hint(mesh.vertices, measures, unit, up)})"
    )


def _hint(vertices: FloatArray, measures: Measures, unit: str, up: str) -> str:
    """With what else it would be in its place: the same axis first, then the largest."""
    x = vertices / UNITS[unit] @ (AXES_FROM_Y_UP if up == "y" else np.eye(3))
    for axis in (up, *(set(UP_AXES) - {up})):
        turned = x @ AXES_FROM_Y_UP.T if axis == "y" else x
        for name in sorted(UNITS, key=lambda name: -UNITS[name]):
            size, away = _size_and_distance(turned * UNITS[name], measures)
            likely = _LIKELY * measures.unit <= size <= measures.height
            if likely and away <= OFF_THE_BODY * measures.unit:
                wanted = [f"unit {name}"] * (name != unit) + [f"up {axis}"] * (axis != up)
                return f"with {' and '.join(wanted)} it is"
    return "is its unit or its up axis another one?"


def _size_and_distance(x: FloatArray, measures: Measures) -> tuple[float, float]:
    """Extent of points, and their median distance to the skin [m]."""
    few = x[:: max(1, len(x) // 2000)]
    skin = MeshDistance(measures.vertices, measures.body.skin.triangles)
    return float(np.ptp(x, axis=0).max()), float(np.median(np.abs(skin.signed_distance(few)[0])))


def check_stretch(name: str, given: GarmentMesh, vertices: FloatArray, body_name: str) -> None:
    """Sees whether a surface only had to be moved a little to be outside of the body.

    Args:
        name: What messages call the garment.
        given: The surface before.
        vertices: Where it is outside of the body [m], shape [v, 3].
        body_name: What messages call the body.

    Raises:
        GeometryError: It became far larger than it was.
    """
    a, b = edge_table(given.triangles)[0].T
    before = np.linalg.norm(given.vertices[a] - given.vertices[b], axis=1)
    after = np.linalg.norm(vertices[a] - vertices[b], axis=1)
    stretch = float(np.percentile(after / np.maximum(before, 1e-9), 95.0))
    if stretch > _MOST_STRETCH:
        raise GeometryError(
            f"garment {name!r} is too small for {body_name}: to be outside of it its edges would "
            f"be {stretch:.2g} times as long (95th percentile); allowed: {_MOST_STRETCH:g} times "
            f"({OTHER_BODY})"
        )


def check_waist(
    name: str, mesh: GarmentMesh, waist: IntArray, measures: Measures, covered: IntArray
) -> None:
    """Sees whether the open edge that is taken as a waist is around the body.

    What has several parts, as a pair of stockings, is around the legs with all of them together.

    Args:
        name: What messages call the garment.
        mesh: Its surface.
        waist: Vertices of that edge.
        measures: The body.
        covered: Triangles of its skin without arms, shape [t, 3].

    Raises:
        GeometryError: It lies below the crotch, and the legs are not in it.
    """
    x = mesh.vertices[waist]
    try:
        crotch = measures.crotch
    except GeometryError:
        return
    height = float(x[:, 2].mean())
    if height > crotch:
        return
    _, part = components(mesh.triangles, len(mesh.vertices))
    around = 0.0
    for number in np.setdiff1d(part, part[waist]):
        own = mesh.triangles[part[mesh.triangles[:, 0]] == number]
        edge = highest_edge(mesh.vertices, own)
        around += _around_legs(mesh.vertices[edge], measures, covered) if len(edge) else 0.0
    if around + _around_legs(x, measures, covered) < _LEAST_INSIDE:
        floor = float(measures.vertices[:, 2].min())
        raise GeometryError(
            f"garment {name!r} has its highest open edge {height - floor:.2g} m over the floor, "
            f"where it is not around {measures.body.name}; allowed: one around the hips, which "
            f"are above {crotch - floor:.2g} m, or attachments (another unit of length? "
            f"{OTHER_BODY})"
        )


def _around_legs(x: FloatArray, measures: Measures, covered: IntArray) -> float:
    """Share of the section through the legs that is within an open edge at its height."""
    legs = loops_at(measures.vertices, covered, float(x[:, 2].mean()), 2).points
    if not legs:
        return 1.0
    inside = Delaunay(x[:, :2], qhull_options="QJ").find_simplex(np.concatenate(legs))
    return float((inside >= 0).mean())


def loose_parts(x: FloatArray, triangles: IntArray, held: IntArray) -> tuple[str, ...]:
    """Says which parts of a garment nothing holds, in a sentence; none where none are held.

    Args:
        x: Vertices [m], shape [v, 3].
        triangles: Shape [t, 3].
        held: Attached vertices.
    """
    number, part = components(triangles, len(x))
    loose = np.setdiff1d(np.arange(number), part[held])
    if not len(held) or not len(loose):
        return ()
    first = ", ".join(f"{c:.2f}" for c in x[part == loose[0]].mean(axis=0))
    return (
        f"{len(loose)} of its {number} parts are attached to nothing, the first at ({first}) m: "
        "they fall where nothing is under them",
    )
