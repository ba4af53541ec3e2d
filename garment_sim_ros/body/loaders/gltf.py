"""Skinned bodies from glTF 2.0 files: .gltf, .glb and .vrm.

All skinned meshes of the file become one skin. Transforms above the skeleton, and scale anywhere,
are baked into joint frames and vertices, because a rig's transforms are rigid. Joints keep the
orientation that they have in the file.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from garment_sim_ros.body.loaders.assembly import assemble
from garment_sim_ros.body.loaders.gltf_bind import blend, rest_frames, rigid
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.body.loaders.weights import weight_matrix
from garment_sim_ros.body.skin import HUMANOID_BONES, Body
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.geometry.transforms import (
    AXES_FROM_Y_UP,
    matrix_from_quaternion,
)

FloatArray = NDArray[np.float64]

MAX_NODES = 65_536
MAX_DEPTH = 1024
MAX_JOINTS = 4096
MAX_VERTICES = 5_000_000


@dataclass(frozen=True)
class _Mesh:
    """Triangles of one node; `W` is over the skin's joints, or None for a rigid mesh."""

    node: int
    skin: int | None
    vertices: FloatArray
    triangles: NDArray[np.int64]
    W: sp.csr_matrix | None


def load_gltf(
    path: str | Path, *, humanoid_overrides: Mapping[str, str | None] | None = None
) -> Body:
    """The body in a glTF file with at least one skinned mesh.

    Args:
        path: A .gltf, .glb or .vrm file, y up, facing +z (VRM 0.x: -z).
        humanoid_overrides: Joint name of some humanoid bones; a VRM file brings its own.

    Raises:
        InputFileError: The file cannot be read, or holds no usable skinned body.
    """
    file = GltfFile(path)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # results are checked to be finite
            return _load(file, Path(path).stem, humanoid_overrides)
    except (GeometryError, np.linalg.LinAlgError) as error:
        raise InputFileError(path, str(error)) from error


def _load(file: GltfFile, name: str, overrides: Mapping[str, str | None] | None) -> Body:
    parent, order = _node_tree(file)
    T_world = _world_transforms(file, parent, order)
    skins = _skins(file)
    meshes = _meshes(file, skins)
    if not any(mesh.skin is not None for mesh in meshes):
        raise file.error("has no skinned mesh", "allowed: a mesh with a skin and joints")
    joints = _joint_nodes(parent, order, {int(n) for nodes, _ in skins.values() for n in nodes})
    slot = {node: j for j, node in enumerate(joints)}
    M, notes = rest_frames(
        parent,
        T_world,
        joints,
        [(*skins[i], [m.vertices for m in meshes if m.skin == i]) for i in skins],
    )

    vertices, triangles, rows = [], [], []
    offset = 0
    for mesh in meshes:
        if mesh.skin is not None and mesh.W is not None:
            nodes, T_joint_bind = skins[mesh.skin]
            columns = np.array([slot[int(n)] for n in nodes])
            W = sp.csr_matrix(
                mesh.W
                @ sp.csr_matrix(
                    (np.ones(len(nodes)), (np.arange(len(nodes)), columns)),
                    shape=(len(nodes), len(joints)),
                )
            )
            A = M[columns] @ T_joint_bind
            x = blend(mesh.vertices, mesh.W, A)
        else:
            owner = _nearest_joint(parent, slot, mesh.node)
            if owner is None:
                notes.append(f"mesh of node {mesh.node} hangs on no joint; left out")
                continue
            W = weight_matrix(
                np.arange(len(mesh.vertices)),
                np.full(len(mesh.vertices), slot[owner]),
                np.ones(len(mesh.vertices)),
                (len(mesh.vertices), len(joints)),
            )
            A = M[slot[owner]] @ np.linalg.pinv(T_world[owner]) @ T_world[mesh.node][None]
            x = mesh.vertices @ A[0, :3, :3].T + A[0, :3, 3]
        flipped = np.linalg.det(A[0, :3, :3]) < 0.0
        triangles.append((mesh.triangles[:, ::-1] if flipped else mesh.triangles) + offset)
        offset += len(x)
        vertices.append(x)
        rows.append(W)

    names = _unique_names(file, joints)
    return assemble(
        name,
        names,
        np.array([slot.get(parent[n], -1) for n in joints], dtype=np.int32),
        rigid(M),
        np.concatenate(vertices),
        np.concatenate(triangles).astype(np.int32),
        sp.vstack(rows, format="csr"),
        notes=notes,
        humanoid_overrides={**_vrm_bones(file, dict(zip(joints, names))), **(overrides or {})},
    )


def _node_tree(file: GltfFile) -> tuple[list[int], list[int]]:
    """Parent of each node (-1 for roots), and the nodes depth first, parents before children."""
    nodes = file.list_of("nodes")
    if not 0 < len(nodes) <= MAX_NODES:
        raise file.error(f"has {len(nodes)} nodes", f"allowed: 1 to {MAX_NODES}")
    parent = [-1] * len(nodes)
    children = [file.items(node, "children", int) for node in nodes]
    for n, below in enumerate(children):
        for child in below:
            if not 0 <= child < len(nodes):
                raise file.error(f"node {n} has the child {child}", f"0 to {len(nodes) - 1}")
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


def _world_transforms(file: GltfFile, parent: list[int], order: list[int]) -> FloatArray:
    """Affine node transforms in the file's scene, turned to z up, shape [nodes, 4, 4]."""
    nodes = file.list_of("nodes")
    T_world = np.zeros((len(nodes), 4, 4))
    axes = np.eye(4)
    axes[:3, :3] = AXES_FROM_Y_UP
    for n in order:
        matrix = file.numbers(nodes[n], "matrix", 16)
        if matrix is not None:
            T = matrix.reshape(4, 4).T
        else:
            T = np.eye(4)
            q = file.numbers(nodes[n], "rotation", 4)
            if q is not None:
                length = np.linalg.norm(q)
                if length < 1e-6:
                    raise file.error(f"node {n} has the rotation {q.tolist()}", "unit quaternion")
                T[:3, :3] = matrix_from_quaternion(q / length)
            scale = file.numbers(nodes[n], "scale", 3)
            if scale is not None:
                T[:3, :3] *= scale
            translation = file.numbers(nodes[n], "translation", 3)
            if translation is not None:
                T[:3, 3] = translation
        T_world[n] = (axes if parent[n] == -1 else T_world[parent[n]]) @ T
    if not np.isfinite(T_world).all():
        raise file.error("has node transforms that are not finite")
    return T_world


def _skins(file: GltfFile) -> dict[int, tuple[list[int], FloatArray]]:
    """Joint nodes and inverse bind matrices of every skin that a mesh wears."""
    count = len(file.list_of("skins"))
    worn = [node for node in file.list_of("nodes") if "mesh" in node and "skin" in node]
    return {i: _skin(file, i) for i in sorted({file.index(node, "skin", count) for node in worn})}


def _meshes(file: GltfFile, skins: Mapping[int, tuple[list[int], FloatArray]]) -> list[_Mesh]:
    """The triangles of every node that has a mesh, one entry per primitive."""
    definitions = file.list_of("meshes")
    found: list[_Mesh] = []
    total = 0
    for n, node in enumerate(file.list_of("nodes")):
        if "mesh" not in node:
            continue
        skin = node.get("skin")
        joints = 0 if skin is None else len(skins[skin][0])
        mesh = definitions[file.index(node, "mesh", len(definitions))]
        for primitive in file.items(mesh, "primitives", dict):
            if primitive.get("mode", 4) not in (4, 5, 6):
                continue  # points and lines are no surface
            attributes = primitive.get("attributes")
            if not isinstance(attributes, dict) or "POSITION" not in attributes:
                raise file.error(f"a primitive of node {n} has no POSITION")
            vertices = file.accessor(attributes, "POSITION", "VEC3").astype(np.float64)
            total += len(vertices)
            if total > MAX_VERTICES:
                raise file.error(f"has over {MAX_VERTICES} vertices in all its nodes")
            triangles = _triangles(file, primitive, len(vertices))
            W = _weights(file, attributes, len(vertices), joints) if skin is not None else None
            found.append(_Mesh(n, skin, vertices, triangles, W))
    return found


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


def _weights(file: GltfFile, attributes: dict[str, Any], count: int, joints: int) -> sp.csr_matrix:
    """Raw weights over the skin's joints from all JOINTS_n and WEIGHTS_n."""
    vertex, joint, weight = [], [], []
    n = 0
    while f"JOINTS_{n}" in attributes:
        if f"WEIGHTS_{n}" not in attributes:
            raise file.error(f"has JOINTS_{n} without WEIGHTS_{n}")
        j = file.accessor(attributes, f"JOINTS_{n}", "VEC4").astype(np.int64)
        w = file.accessor(attributes, f"WEIGHTS_{n}", "VEC4").astype(np.float64)
        if len(j) != count or len(w) != count:
            raise file.error(f"has {len(j)} JOINTS_{n} and {len(w)} WEIGHTS_{n}", f"{count} each")
        vertex.append(np.repeat(np.arange(count), 4))
        joint.append(j.ravel())
        weight.append(w.ravel())
        n += 1
    if n == 0:
        raise file.error("has a skinned mesh without JOINTS_0", "allowed: JOINTS_n and WEIGHTS_n")
    return weight_matrix(
        np.concatenate(vertex), np.concatenate(joint), np.concatenate(weight), (count, joints)
    )


def _skin(file: GltfFile, index: int) -> tuple[list[int], FloatArray]:
    """Joint nodes of a skin and their inverse bind matrices, shape [joints, 4, 4]."""
    skin = file.list_of("skins")[index]
    joints = file.items(skin, "joints", int)
    count = len(file.list_of("nodes"))
    if not 0 < len(joints) <= MAX_JOINTS:
        raise file.error(f"skin {index} has {len(joints)} joints", f"allowed: 1 to {MAX_JOINTS}")
    if not all(0 <= j < count for j in joints):
        raise file.error(f"skin {index} names a node that is not there", f"0 to {count - 1}")
    if "inverseBindMatrices" not in skin:
        return joints, np.tile(np.eye(4), (len(joints), 1, 1))
    matrices = file.accessor(skin, "inverseBindMatrices", "MAT4").astype(np.float64)
    if len(matrices) < len(joints):
        raise file.error(f"skin {index} has {len(matrices)} matrices for {len(joints)} joints")
    matrices = matrices[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
    if not np.isfinite(matrices).all():
        raise file.error(f"skin {index} has bind matrices that are not finite")
    return joints, matrices


def _joint_nodes(parent: list[int], order: list[int], skinned: set[int]) -> list[int]:
    """Nodes that become joints: the skins' own, those between them, and their common ancestor."""
    chains = []
    for node in skinned:
        chain = [node]
        while parent[chain[-1]] != -1:
            chain.append(parent[chain[-1]])
        chains.append(chain[::-1])
    shared = sum(1 for _ in takewhile(lambda level: len(set(level)) == 1, zip(*chains)))
    above = max(shared - 1, 0)
    kept = {node for chain in chains for node in chain[above:]}
    return [node for node in order if node in kept]


def _nearest_joint(parent: list[int], slot: Mapping[int, int], node: int) -> int | None:
    """The closest ancestor of a node that is a joint."""
    while node != -1 and node not in slot:
        node = parent[node]
    return None if node == -1 else node


def _unique_names(file: GltfFile, joints: list[int]) -> list[str]:
    """A name for each joint; nameless and repeated ones get their node's number."""
    nodes = file.list_of("nodes")
    names: list[str] = []
    seen: set[str] = set()
    for node in joints:
        name = nodes[node].get("name")
        name = name if isinstance(name, str) and name else "joint"
        if name == "joint" or name in seen:
            name = f"{name}_{node}"
        seen.add(name)
        names.append(name)
    return names


def _vrm_bones(file: GltfFile, names: Mapping[int, str]) -> dict[str, str]:
    """Joint name of each humanoid bone that a VRM 0.x or 1.0 file declares itself."""
    vrm = file.extensions.get("VRMC_vrm") or file.extensions.get("VRM") or {}
    humanoid = vrm.get("humanoid") if isinstance(vrm, dict) else None
    bones = humanoid.get("humanBones") if isinstance(humanoid, dict) else None
    if isinstance(bones, dict):
        entries = [(bone, entry) for bone, entry in bones.items() if isinstance(entry, dict)]
    elif isinstance(bones, list):
        entries = [(entry.get("bone"), entry) for entry in bones if isinstance(entry, dict)]
    else:
        entries = []
    return {
        bone: names[entry["node"]]
        for bone, entry in entries
        if bone in HUMANOID_BONES and isinstance(entry.get("node"), int) and entry["node"] in names
    }
