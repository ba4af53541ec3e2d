"""Hulls grown to the skin that leaves all of them when a body moves.

Skin that several bones move leaves the hulls of these bones, and the shapes at joints, by some
millimetres: too little for a shape of its own, enough to show through cloth that lies on the
shapes. Over random poses within the joints' range each such point goes into the nearest hull that
has room for it, as it lies there in that hull's own frame.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, LongArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.collider_params import HullSettings
from garment_sim_ros.colliders.hulls.hull import Hull, convex_hull
from garment_sim_ros.colliders.hulls.one_hull import Content, Made, made_hull
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.random_poses import random_poses
from garment_sim_ros.colliders.report.fatness import Union
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.geometry.ties import to_nanometres
from garment_sim_ros.geometry.transforms import invert_transform, transform_from, transform_points
from garment_sim_ros.geometry.triangles import area_vectors

_ROUNDS = 2
"""Each has other poses, and looks for what the hulls of the one before still leave open."""
_POSES = 48
"""Poses of a round."""
_OPEN = 0.001
"""Skin may leave the shapes by this [m]."""
_FAR = 0.01
"""Skin farther from all hulls than this is left outside [m]: hulls would stand off like wings."""
_THICKER = 0.25
"""Skin farther from an arm's hull as it was made than this share of its radius goes into others:
sleeves are narrow."""
_GAINED = 0.3
"""Share of delta that a hull is taken to gain over what it contains."""
_RIGID = 0.999
"""Skin of which one moving part has this share of the weight stays in its hull."""


class _Growing(NamedTuple):
    """A hull that can grow, its place among all shapes, and the way to where it was made.

    Attributes:
        at: Its place.
        hull: As it is.
        first: As it was made.
        room: How far skin may be from that to be contained [m]; infinite without a limit.
        content: What it contains.
        T_bind_shape: From its own frame to that of the bind pose, shape [4, 4].
    """

    at: int
    hull: Hull
    first: Hull
    room: float
    content: Content
    T_bind_shape: FloatArray


def grown(body: Body, made: Sequence[Made], settings: HullSettings) -> list[Made]:
    """The same shapes; hulls hold skin, too, that left all shapes over the range of motion.

    Args:
        body: Rig and skin.
        made: All shapes.
        settings: How hulls are made.
    """
    result = list(made)
    for number in range(_ROUNDS):
        poses = random_poses(body, _POSES, seed=number)
        bends = _bending(body, poses)
        if len(bends) == 0:
            break
        for at, points in _open_points(body, result, made, poses, bends, settings.delta).items():
            content = result[at].content
            assert content is not None
            inner = convex_hull(np.vstack([content.inner.vertices, to_nanometres(points)]))
            result[at] = made_hull(content._replace(inner=inner), settings)
    return result


def _bending(body: Body, poses: FloatArray) -> LongArray:
    """Vertices of the skin's triangles that joints move which turn against each other."""
    part = np.arange(len(body.rig.parent))
    for j, above in enumerate(body.rig.parent):
        if above >= 0:
            local = invert_transform(poses[:, above]) @ poses[:, j]
            if np.abs(local - local[0]).max() < 1e-6:
                part[j] = part[above]
    weight = np.zeros((len(body.skin.vertices), len(part)))
    rows = np.repeat(np.arange(len(weight)), body.skin.bone.shape[1])
    np.add.at(weight, (rows, part[body.skin.bone].ravel()), body.skin.weight.ravel())
    used = np.unique(body.skin.triangles)
    return used[weight[used].max(axis=1) < _RIGID].astype(np.int64)


def _below(body: Body, *tops: str) -> set[str]:
    """Bones of the rig from some humanoid ones on, outwards."""
    rig = body.rig
    first = {body.humanoid.get(top) for top in tops}
    below: set[str] = set()
    for name, parent in zip(rig.joint_names, rig.parent):  # parents first
        if name in first or (parent >= 0 and rig.joint_names[parent] in below):
            below.add(name)
    return below


def _growing(body: Body, made: Sequence[Made], first: Sequence[Made]) -> list[_Growing]:
    hulls, stays, arms = (
        [],
        _below(body, "neck", "head"),
        _below(body, "leftUpperArm", "rightUpperArm"),
    )
    for at, (one, before) in enumerate(zip(made, first)):
        if one.collider.bone in stays:  # thicker, it would run through what lies around the neck
            continue
        if one.hull is not None and before.hull is not None and one.content is not None:
            T_bone_shape = transform_from(one.collider.position, one.collider.orientation)
            T_bind_shape = invert_transform(one.content.T_bone_bind) @ T_bone_shape
            is_arm = one.collider.bone in arms
            room = _THICKER * _radius(before.hull) if is_arm else np.inf
            hulls.append(_Growing(at, one.hull, before.hull, room, one.content, T_bind_shape))
    return hulls


def _radius(hull: Hull) -> float:
    """That of a long cylinder of the same volume and surface [m]."""
    surface = 0.5 * np.linalg.norm(area_vectors(hull.vertices, hull.faces), axis=1).sum()
    return 2.0 * hull.volume / float(surface)


def _open_points(
    body: Body,
    made: Sequence[Made],
    first: Sequence[Made],
    poses: FloatArray,
    bends: LongArray,
    delta: float,
) -> dict[int, FloatArray]:
    """What hulls are to contain, by shape, in the bind pose of the hull [m], shape [n, 3]."""
    hulls = _growing(body, made, first)
    if not hulls:
        return {}
    colliders = ColliderSet(colliders=tuple(one.collider for one in made), thickness=0.0)
    poser, skinner = ColliderPoser(colliders, body), Skinner(body.skin)
    union = Union(colliders, poser.poses(poses[0]))
    found: dict[int, list[FloatArray]] = {}
    for T_world_joint in poses:
        placed = poser.poses(T_world_joint)
        union.move(placed)
        skin = skinner.vertices(T_world_joint)[bends]
        skin = skin[union.distance(skin) > _OPEN]
        if len(skin) == 0:
            continue
        T_world_shape = transform_from(placed.position, placed.orientation)
        seen = [
            transform_points(h.T_bind_shape @ invert_transform(T_world_shape[h.at]), skin)
            for h in hulls
        ]
        height = np.array([h.hull.height(x) for x, h in zip(seen, hulls)])
        over = np.array([h.first.height(x) - h.room for x, h in zip(seen, hulls)])
        height[over > 0.0] = np.inf
        nearest = np.where(height.min(axis=0) < _FAR, height.argmin(axis=0), -1)
        for k in np.unique(nearest[nearest >= 0]):
            mine = nearest == k
            inwards = _inwards(hulls[k].hull, seen[k][mine], _GAINED * delta + _OPEN)
            found.setdefault(hulls[k].at, []).append(inwards)
    return {at: np.concatenate(points) for at, points in found.items()}


def _inwards(hull: Hull, points: FloatArray, depth: float) -> FloatArray:
    """Points moved by a depth [m] against the plane of a hull that they are farthest out of."""
    height = points @ hull.planes[:, :3].T - hull.planes[:, 3]
    normal = hull.planes[height.argmax(axis=1), :3]
    moved: FloatArray = points - depth * normal
    return moved
