"""The skeleton of a glTF file: which nodes are joints, their names, and the pose they rest in."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.loaders.gltf_bind import rest_frames
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.body.loaders.gltf_scene import Piece, Scene
from garment_sim_ros.body.skin import HUMANOID_BONES

MAX_JOINTS = 4096

_DECLARED = ("VRMC_vrm", "VRM", "VRMC_vrm_animation")
"""Extensions that tell which node is which humanoid bone: VRM 1.0, 0.x, and VRMA."""


@dataclass(frozen=True, kw_only=True)
class Skeleton:
    """The joints of a file.

    Attributes:
        nodes: The node of each joint, parents first, length n.
        names: The name of each joint, no two alike.
        slot: The joint of each node that is one.
        T_world_node: Affine transforms of all nodes, as the file holds them, shape [nodes, 4, 4].
        T_world_rest: Affine transforms of the joints in the pose that the body rests in, shape
            [n, 4, 4].
        skins: Joint nodes and inverse bind matrices [joints, 4, 4] of the skins, by number.
        bones: The joint's name of each humanoid bone that the file declares itself.
        notes: What was assumed.
    """

    nodes: list[int]
    names: list[str]
    slot: Mapping[int, int]
    T_world_node: FloatArray
    T_world_rest: FloatArray
    skins: Mapping[int, tuple[list[int], FloatArray]]
    bones: Mapping[str, str]
    notes: list[str]

    def parents(self, scene: Scene) -> list[int]:
        """The parent of each joint, -1 for roots."""
        return [self.slot.get(scene.parent[n], -1) for n in self.nodes]


def read_skeleton(
    file: GltfFile,
    scene: Scene,
    pieces: Sequence[Piece],
    T_world_root: FloatArray,
    others: Iterable[int] = (),
) -> Skeleton:
    """The skeleton that the meshes of a file wear.

    Args:
        file: The file.
        scene: Its nodes.
        pieces: Its meshes.
        T_world_root: Transform of the scene in the world, shape [4, 4].
        others: Nodes that are joints where no mesh has a skin.

    Raises:
        InputFileError: A skin is malformed.
        GeometryError: A bind matrix cannot be inverted.
    """
    nodes = file.list_of("nodes")
    T_world_node = scene.transforms(T_world_root)
    skins = _skins(file)
    worn: dict[int, list[FloatArray]] = {i: [] for i in skins}
    for piece in pieces:
        if (skin := nodes[piece.node].get("skin")) is not None:
            worn[skin].append(piece.vertices)
    skinned = {int(n) for joints, _ in skins.values() for n in joints} or set(others)
    joints = _joint_nodes(scene.parent, scene.order, skinned)
    M, notes = rest_frames(
        scene.parent, T_world_node, joints, [(*skins[i], worn[i]) for i in skins]
    )
    names = _unique_names(file, joints)
    return Skeleton(
        nodes=joints,
        names=names,
        slot={node: j for j, node in enumerate(joints)},
        T_world_node=T_world_node,
        T_world_rest=M,
        skins=skins,
        bones=_declared_bones(file, dict(zip(joints, names))),
        notes=notes,
    )


def _skins(file: GltfFile) -> dict[int, tuple[list[int], FloatArray]]:
    """Joint nodes and inverse bind matrices of every skin that a mesh wears."""
    count = len(file.list_of("skins"))
    worn = [node for node in file.list_of("nodes") if "mesh" in node and "skin" in node]
    return {i: _skin(file, i) for i in sorted({file.index(node, "skin", count) for node in worn})}


def _skin(file: GltfFile, index: int) -> tuple[list[int], FloatArray]:
    """Joint nodes of a skin and their inverse bind matrices, shape [joints, 4, 4]."""
    skin = file.list_of("skins")[index]
    joints = file.items(skin, "joints", int)
    count = len(file.list_of("nodes"))
    if not 0 < len(joints) <= MAX_JOINTS:
        raise file.error(f"skin {index} has {len(joints)} joints", f"allowed: 1 to {MAX_JOINTS}")
    if not all(0 <= j < count for j in joints):
        wrong = next(j for j in joints if not 0 <= j < count)
        raise file.error(f"skin {index} names the node {wrong}", f"allowed: 0 to {count - 1}")
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


def _declared_bones(file: GltfFile, names: Mapping[int, str]) -> dict[str, str]:
    """Joint name of each humanoid bone that a file declares itself."""
    said: Any = next((file.extensions[e] for e in _DECLARED if file.extensions.get(e)), {})
    humanoid = said.get("humanoid") if isinstance(said, dict) else None
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
