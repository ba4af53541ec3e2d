"""A head for robots whose names tell none: what is above the neck, told by the skin.

Robots often have their head fixed to the chest, in one link and one mesh. Colliders are fitted to
what a joint carries, and a shirt leaves out the head; so a joint is added in the chest that
carries what is above the neck. The robot's own joint states do not turn it; a clip does.
"""

from collections.abc import Sequence
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
from garment_sim_ros.geometry.triangles import vertex_areas

_FIXED, _ELSEWHERE = -1, -2
_LEVELS = 48
_HEAD = 1.1
"""A head is so much wider than the neck under it, from side to side."""
_LEAST_HEAD = 0.3
"""It is at least so wide as a share of the trunk at the shoulders: an antenna is none."""
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
    if {"neck", "head"} & humanoid.keys():
        return body
    if not {"leftUpperArm", "rightUpperArm"} <= humanoid.keys():
        return body
    T = rest_transforms(rig)
    x = skin_vertices(body.skin, T)
    shoulders = [rig.index(humanoid[f"{side}UpperArm"]) for side in ("left", "right")]
    chest, arms = _chest_and_arms(rig, shoulders)
    owner = body.skin.bone[:, 0]
    turning = _turning_on(rig, chest)
    is_trunk = ~rig.below(*arms)[owner] & (turning[owner] > _ELSEWHERE)
    place = _neck(x, body.skin.triangles, is_trunk, T[shoulders, :3, 3].mean(axis=0))
    is_head = is_trunk & (x[:, 2] > place[2])
    area = is_head * vertex_areas(x, body.skin.triangles)
    at = turning[owner] - _ELSEWHERE
    top = int(np.bincount(at, area, minlength=1).argmax()) + _ELSEWHERE
    if is_head.any() and top >= 0 and not rig.below(top)[arms].any():
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
        skin=_carried(body.skin, is_head & (turning[owner] == _FIXED), chest, T_chest_head),
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
    sections: list[tuple[FloatArray, FloatArray]] = []
    for z in np.linspace(shoulders[2], top, _LEVELS, endpoint=False):
        over = x[edges, 2] > z
        a, b = edges[over[:, 0] != over[:, 1]].T
        if len(a):
            s = (z - x[a, 2]) / (x[b, 2] - x[a, 2])
            across = x[a] + s[:, None] * (x[b] - x[a])
            sections.append((across.min(axis=0), across.max(axis=0)))
        elif sections:  # a gap, as between a chest and a head on a hidden neck
            middle = np.append(np.mean(sections[-1], axis=0)[:2], z)
            sections.append((middle, middle))
    if not sections:
        return shoulders
    low, high = np.swapaxes(sections, 0, 1)
    width = high[:, 1] - low[:, 1]
    widest_above = np.maximum.accumulate(width[::-1])[::-1]
    is_wide = widest_above > _LEAST_HEAD * width[0]
    k = int(np.argmax(is_wide * widest_above / width.clip(1e-9)))
    if not is_wide[k] or widest_above[k] < _HEAD * width[k]:
        narrow = np.flatnonzero(width < _NARROW * width[0])
        k = int(narrow[0]) if narrow.size else len(width) - 1
    place: FloatArray = 0.5 * (low[k] + high[k])
    return place


def _chest_and_arms(rig: Rig, shoulders: Sequence[int]) -> tuple[int, list[int]]:
    """What both arms hang on, the lowest joint, and the joints on it that they begin at."""
    paths = []
    for joint in shoulders:
        path = [joint]
        while (joint := int(rig.parent[joint])) >= 0:
            path.append(joint)
        paths.append(path)
    chest = next((j for j in paths[0][1:] if j in paths[1][1:]), 0)
    return chest, [path[path.index(chest) - 1] if chest in path else path[0] for path in paths]


def _turning_on(rig: Rig, chest: int) -> IntArray:
    """The first joint that turns on the way from the chest to each one, shape [n].

    `_FIXED` for joints that move with the chest, `_ELSEWHERE` for those that it does not carry.
    """
    hinges = set(rig.dofs.joint.tolist())
    while chest not in hinges and rig.parent[chest] >= 0:
        chest = int(rig.parent[chest])
    below = rig.below(chest)
    turning = np.where(below, _FIXED, _ELSEWHERE)
    for j, above in enumerate(rig.parent):
        if j == chest or not below[j]:
            continue
        turning[j] = turning[above] if turning[above] >= 0 or j not in hinges else j
    return turning


def _carried(skin: Skin, is_head: NDArray[np.bool_], chest: int, T_chest_head: FloatArray) -> Skin:
    """The skin with one joint more, which carries the head."""
    T_head_bind = invert_transform(T_chest_head) @ skin.T_bone_bind[chest]
    return replace(
        skin,
        bone=np.where(is_head[:, None], len(skin.T_bone_bind), skin.bone),
        T_bone_bind=np.concatenate([skin.T_bone_bind, T_head_bind[None]]),
    )
