"""Polygons of garment files (OBJ, PLY, glTF) as they stand in the file, nothing repaired."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.body.loaders.gltf_marks import GltfMarks
from garment_sim_ros.body.loaders.gltf_scene import Scene
from garment_sim_ros.body.loaders.obj_file import read_obj
from garment_sim_ros.body.loaders.ply_file import read_ply
from garment_sim_ros.body.loaders.polygons import Polygons, checked
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.geometry.transforms import transform_points

MAX_VERTICES = 1_000_000
"""Largest number of vertices and of triangles in one garment."""


def read_polygons(path: str | Path) -> Polygons:
    """The polygons of an .obj, .ply or .glb/.gltf file.

    Raises:
        InputFileError: Missing, empty, too large, truncated or malformed; an unknown format; no
            polygon; a position that is not finite; an index out of range.
    """
    readers: dict[str, Callable[[str | Path], Polygons]] = {
        ".obj": read_obj,
        ".ply": read_ply,
        ".glb": _read_gltf,
        ".gltf": _read_gltf,
    }
    suffix = Path(path).suffix.lower()
    if suffix not in readers:
        raise InputFileError(path, f"has type {suffix!r}", "allowed: " + ", ".join(readers))
    polygons = readers[suffix](path)
    v, t = len(polygons.vertices), int(np.maximum(polygons.sizes - 2, 0).sum())
    if max(v, t) > MAX_VERTICES:
        raise InputFileError(
            path, f"has {v} vertices and {t} triangles", f"allowed: up to {MAX_VERTICES} each"
        )
    return polygons


def _read_gltf(path: str | Path) -> Polygons:
    file = GltfFile(path)
    scene = Scene(file)
    vertices: list[NDArray[np.float64]] = [np.zeros((0, 3))]
    corners: list[NDArray[np.int64]] = [np.zeros(0, np.int64)]
    offset = 0
    marks = GltfMarks(file)
    with np.errstate(over="ignore", invalid="ignore"):  # results are checked to be finite
        T_root_node = scene.transforms(np.eye(4))
        for piece in scene.pieces():
            vertices.append(transform_points(T_root_node[piece.node], piece.vertices))
            corners.append(piece.triangles.ravel() + offset)
            offset += len(piece.vertices)
            marks.add(piece)
    flat = np.concatenate(corners)
    texture = marks.texture()
    return checked(
        path,
        Polygons(
            vertices=np.concatenate(vertices),
            corners=flat,
            sizes=np.full(len(flat) // 3, 3),
            colours=marks.colours(),
            marked=marks.groups(),
            texture=None if texture is None else texture[flat],
        ),
    )
