"""Triangle meshes from files, by trimesh's readers, whatever the file holds."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from garment_sim_ros.body.loaders.input_file import read_bytes
from garment_sim_ros.errors import InputFileError

if TYPE_CHECKING:
    import trimesh

MESH_TYPES = (".stl", ".obj", ".ply", ".dae")
"""File types read; .dae needs the package pycollada."""


def read_mesh(path: str | Path) -> trimesh.Trimesh:
    """The triangles of a mesh file, as they stand in it.

    Raises:
        InputFileError: Missing, of another type, damaged, without triangles, not finite.
    """
    import trimesh  # takes most of a second, which bodies without such files need not wait

    suffix = Path(path).suffix.lower()
    if suffix not in MESH_TYPES:
        raise InputFileError(
            path, f"has the ending {suffix!r}", f"allowed: {', '.join(MESH_TYPES)}"
        )
    data = read_bytes(path)
    try:
        if suffix == ".dae":
            fromstring(data, forbid_dtd=True)  # trimesh's own reader would expand entities
        # Read from memory, so that materials and textures beside the file are never opened.
        mesh = trimesh.load(
            io.BytesIO(data),
            file_type=suffix[1:],
            force="mesh",
            process=False,
            skip_materials=True,
        )
    except (DefusedXmlException, MemoryError, ImportError) as error:
        raise InputFileError(path, f"cannot be read as a mesh ({error})") from error
    except Exception as error:  # whatever a damaged file makes the reader do
        raise InputFileError(path, f"is not a usable {suffix} mesh ({error})") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise InputFileError(path, "holds no triangles")
    if not np.isfinite(mesh.vertices).all():
        raise InputFileError(path, "holds vertices that are not finite")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise InputFileError(path, "holds triangles with vertices that are not there")
    return mesh
