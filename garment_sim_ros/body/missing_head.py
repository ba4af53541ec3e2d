"""A head for robots whose names tell none: what is above the neck, told by the skin.

Robots often have their head fixed to the chest, in one link and one mesh. Colliders are fitted to
what a joint carries, and a shirt leaves out the head; so a joint is added that stays in its place
in the chest and carries what is above the neck. No vertex moves otherwise than without it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.geometry.transforms import invert_transform

_TRUNK = ("upperChest", "chest", "spine", "hips")
_LEVELS = 48
_HEAD = 1.1
"""A head is so much wider than the neck under it, from side to side."""
_NARROW = 0.6
"""Without a head the neck begins where the trunk has so much of its width at the shoulders."""


def with_head(body: Body) -> Body:
    """A body with a head where its rig has neither neck nor head, and has arms.

    Args:
        body: A body whose skin is rigid, z up.

    Returns:
        The body as it is where it has a neck or a head, or no arms. Else the joint on which most
        of what is above the neck turns is the head, or a new one in the chest.
    """
    rig, humanoid = body.rig, body.humanoid
    trunk = next((humanoid[bone] for bone in _TRUNK if bone in humanoid), None)
    if trunk is None or {"neck", "head"} & humanoid.keys():
        return body
    if not {"leftUpperArm", "rightUpperArm"} <= humanoid.keys():
        return body
    T = rest_transforms(rig)
    x = skin_vertices(body.skin, T)
    arms = [rig.index(humanoid[f"{side}UpperArm"]) for side in ("left", "right")]
    is_trunk = ~rig.below(*arms)[body.skin.bone[:, 0]]
    place = _neck(x, body.skin.triangles, is_trunk, T[arms, :3, 3].mean(axis=0))
    is_head = is_trunk & (x[:, 2] > place[2])
    chest = rig.index(trunk)
    fixed = _fixed_to(rig, chest)
    top = int(np.bincount(body.skin.bone[is_head, 0], minlength=len(rig)).argmax())
    if is_head.any() and not fixed[top] and rig.below(chest)[top]:
        while not fixed[rig.parent[top]]:
            top = int(rig.parent[top])
        name = rig.joint_names[top]
        note = f"no bone called neck or head: {name!r} taken as the head"
        return replace(body, humanoid={**humanoid, "head": name}, notes=(*body.notes, note))
    name = "head"
    while name in rig.joint_names:
        name += "_"
    T_world_head = np.eye(4)
    T_world_head[:3, 3] = place
    T_chest_head = invert_transform(T[chest]) @ T_world_head
    note = f"no bone called neck or head: the head taken to begin at {place[2]:.2f} m"
    return replace(
        body,
        rig=replace(
            rig,
            joint_names=(*rig.joint_names, name),
            parent=np.append(rig.parent, chest),
            T_parent_joint=np.concatenate([rig.T_parent_joint, T_chest_head[None]]),
        ),
        skin=_carried(body.skin, is_head & fixed[body.skin.bone[:, 0]], chest, T_chest_head),
        humanoid={**humanoid, "head": name},
        notes=(*body.notes, note),
    )


def _neck(
    x: FloatArray, triangles: IntArray, is_trunk: NDArray[np.bool_], shoulders: FloatArray
) -> FloatArray:
    """Middle of the neck's lowest or thinnest section; the shoulders' without one, shape [3]."""
    edges = edge_table(triangles)[0]
    edges = edges[is_trunk[edges].all(axis=1)]
    top = float(x[edges, 2].max(initial=shoulders[2]))
    sections = []
    for z in np.linspace(shoulders[2], top, _LEVELS, endpoint=False):
        over = x[edges, 2] > z
        a, b = edges[over[:, 0] != over[:, 1]].T
        if len(a):
            s = (z - x[a, 2]) / (x[b, 2] - x[a, 2])
            across = x[a] + s[:, None] * (x[b] - x[a])
            sections.append((across.min(axis=0), across.max(axis=0)))
    if not sections:
        return shoulders
    low, high = np.swapaxes(sections, 0, 1)
    width = high[:, 1] - low[:, 1]
    widest_above = np.maximum.accumulate(width[::-1])[::-1]
    k = int(np.argmax(widest_above / width.clip(1e-9)))
    if widest_above[k] < _HEAD * width[k]:
        narrow = np.flatnonzero(width < _NARROW * width[0])
        k = int(narrow[0]) if narrow.size else len(width) - 1
    place: FloatArray = 0.5 * (low[k] + high[k])
    return place


def _fixed_to(rig: Rig, joint: int) -> NDArray[np.bool_]:
    """Which joints move with one of them: it, and what hangs on it without a hinge, shape [n]."""
    fixed = np.zeros(len(rig), bool)
    fixed[joint] = True
    turning = set(rig.dofs.joint.tolist())
    for j, above in enumerate(rig.parent):
        fixed[j] |= above >= 0 and j not in turning and fixed[above]
    return fixed


def _carried(skin: Skin, is_head: NDArray[np.bool_], chest: int, T_chest_head: FloatArray) -> Skin:
    """The skin with one joint more, which carries the head."""
    T_head_bind = invert_transform(T_chest_head) @ skin.T_bone_bind[chest]
    return replace(
        skin,
        bone=np.where(is_head[:, None], len(skin.T_bone_bind), skin.bone),
        T_bone_bind=np.concatenate([skin.T_bone_bind, T_head_bind[None]]),
    )
