"""The nodes of a glTF file and the triangles that hang on them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, LongArray
from garment_sim_ros.body.loaders.gltf_draco import decompress
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.geometry.transforms import matrix_from_quaternion

MAX_NODES = 65_536
MAX_DEPTH = 1024
MAX_PIECES = 4096
MAX_VERTICES = 5_000_000

_USES_PER_BYTE = 2
"""Vertices and corners of all pieces for each byte of the file. What is not used twice takes a
byte or more each; a mesh that hangs on thousands of nodes does not fit."""
_FREE_USES = 10_000


@dataclass(frozen=True)
class Piece:
    """The triangles of one primitive on one node.

    Attributes:
        node: The node.
        attributes: The primitive's accessors by name.
        vertices: Positions in the node's frame, shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        material: What the primitive names as its material.
    """

    node: int
    attributes: dict[str, Any]
    vertices: FloatArray
    triangles: LongArray
    material: Any = None


class Scene:
    """The tree of nodes.

    Args:
        file: The file.

    Attributes:
        parent: Parent of each node, -1 for roots.
        order: The nodes depth first, parents before children.

    Raises:
        InputFileError: The nodes are not one or more trees, or show too many meshes.
    """

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._nodes = file.list_of("nodes")
        self._primitives = [
            file.items(mesh, "primitives", dict) for mesh in file.list_of("meshes")
        ]
        shown = sum(
            1 + len(self._primitives[file.index(node, "mesh", len(self._primitives))])
            for node in self._nodes
            if "mesh" in node
        )
        if shown > MAX_PIECES:
            raise file.error(
                f"shows {shown} meshes and primitives", f"allowed: up to {MAX_PIECES}"
            )
        self.parent, self.order = self._tree()

    def transforms(self, T_world_root: FloatArray) -> FloatArray:
        """Affine transforms of all nodes in the world, shape [nodes, 4, 4].

        Args:
            T_world_root: Transform of the scene in the world, shape [4, 4].
        """
        T_world = np.zeros((len(self._nodes), 4, 4))
        for n in self.order:
            above = self.parent[n]
            T_world[n] = (T_world_root if above == -1 else T_world[above]) @ self.local(n)
        if not np.isfinite(T_world).all():
            raise self._file.error("has node transforms that are not finite")
        return T_world

    def local(self, n: int) -> FloatArray:
        """The affine transform of a node in its parent's frame, shape [4, 4]."""
        matrix = self._file.numbers(self._nodes[n], "matrix", 16)
        if matrix is not None:
            return matrix.reshape(4, 4).T
        translation, rotation, scale = self.parts(n)
        T = np.eye(4)
        T[:3, :3] = matrix_from_quaternion(rotation) * scale
        T[:3, 3] = translation
        return T

    def parts(self, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Translation [3], unit quaternion (x, y, z, w) and scale [3] of a node without matrix."""
        file, node = self._file, self._nodes[n]
        translation = file.numbers(node, "translation", 3)
        q = file.numbers(node, "rotation", 4)
        scale = file.numbers(node, "scale", 3)
        if q is None:
            q = np.array([0.0, 0.0, 0.0, 1.0])
        length = np.linalg.norm(q)
        if not 1e-6 <= length <= 1e6:
            raise file.error(
                f"node {n} has the rotation {q.tolist()}", "allowed: a unit quaternion"
            )
        return (
            np.zeros(3) if translation is None else translation,
            q / length,
            np.ones(3) if scale is None else scale,
        )

    def pieces(self) -> Iterator[Piece]:
        """The triangles of every node that has a mesh, in the order of the nodes.

        Raises:
            InputFileError: Malformed, or more is made of the file's bytes than they can hold.
        """
        file = self._file
        uses, vertices = 0, 0
        for n, node in enumerate(self._nodes):
            if "mesh" not in node:
                continue
            for primitive in self._primitives[node["mesh"]]:
                if primitive.get("mode", 4) not in (4, 5, 6):
                    continue  # points and lines are no surface
                attributes = primitive.get("attributes")
                if not isinstance(attributes, dict) or "POSITION" not in attributes:
                    raise file.error(f"a primitive of node {n} has no POSITION")
                decompress(file, primitive)
                x = file.accessor(attributes, "POSITION", "VEC3").astype(np.float64)
                triangles = _triangles(file, primitive, len(x))
                vertices += len(x)
                uses += len(x) + triangles.size
                most = _USES_PER_BYTE * file.size + _FREE_USES
                if uses > most or vertices > MAX_VERTICES:
                    raise file.error(
                        f"shows {vertices} vertices and more from {file.size} bytes",
                        f"allowed: {MAX_VERTICES} vertices, and {most} vertices and corners",
                    )
                yield Piece(n, attributes, x, triangles, primitive.get("material"))

    def _tree(self) -> tuple[list[int], list[int]]:
        file, nodes = self._file, self._nodes
        if not 0 < len(nodes) <= MAX_NODES:
            raise file.error(f"has {len(nodes)} nodes", f"allowed: 1 to {MAX_NODES}")
        parent = [-1] * len(nodes)
        children = [file.items(node, "children", int) for node in nodes]
        for n, below in enumerate(children):
            for child in below:
                if not 0 <= child < len(nodes):
                    raise file.error(
                        f"node {n} has the child {child}", f"allowed: 0 to {len(nodes) - 1}"
                    )
                if parent[child] != -1:
                    raise file.error(f"node {child} has two parents", "allowed: one")
                parent[child] = n
        order: list[int] = []
        stack = [(n, 0) for n in reversed(range(len(nodes))) if parent[n] == -1]
        while stack:
            n, depth = stack.pop()
            if depth > MAX_DEPTH:
                raise file.error(f"nodes are nested over {MAX_DEPTH} deep")
            order.append(n)
            stack.extend((child, depth + 1) for child in reversed(children[n]))
        if len(order) != len(nodes):
            raise file.error("has nodes that are their own ancestors", "allowed: a tree")
        return parent, order


def _triangles(file: GltfFile, primitive: dict[str, Any], count: int) -> NDArray[np.int64]:
    """Vertex indices of a primitive's triangles, lists, strips and fans alike."""
    if "indices" in primitive:
        index = file.accessor(primitive, "indices", "SCALAR").astype(np.int64)
    else:
        index = np.arange(count)
    if index.min() < 0 or index.max() >= count:
        raise file.error(f"a triangle names vertex {index.max()}", f"allowed: 0 to {count - 1}")
    mode = primitive.get("mode", 4)
    if mode == 4:
        return index[: len(index) - len(index) % 3].reshape(-1, 3)
    if mode == 6:
        return np.column_stack([np.full(max(len(index) - 2, 0), index[0]), index[1:-1], index[2:]])
    strip = np.column_stack([index[:-2], index[1:-1], index[2:]])
    strip[1::2] = strip[1::2, [1, 0, 2]]
    return strip
