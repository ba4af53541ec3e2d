"""Skinned bodies from glTF 2.0 files: .gltf, .glb and .vrm.

All skinned meshes of the file become one skin. Transforms above the skeleton, and scale anywhere,
are baked into joint frames and vertices, because a rig's transforms are rigid. Joints keep the
orientation that they have in the file.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.loaders.assembly import assemble
from garment_sim_ros.body.loaders.gltf_bind import blend, rest_frames, rigid
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.body.loaders.gltf_scene import Scene
from garment_sim_ros.body.loaders.weights import weight_matrix
from garment_sim_ros.body.skin import HUMANOID_BONES, Body
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP

MAX_JOINTS = 4096
MAX_WEIGHT_SETS = 8
"""Most JOINTS_n of one primitive; each holds 4 influences of every vertex."""


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
    scene = Scene(file)
    parent = scene.parent
    axes = np.eye(4)
    axes[:3, :3] = AXES_FROM_Y_UP
    T_world = scene.transforms(axes)
    skins = _skins(file)
    meshes = _meshes(file, scene, skins)
    if not any(mesh.skin is not None for mesh in meshes):
        raise file.error("has no skinned mesh", "allowed: a mesh with a skin and joints")
    joints = _joint_nodes(
        parent, scene.order, {int(n) for nodes, _ in skins.values() for n in nodes}
    )
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


def _skins(file: GltfFile) -> dict[int, tuple[list[int], FloatArray]]:
    """Joint nodes and inverse bind matrices of every skin that a mesh wears."""
    count = len(file.list_of("skins"))
    worn = [node for node in file.list_of("nodes") if "mesh" in node and "skin" in node]
    return {i: _skin(file, i) for i in sorted({file.index(node, "skin", count) for node in worn})}


def _meshes(
    file: GltfFile, scene: Scene, skins: Mapping[int, tuple[list[int], FloatArray]]
) -> list[_Mesh]:
    """The triangles of every node that has a mesh, one entry per primitive."""
    nodes = file.list_of("nodes")
    found: list[_Mesh] = []
    for piece in scene.pieces():
        skin, W = nodes[piece.node].get("skin"), None
        if skin is not None:
            joints = len(skins[skin][0])
            W = _weights(file, piece.attributes, len(piece.vertices), joints)
        found.append(_Mesh(piece.node, skin, piece.vertices, piece.triangles, W))
    return found


def _weights(file: GltfFile, attributes: dict[str, Any], count: int, joints: int) -> sp.csr_matrix:
    """Raw weights over the skin's joints from all JOINTS_n and WEIGHTS_n."""
    vertex, joint, weight = [], [], []
    n = 0
    while f"JOINTS_{n}" in attributes:
        if n == MAX_WEIGHT_SETS:
            raise file.error(f"has over {n} JOINTS_n", f"allowed: JOINTS_0 to JOINTS_{n - 1}")
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
    below = [0] * len(parent)  # joints of skins at and below each node
    for node in reversed(order):
        below[node] += node in skinned
        if parent[node] != -1:
            below[parent[node]] += below[node]
    shared = [node for node in order if below[node] == len(skinned)]  # one line, from the root
    above = set(shared[:-1])
    return [node for node in order if below[node] and node not in above]


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
