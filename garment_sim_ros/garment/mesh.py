"""Loading a garment mesh: read, repaired, turned to z up, refined."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GeometryError, ParameterError
from garment_sim_ros.garment.markings import marked, texture_seams
from garment_sim_ros.garment.mesh_data import GarmentMesh as GarmentMesh
from garment_sim_ros.garment.mesh_repair import repaired, triangulate
from garment_sim_ros.garment.polygon_files import read_polygons
from garment_sim_ros.garment.sewn_file import read_sewn
from garment_sim_ros.geometry.subdivide import subdivided
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.input_file import said_of

UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Metres in each unit that a garment file may be in."""

UP_AXES = ("y", "z")
"""Up axes that a garment file may have; y up faces +z, z up faces +x."""


def load_garment_mesh(
    path: str | Path, *, unit: str = "m", up: str = "y", edge_length: float | None = None
) -> GarmentMesh:
    """A garment from an OBJ, PLY or glTF file.

    Args:
        path: The file.
        unit: The file's length unit, one of `UNITS`.
        up: The file's up axis, one of `UP_AXES`.
        edge_length: Edge length wanted [m], see `subdivided`; None keeps the file's mesh.

    What `sewn_file` wrote is taken as it is: it has its unit, its axes and its edges.

    Raises:
        InputFileError: The file cannot be read, or its surface cannot be repaired.
        ParameterError: Another unit or axis.
    """
    for name, value, known in (("unit", unit, tuple(UNITS)), ("up", up, UP_AXES)):
        if value not in known:
            raise ParameterError(name, f"found {value!r}", f"allowed: {', '.join(known)}")
    sewn = read_sewn(path)
    if sewn is not None:
        return sewn
    polygons = read_polygons(path)
    x = polygons.vertices * UNITS[unit]
    if up == "y":
        x = x @ AXES_FROM_Y_UP.T
    corner = triangulate(x[polygons.corners], np.arange(len(polygons.corners)), polygons.sizes)
    raw = polygons.corners[corner].astype(np.int32)
    seams = np.zeros((0, 2), np.int32)
    with said_of(path):
        vertices, triangles, notes = repaired(x, raw)
        if polygons.texture is not None and edge_length is None:
            seams = texture_seams(x, raw, polygons.texture[corner], vertices)
        if edge_length is not None:
            before = len(vertices)
            vertices, triangles = subdivided(vertices, triangles, edge_length)
            if len(vertices) > before:
                notes += (
                    f"{len(vertices) - before} vertices were added for edges of about "
                    f"{edge_length:g} m",
                )
    mesh = GarmentMesh(vertices=vertices, triangles=triangles, notes=notes, seams=seams)
    return marked(mesh, x, raw, polygons.colours, polygons.vertex_groups())


def mesh_from(
    mesh: str | Path | FloatArray,
    triangles: Sequence[Sequence[int]] | NDArray[np.integer] | None = None,
    *,
    unit: str = "m",
    up: str = "y",
    edge_length: float | None = None,
) -> GarmentMesh:
    """A garment's surface from a file, or from arrays, which are taken as they are.

    Args:
        mesh: A file as for `load_garment_mesh`; or positions, z up [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3]; only with positions.
        unit: The file's length unit.
        up: The file's up axis.
        edge_length: Edge length wanted [m], see `subdivided`; None keeps the mesh.

    Raises:
        InputFileError: The file cannot be read, or its surface cannot be repaired.
        GeometryError: Arrays of another shape.
        ParameterError: Another unit or axis.
    """
    if isinstance(mesh, str | Path):
        if triangles is not None:
            raise ParameterError("triangles", f"found some beside {mesh}", "allowed: no others")
        return load_garment_mesh(mesh, unit=unit, up=up, edge_length=edge_length)
    x = np.array(mesh, dtype=np.float64)
    t = np.array(() if triangles is None else triangles, dtype=np.int32)
    for what, array in (("vertices", x), ("triangles", t)):
        if array.ndim != 2 or array.shape[1] != 3:
            raise GeometryError(f"{what}: found shape {array.shape}; allowed: [n, 3]")
    if edge_length is not None:
        x, t = subdivided(x, t, edge_length)
    return GarmentMesh(vertices=x, triangles=t)
