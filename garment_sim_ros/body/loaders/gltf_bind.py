"""Rest pose, bind pose and scale of a glTF skeleton: from affine nodes to rigid joint frames."""

import numpy as np
import scipy.sparse as sp

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GeometryError

_BIND_TOLERANCE = 1e-3
"""Rest and bind pose are the same if no vertex differs by more, as a share of the body's size."""


def rest_frames(
    parent: list[int],
    T_world: FloatArray,
    joints: list[int],
    skins: list[tuple[list[int], FloatArray, list[FloatArray]]],
) -> tuple[FloatArray, list[str]]:
    """Affine joint frames of the pose that the body rests in, shape [n, 4, 4], and notes.

    Where nodes and bind matrices disagree, the nodes usually hold some frame of an animation and
    the bind pose is the modelled A- or T-pose: it is taken, unless bones are scaled.

    Args:
        parent: Parent of each node, -1 for roots.
        T_world: Affine world transform of each node, shape [nodes, 4, 4].
        joints: The nodes that are joints, parents first, length n.
        skins: Joint nodes, inverse bind matrices [joints, 4, 4] and the vertices of all meshes
            of each skin.

    Raises:
        GeometryError: A bind matrix cannot be inverted.
    """
    slot = {node: j for j, node in enumerate(joints)}
    M = T_world[joints].copy()
    settled: set[int] = set()
    for nodes, T_joint_bind, worn in skins:
        if not worn:
            continue
        points = np.concatenate(worn)
        corners = np.array(np.meshgrid(*zip(points.min(axis=0), points.max(axis=0)))).reshape(3, 8)
        columns = np.array([slot[n] for n in nodes])
        B = T_world[nodes] @ T_joint_bind
        reference = int(np.argmin(columns))
        images = B[:, :3, :3] @ corners + B[:, :3, 3:]
        size = float(np.linalg.norm(np.ptp(images[reference], axis=1)))
        if np.abs(images - images[reference]).max() <= _BIND_TOLERANCE * size:
            continue
        if (np.abs(np.linalg.det(T_joint_bind)) < 1e-30).any():
            raise GeometryError("a skin has a bind matrix that cannot be inverted")
        T_bind_joint = np.linalg.inv(T_joint_bind)
        bind_to_world = _straightened(B[reference], T_bind_joint[reference])
        bind = bind_to_world @ T_bind_joint
        if _bones_differ(parent, T_world, nodes, bind, size):
            return T_world[joints], ["bind pose has other bone lengths; rest pose of nodes taken"]
        for node, frame in zip(nodes, bind):
            if node not in settled:
                M[slot[node]] = frame
                settled.add(node)
    if not settled:
        return M, []
    for j, node in enumerate(joints):
        if node not in settled and parent[node] in slot:
            above = parent[node]
            M[j] = M[slot[above]] @ np.linalg.pinv(T_world[above]) @ T_world[node]
    return M, ["nodes are not in bind pose; bind pose taken as the rest pose"]


def _straightened(B: FloatArray, T_bind_joint: FloatArray) -> FloatArray:
    """`B` with its rotation snapped to quarter turns, keeping the joint's origin in place."""
    rotation = rigid(B[None])[0, :3, :3]
    snapped = np.zeros((3, 3))
    free = np.abs(rotation)
    for _ in range(3):
        i, k = np.unravel_index(np.argmax(free), (3, 3))
        snapped[i, k] = np.sign(rotation[i, k])
        free[i], free[:, k] = -1.0, -1.0
    if np.linalg.det(snapped) < 0.0:
        return B
    straight = B.copy()
    straight[:3, :3] = snapped @ rotation.T @ B[:3, :3]
    straight[:3, 3] += (B - straight)[:3, :3] @ T_bind_joint[:3, 3]
    return straight


def _bones_differ(
    parent: list[int], T_world: FloatArray, nodes: list[int], bind: FloatArray, size: float
) -> bool:
    """Whether any bone between two joints of a skin has another length in bind pose."""
    row = {node: k for k, node in enumerate(nodes)}
    for node, k in row.items():
        if parent[node] in row:
            rest = np.linalg.norm(T_world[node, :3, 3] - T_world[parent[node], :3, 3])
            bound = np.linalg.norm(bind[k, :3, 3] - bind[row[parent[node]], :3, 3])
            if abs(rest - bound) > 0.01 * size:
                return True
    return False


def blend(vertices: FloatArray, W: sp.csr_matrix, A: FloatArray) -> FloatArray:
    """Linear blend of vertices [v, 3] with affine matrices [n, 4, 4] and raw weights [v, n]."""
    sums = np.asarray(W.sum(axis=1)).ravel()
    blended = (W @ A[:, :3].reshape(-1, 12)).reshape(-1, 3, 4)
    blended[sums <= 0.0] = A[0, :3]
    blended /= np.where(sums > 0.0, sums, 1.0)[:, None, None]
    return np.einsum("vij,vj->vi", blended[:, :, :3], vertices) + blended[:, :, 3]


def rigid(M: FloatArray) -> FloatArray:
    """The nearest rigid transforms of affine ones, shape [n, 4, 4]."""
    U, _, Vt = np.linalg.svd(M[:, :3, :3])
    U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    T = M.copy()
    T[:, :3, :3] = U @ Vt
    T[:, 3] = (0.0, 0.0, 0.0, 1.0)
    return T
