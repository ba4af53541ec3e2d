"""Sewn garments as glTF files: the draped surface, and the panels that it was cut from.

A .glb that any viewer shows: positions as draped, one vertex for each panel at a seam, texture
coordinates from the flat panels. Attributes of our own tell what a simulation needs beside that:
``_THREADS`` is where each vertex lies in its panel, weft and warp [m], ``_VERTEX`` the vertex of
the sewn garment that it is, ``_PANEL`` the number of its panel; the mesh's extras name the panels.
"""

from pathlib import Path

import numpy as np

from garment_sim_ros.arrays import AnyArray, FloatArray, IntArray
from garment_sim_ros.body.loaders.gltf_draco import decompress
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.garment.mesh_data import GarmentMesh
from garment_sim_ros.geometry.topology import non_manifold_edges, vertex_normals
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.glb_writer import GENERATOR, INDICES, VERTICES, GlbWriter

_FARTHEST = 1e3
"""Largest coordinate [m]."""
_MOST_VERTICES = 1_000_000


def write_sewn(
    path: str | Path,
    vertices: FloatArray,
    triangles: IntArray,
    flat: FloatArray,
    panel: IntArray,
    names: tuple[str, ...],
) -> None:
    """Writes a sewn garment.

    Args:
        path: A .glb file.
        vertices: At rest on the body, z up [m], shape [v, 3].
        triangles: Shape [t, 3].
        flat: Weft and warp of each triangle's corners [m], shape [t, 3, 2].
        panel: Number of each triangle's panel, shape [t].
        names: Names of the panels.
    """
    corner_panel = np.repeat(panel, 3)
    rows = np.column_stack([corner_panel, triangles.reshape(-1), flat.reshape(-1, 2)])
    _, first, index = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    vertex = triangles.reshape(-1)[first]
    threads = flat.reshape(-1, 2)[first]
    normals = np.zeros_like(vertices)
    vertex_normals(vertices, np.ascontiguousarray(triangles, np.int32), normals)
    arrays = {
        "POSITION": (vertices @ AXES_FROM_Y_UP)[vertex].astype("<f4"),
        "NORMAL": (normals @ AXES_FROM_Y_UP)[vertex].astype("<f4"),
        "TEXCOORD_0": _texture(threads, corner_panel[first]).astype("<f4"),
        "_THREADS": threads.astype("<f4"),
        "_VERTEX": vertex.astype("<f4"),
        "_PANEL": corner_panel[first].astype("<f4"),
    }
    _write_glb(Path(path), arrays, index.reshape(-1).astype("<u4"), names)


def _texture(threads: FloatArray, panel: IntArray) -> FloatArray:
    """Texture coordinates: all panels beside each other, each upright, in one square."""
    placed = threads.copy()
    x = 0.0
    for k in np.unique(panel):
        own = panel == k
        low, high = threads[own].min(axis=0), threads[own].max(axis=0)
        placed[own] += [x - low[0], -low[1]]
        x += high[0] - low[0] + 0.01
    placed /= max(float(placed.max()), 1e-9)
    placed[:, 1] = 1.0 - placed[:, 1]
    return placed


def _write_glb(
    path: Path, arrays: dict[str, AnyArray], indices: AnyArray, names: tuple[str, ...]
) -> None:
    glb = GlbWriter()
    attributes = {
        name: glb.accessor(array, target=VERTICES, bounds=name == "POSITION")
        for name, array in arrays.items()
    }
    primitive = {
        "attributes": attributes,
        "indices": glb.accessor(indices, target=INDICES),
        "material": glb.add("materials", {"doubleSided": True}),
    }
    mesh = {"primitives": [primitive], "extras": {GENERATOR: {"panels": list(names)}}}
    node = glb.add("nodes", {"mesh": glb.add("meshes", mesh)})
    glb.json["scene"] = glb.add("scenes", {"nodes": [node]})
    glb.write(path)


def read_sewn(path: str | Path) -> GarmentMesh | None:
    """A garment that `write_sewn` wrote; None for any other glTF file.

    Raises:
        InputFileError: It is damaged.
    """
    if Path(path).suffix.lower() != ".glb":
        return None
    file = GltfFile(path)
    meshes = file.list_of("meshes")
    if len(meshes) != 1 or not isinstance(meshes[0].get("extras"), dict):
        return None
    if GENERATOR not in meshes[0]["extras"]:
        return None
    primitives = file.items(meshes[0], "primitives", dict)
    if len(primitives) != 1 or not isinstance(primitives[0].get("attributes"), dict):
        raise file.error("is damaged: a sewn garment has one primitive")
    decompress(file, primitives[0])
    of = primitives[0]["attributes"]
    x = np.asarray(file.accessor(of, "POSITION", "VEC3"), np.float64) @ AXES_FROM_Y_UP.T
    threads = np.asarray(file.accessor(of, "_THREADS", "VEC2"), np.float64)
    vertex = np.asarray(file.accessor(of, "_VERTEX", "SCALAR"), np.float64)
    corner = np.asarray(file.accessor(primitives[0], "indices", "SCALAR"), np.int64)
    return _checked(file, x, threads, vertex, corner)


def _checked(
    file: GltfFile, x: FloatArray, threads: FloatArray, vertex: FloatArray, corner: AnyArray
) -> GarmentMesh:
    n = len(x)
    if not (0 < n == len(threads) == len(vertex) <= _MOST_VERTICES) or len(corner) % 3:
        raise file.error("is damaged: its attributes have different lengths")
    for what, values in (("positions", x), ("threads", threads)):
        if not (np.isfinite(values).all() and np.abs(values).max() < _FARTHEST):
            raise file.error(f"is damaged: {what} are not finite", f"up to {_FARTHEST:g} m")
    number = np.rint(np.where(np.isfinite(vertex), vertex, -1.0)).astype(np.int64)
    if number.min() < 0 or number.max() >= n or len(np.unique(number)) != number.max() + 1:
        raise file.error("is damaged: its vertices are not numbered from 0")
    if not len(corner) or corner.min() < 0 or corner.max() >= n:
        raise file.error("is damaged: its triangles name vertices that it does not have")
    joined = np.zeros((int(number.max()) + 1, 3))
    joined[number] = x
    triangles = number[corner].reshape(-1, 3).astype(np.int32)
    if len(non_manifold_edges(triangles)) or len(np.unique(triangles)) < len(joined):
        raise InputFileError(file.path, "is damaged: its triangles make no surface")
    return GarmentMesh(
        vertices=joined, triangles=triangles, flat=threads[corner].reshape(-1, 3, 2)
    )
