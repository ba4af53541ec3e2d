"""Triangle meshes from files, by trimesh's readers, whatever the file holds."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from garment_sim_ros.body.loaders.obj_file import read_obj
from garment_sim_ros.body.loaders.ply_file import read_ply
from garment_sim_ros.body.loaders.polygons import MAX_COORDINATE, MAX_MESH_BYTES
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.input_file import read_bytes

if TYPE_CHECKING:
    import trimesh

MESH_TYPES = (".stl", ".obj", ".ply", ".dae")
"""File types read; .dae needs the package pycollada."""

MAX_INSTANCES = 1000
"""Most geometries that a .dae file may show, instances of instances counted."""


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
    if suffix in (".obj", ".ply"):
        polygons = read_obj(path) if suffix == ".obj" else read_ply(path)
        return trimesh.Trimesh(polygons.vertices, polygons.fans()[0], process=False)
    data = read_bytes(path, limit=MAX_MESH_BYTES)
    try:
        if suffix == ".dae":
            _check_collada(fromstring(data, forbid_dtd=True))
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
    if not (np.abs(mesh.vertices) <= MAX_COORDINATE).all():
        raise InputFileError(
            path, "holds vertices that are not finite", f"allowed: up to {MAX_COORDINATE:g}"
        )
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise InputFileError(path, "holds triangles with vertices that are not there")
    return mesh


def _check_collada(root: Element) -> None:
    """Refuse nodes that show each other so often that a small file becomes a large one.

    Raises:
        ValueError: Too many instances, or a node that shows itself.
    """
    shown: dict[str, float] = {}  # geometries below each node that has an id; inf where it is open

    def count(element: Element) -> float:
        name = element.get("id") if _tag(element) == "node" else None
        if name is not None:
            shown[name] = np.inf
        total = 0.0
        for child in element:
            if _tag(child) in ("instance_geometry", "instance_controller"):
                total += 1.0
            elif _tag(child) == "instance_node":
                url = child.get("url", "").lstrip("#")
                if url not in shown and url in nodes:
                    count(nodes[url])
                total += shown.get(url, 0.0)
            elif _tag(child) in ("node", "visual_scene"):
                total += count(child)
        if name is not None:
            shown[name] = total
        return total

    nodes = {str(e.get("id")): e for e in root.iter() if _tag(e) == "node" and e.get("id")}
    if sum(map(count, (e for e in root.iter() if _tag(e) == "visual_scene"))) > MAX_INSTANCES:
        raise ValueError(f"shows over {MAX_INSTANCES} geometries")


def _tag(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]
