"""Hulls grown to the skin that leaves all of them when a body moves.

Skin that several bones move leaves their hulls, and the shapes at joints, by some millimetres. Over
random poses within the joints' range each such point is given to the hull that it is nearest to,
as it lies there in the hull's own frame.
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
from garment_sim_ros.geometry.transforms import invert_transform, transform_from, transform_points

import os
_POSES = int(os.environ.get("POSES", 48))
"""Poses of a round."""
_ROUNDS = int(os.environ.get("ROUNDS", 2))
import os
_OPEN = float(os.environ.get("OPEN", 0.001))
"""Skin may leave the shapes by this [m]."""
_FAR = 0.03
"""Farther from all hulls than this skin is left outside [m]."""


import os
_DEFL = 1.0
_BYCOST = float(os.environ.get("BYCOST", 0.0))
_WORTH = float(os.environ.get("WORTH", 0.03))
_FAR = float(os.environ.get("FAR", _FAR))


class _Grown(NamedTuple):
    """A hull that can grow, and its place among all shapes."""

    at: int
    hull: Hull
    content: Content


def grown(body: Body, made: Sequence[Made], settings: HullSettings) -> list[Made]:
    """The same shapes; hulls hold skin, too, that left all shapes over the range of motion.

    Args:
        body: Rig and skin.
        made: All shapes.
        settings: How hulls are made.
    """
    result = list(made)
    bends = _bending(body)
    if len(bends) == 0:
        return result
    for number in range(_ROUNDS):
        poses = random_poses(body, _POSES, seed=number)
        for at, points in _left(body, result, poses, bends, settings).items():
            content = result[at].content
            assert content is not None
            inner = convex_hull(np.vstack([content.inner.vertices, points]))
            result[at] = made_hull(content._replace(inner=inner), settings)
    return result


def _bending(body: Body) -> LongArray:
    """Vertices that more than one joint moves."""
    return np.flatnonzero(body.skin.weight.max(axis=1) < 0.999)


def _left(
    body: Body,
    made: Sequence[Made],
    poses: FloatArray,
    bends: LongArray,
    settings: HullSettings,
) -> dict[int, FloatArray]:
    """Points that hulls are to contain, by shape, in the bind pose of the hull [m]."""
    colliders = ColliderSet(colliders=tuple(one.collider for one in made), thickness=0.0)
    hulls = [
        _Grown(k, one.hull, one.content)
        for k, one in enumerate(made)
        if one.hull is not None and one.content is not None
    ]
    if not hulls:
        return {}
    # From each shape's frame to the bind pose that its hull is given in.
    T_bind_shape = [
        invert_transform(h.content.T_bone_bind)
        @ transform_from(made[h.at].collider.position, made[h.at].collider.orientation)
        for h in hulls
    ]
    poser, skinner = ColliderPoser(colliders, body), Skinner(body.skin)
    union = Union(colliders, poser.poses(poses[0]))
    skins, normals, frames, opens = [], [], [], []
    for T_world_joint in poses:
        placed = poser.poses(T_world_joint)
        union.move(placed)
        skins.append(skinner.vertices(T_world_joint)[bends].copy())
        normals.append(skinner.normals()[bends].copy())
        opens.append(union.distance(skins[-1]) > _OPEN)
        T_world_shape = transform_from(placed.position, placed.orientation)
        frames.append([T_world_shape[h.at] @ invert_transform(T) for T, h in zip(T_bind_shape, hulls)])
    x, n, T_world_bind, is_open = np.array(skins), np.array(normals), np.array(frames), np.array(opens)
    found: dict[int, list[FloatArray]] = {}
    for t in range(len(poses)):
        v = np.flatnonzero(is_open[t])
        if len(v) == 0:
            continue
        cost = np.full((len(hulls), len(v)), np.inf)
        seen = []
        for k, h in enumerate(hulls):
            T = T_world_bind[:, k]
            q = transform_points(invert_transform(T[t]), x[t, v])
            seen.append(q)
            height = h.hull.height(q)
            near = height < _FAR
            if not near.any():
                continue
            world = np.einsum("pij,vj->pvi", T[:, :3, :3], q[near]) + T[:, None, :3, 3]
            off = np.einsum("pvi,pvi->pv", world - x[:, v[near]], n[:, v[near]])
            cost[k, near] = np.maximum(off, 0.0).mean(axis=0) * _BYCOST + (1-_BYCOST) * height[near]
        best = cost.argmin(axis=0)
        for k in np.unique(best):
            mine = (best == k) & (cost[k] < _WORTH)
            if mine.any():
                inwards = _inwards(hulls[k].hull, seen[k][mine], settings.delta * _DEFL + _OPEN)
                found.setdefault(hulls[k].at, []).append(inwards)
    return {at: np.concatenate(points) for at, points in found.items()}


def _inwards(hull: Hull, points: FloatArray, depth: float) -> FloatArray:
    """Points moved by a depth [m] against the plane of a hull that they are farthest out of."""
    height = points @ hull.planes[:, :3].T - hull.planes[:, 3]
    normal = hull.planes[height.argmax(axis=1), :3]
    moved: FloatArray = points - depth * normal
    return moved
