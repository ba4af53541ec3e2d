"""Skinned bodies from glTF 2.0 files: .gltf, .glb and .vrm.

All skinned meshes of the file become one skin. Transforms above the skeleton, and scale anywhere,
are baked into joint frames and vertices, because a rig's transforms are rigid. Joints keep the
orientation that they have in the file.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.loaders.assembly import assemble
from garment_sim_ros.body.loaders.gltf_bind import blend, rigid
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.body.loaders.gltf_scene import Piece, Scene
from garment_sim_ros.body.loaders.gltf_skeleton import Skeleton, read_skeleton
from garment_sim_ros.body.loaders.weights import weight_matrix
from garment_sim_ros.body.skin import Body
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP

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
    axes = np.eye(4)
    axes[:3, :3] = AXES_FROM_Y_UP
    pieces = list(scene.pieces())
    skeleton = read_skeleton(file, scene, pieces, axes)
    meshes = _meshes(file, pieces, skeleton)
    if not any(mesh.skin is not None for mesh in meshes):
        raise file.error("has no skinned mesh", "allowed: a mesh with a skin and joints")
    T_world, M, slot = skeleton.T_world_node, skeleton.T_world_rest, skeleton.slot
    joints, notes = skeleton.nodes, list(skeleton.notes)

    vertices, triangles, rows = [], [], []
    offset = 0
    for mesh in meshes:
        if mesh.skin is not None and mesh.W is not None:
            nodes, T_joint_bind = skeleton.skins[mesh.skin]
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
            owner = _nearest_joint(scene.parent, slot, mesh.node)
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

    return assemble(
        name,
        skeleton.names,
        np.array(skeleton.parents(scene), dtype=np.int32),
        rigid(M),
        np.concatenate(vertices),
        np.concatenate(triangles).astype(np.int32),
        sp.vstack(rows, format="csr"),
        notes=notes,
        humanoid_overrides={**skeleton.bones, **(overrides or {})},
    )


def _meshes(file: GltfFile, pieces: Iterable[Piece], skeleton: Skeleton) -> list[_Mesh]:
    """The triangles of every node that has a mesh, one entry per primitive."""
    nodes = file.list_of("nodes")
    found: list[_Mesh] = []
    for piece in pieces:
        skin, W = nodes[piece.node].get("skin"), None
        if skin is not None:
            joints = len(skeleton.skins[skin][0])
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
            raise file.error(
                f"has {len(j)} JOINTS_{n} and {len(w)} WEIGHTS_{n}", f"allowed: {count} each"
            )
        vertex.append(np.repeat(np.arange(count), 4))
        joint.append(j.ravel())
        weight.append(w.ravel())
        n += 1
    if n == 0:
        raise file.error("has a skinned mesh without JOINTS_0", "allowed: JOINTS_n and WEIGHTS_n")
    return weight_matrix(
        np.concatenate(vertex), np.concatenate(joint), np.concatenate(weight), (count, joints)
    )


def _nearest_joint(parent: list[int], slot: Mapping[int, int], node: int) -> int | None:
    """The closest ancestor of a node that is a joint."""
    while node != -1 and node not in slot:
        node = parent[node]
    return None if node == -1 else node
