"""Polygons of garment files (OBJ, PLY, GLB) as they stand in the file, nothing repaired.

Polygons come back as a flat corner list with their sizes, so that a quad can later be split along
its shorter diagonal. Sizes that a file declares are checked against its length before memory is
taken. Formats: Wavefront OBJ (appendix B1 of the Advanced Visualizer manual); PLY 1.0 (Turk 1994,
"The PLY Polygon File Format"); glTF 2.0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.body.loaders.input_file import read_bytes, read_text
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.geometry.transforms import matrix_from_quaternion, transform_points

MAX_FILE_BYTES = 128 * 2**20
"""Largest garment file that is read."""

MAX_VERTICES = 1_000_000
"""Largest number of vertices and of polygons in one garment."""


@dataclass(frozen=True, kw_only=True)
class Polygons:
    """Polygons of one file.

    Attributes:
        vertices: Positions in the file's units and axes, shape [v, 3].
        corners: Vertex indices of all polygons one after the other, shape [sum of sizes].
        sizes: Corners of each polygon, at least 3, shape [p].
    """

    vertices: NDArray[np.float64]
    corners: NDArray[np.int64]
    sizes: NDArray[np.int64]


def read_polygons(path: str | Path) -> Polygons:
    """The polygons of an .obj, .ply or .glb/.gltf file.

    Raises:
        InputFileError: Missing, empty, too large, truncated or malformed; an unknown format; no
            polygon; a position that is not finite; an index out of range.
    """
    readers: dict[str, Callable[[str | Path], Polygons]] = {
        ".obj": _read_obj,
        ".ply": _read_ply,
        ".glb": _read_gltf,
        ".gltf": _read_gltf,
    }
    suffix = Path(path).suffix.lower()
    if suffix not in readers:
        raise InputFileError(path, f"has type {suffix!r}", "allowed: " + ", ".join(readers))
    polygons = readers[suffix](path)
    v, p = len(polygons.vertices), len(polygons.sizes)
    if p == 0:
        raise InputFileError(path, "has no polygons", "allowed: a surface of 1 or more")
    if max(v, p) > MAX_VERTICES:
        raise InputFileError(
            path, f"has {v} vertices and {p} polygons", f"allowed: up to {MAX_VERTICES} each"
        )
    if polygons.sizes.min() < 3:
        raise InputFileError(path, "has a polygon of fewer than 3 corners", "allowed: 3 or more")
    bad = np.flatnonzero(~np.isfinite(polygons.vertices).all(axis=1))
    if bad.size:
        raise InputFileError(path, f"vertex {bad[0]} is not finite", "allowed: finite numbers")
    low, high = polygons.corners.min(), polygons.corners.max()
    if low < 0 or high >= v:
        raise InputFileError(
            path,
            f"a polygon refers to vertex {low if low < 0 else high}",
            f"allowed: 0 to {v - 1}",
        )
    return polygons


def _read_obj(path: str | Path) -> Polygons:
    positions: list[list[float]] = []
    corners: list[int] = []
    sizes: list[int] = []
    text = read_text(path, limit=MAX_FILE_BYTES).replace("\\\n", " ").replace("\\\r\n", " ")
    for number, line in enumerate(text.splitlines(), start=1):
        kind, *fields = line.split("#", 1)[0].split() or [""]
        if kind not in ("v", "f"):
            continue
        try:
            if kind == "v":
                x, y, z = fields[:3]
                positions.append([float(x), float(y), float(z)])
                continue
            indices = [int(field.split("/", 1)[0]) for field in fields]
        except ValueError as error:
            raise InputFileError(
                path, f"line {number} reads {line[:60]!r}", "allowed: v x y z, f i j k ..."
            ) from error
        if 0 in indices:
            raise InputFileError(path, f"line {number} has index 0", "allowed: from 1, or from -1")
        corners += [i - 1 if i > 0 else len(positions) + i for i in indices]
        sizes.append(len(indices))
    return Polygons(
        vertices=np.array(positions, dtype=np.float64).reshape(-1, 3),
        corners=np.array(corners, dtype=np.int64),
        sizes=np.array(sizes, dtype=np.int64),
    )


_PLY_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2"},
    **{"uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"},
}


def _read_ply(path: str | Path) -> Polygons:
    data = read_bytes(path, limit=MAX_FILE_BYTES)
    head, found, body = data.partition(b"end_header")
    if not head.startswith(b"ply") or not found:
        raise InputFileError(path, "is not PLY, or truncated", "allowed: a PLY header and data")
    body = body[2:] if body.startswith(b"\r\n") else body[1:]
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()[1:]]
    try:
        layout = next(line[1] for line in lines if line[:1] == ["format"])
        elements: list[tuple[str, int, list[list[str]]]] = []
        for line in lines:
            if line[:1] == ["element"]:
                elements.append((line[1], int(line[2]), []))
            elif line[:1] == ["property"]:
                elements[-1][2].append(line[1:])
        if layout == "ascii":
            take = _ascii_values(body)
        else:
            order = {"binary_little_endian": "<", "binary_big_endian": ">"}[layout]
            take = _binary_values(body, order)
        return _ply_polygons(path, elements, take, len(body))
    except (StopIteration, LookupError, ValueError) as error:
        raise InputFileError(
            path, f"is malformed or truncated ({error!r})", "allowed: PLY 1.0"
        ) from error


def _ascii_values(body: bytes) -> Callable[[str, int], NDArray[np.float64]]:
    """A reader of the next `count` numbers of a text body."""
    words = np.array(body.split())
    position = 0

    def take(_type: str, count: int) -> NDArray[np.float64]:
        nonlocal position
        values = words[position : position + count].astype(np.float64)
        if len(values) < count:
            raise ValueError("fewer numbers than declared")
        position += count
        return values

    return take


def _binary_values(body: bytes, order: str) -> Callable[[str, int], NDArray[np.float64]]:
    """A reader of the next `count` numbers of a binary body."""
    position = 0

    def take(kind: str, count: int) -> NDArray[np.float64]:
        nonlocal position
        dtype = np.dtype(order + _PLY_TYPES[kind])
        values = np.frombuffer(body, dtype, count, position)
        position += count * dtype.itemsize
        return values.astype(np.float64)

    return take


def _ply_polygons(
    path: str | Path,
    elements: list[tuple[str, int, list[list[str]]]],
    take: Callable[[str, int], NDArray[np.float64]],
    available: int,
) -> Polygons:
    vertices = np.zeros((0, 3))
    corners: list[NDArray[np.float64]] = []
    for name, count, properties in elements:
        # Every element takes at least one byte per property, in text as in binary.
        if not 0 <= count <= min(MAX_VERTICES, available // max(len(properties), 1)):
            raise InputFileError(
                path,
                f"declares {count} elements {name!r} in {available} bytes",
                f"allowed: what the file holds, up to {MAX_VERTICES}",
            )
        if name == "vertex":
            vertices = np.zeros((count, 3))
        for row in range(count):
            for kind, *rest in properties:
                if kind == "list":
                    size_type, item_type, label = rest
                    size = int(take(size_type, 1)[0])
                    if size < 0:
                        raise ValueError(f"a list of {size} items")
                    values = take(item_type, size)
                    if name == "face" and label in ("vertex_indices", "vertex_index"):
                        corners.append(values)
                else:
                    value = take(kind, 1)[0]
                    if name == "vertex" and rest[0] in ("x", "y", "z"):
                        vertices[row, "xyz".index(rest[0])] = value
    return Polygons(
        vertices=vertices,
        corners=np.concatenate([np.zeros(0), *corners]).astype(np.int64),
        sizes=np.array([len(c) for c in corners], dtype=np.int64),
    )


def _read_gltf(path: str | Path) -> Polygons:
    file = GltfFile(path)
    nodes, meshes = file.list_of("nodes"), file.list_of("meshes")
    vertices: list[NDArray[np.float64]] = [np.zeros((0, 3))]
    corners: list[NDArray[np.int64]] = [np.zeros(0, np.int64)]
    for node, T_root_node in zip(nodes, _node_transforms(file, nodes)):
        if "mesh" not in node:
            continue
        for primitive in file.items(
            meshes[file.index(node, "mesh", len(meshes))], "primitives", dict
        ):
            if primitive.get("mode", 4) != 4:
                continue
            attributes = primitive.get("attributes")
            if not isinstance(attributes, dict):
                raise file.error("a primitive has no attributes")
            x = file.accessor(attributes, "POSITION", "VEC3")
            if "indices" in primitive:
                index = file.accessor(primitive, "indices", "SCALAR").astype(np.int64)
            else:
                index = np.arange(len(x))
            if len(index) % 3 or index.max() >= len(x):
                raise file.error("the indices of a primitive are malformed", "allowed: triangles")
            corners.append(index + sum(map(len, vertices)))
            vertices.append(transform_points(T_root_node, x))
    flat = np.concatenate(corners)
    return Polygons(
        vertices=np.concatenate(vertices), corners=flat, sizes=np.full(len(flat) // 3, 3)
    )


def _node_transforms(file: GltfFile, nodes: list[dict]) -> NDArray[np.float64]:
    """Transform of every node in the scene's root, shape [n, 4, 4].

    Raises:
        InputFileError: A node has two parents or is below itself.
    """
    n = len(nodes)
    parent = np.full(n, -1)
    T = np.tile(np.eye(4), (n, 1, 1))
    for i, node in enumerate(nodes):
        for child in file.items(node, "children", int):
            if not 0 <= child < n or parent[child] >= 0:
                raise file.error(f"node {i} has the child {child}", "allowed: a tree of nodes")
            parent[child] = i
        matrix = file.numbers(node, "matrix", 16)
        if matrix is not None:
            T[i] = matrix.reshape(4, 4).T
            continue
        rotation = file.numbers(node, "rotation", 4)
        scale = file.numbers(node, "scale", 3)
        translation = file.numbers(node, "translation", 3)
        if rotation is not None:
            T[i, :3, :3] = matrix_from_quaternion(rotation)
        if scale is not None:
            T[i, :3, :3] *= scale
        if translation is not None:
            T[i, :3, 3] = translation
    world = T.copy()
    ancestor = parent.copy()
    for _ in range(n):
        below = ancestor >= 0
        if not below.any():
            return world
        world[below] = T[ancestor[below]] @ world[below]
        ancestor[below] = parent[ancestor[below]]
    if (ancestor >= 0).any():
        raise file.error("a node is its own ancestor", "allowed: a tree of nodes")
    return world
