"""How far posed skin leaves its colliders over a motion, or over the range of a body's joints."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.random_poses import random_poses
from garment_sim_ros.colliders.regions import bone_weights
from garment_sim_ros.colliders.report.fatness import Union
from garment_sim_ros.contact.ellipsoid_refit import REFIT_KEYS
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.geometry.triangles import vertex_areas

AT_ALL = 1e-5
"""Skin that leaves the shapes by no more than this is inside [m]: single precision."""
SHOWS = 0.002
"""Skin that leaves the shapes by more shows through cloth that lies on them [m]: what cloth keeps
off them by default."""
_RANGE_POSES = 32
_RANGE_SEED = 1000
"""Other poses than fits are made over."""


def motion_report(
    body: Body, colliders: ColliderSet, poses: Sequence[FloatArray]
) -> dict[str, Any]:
    """Posed skin outside the union of its colliders.

    Args:
        body: Rig and skin.
        colliders: The set.
        poses: World transforms of the rig's joints in each pose, shape [n, 4, 4].

    Returns:
        ``poses``; ``outside_share`` of the area, ``outside_mm_mean``, ``outside_mm_p99`` and
        ``outside_mm_max`` over all of them; ``bare_share`` of the area that is outside by more
        than 2 mm, the mean over the poses, ``bare_share_max`` in the worst of them, and
        ``bare_bones``: how much of it each major bone has, most first; where shapes are fitted
        again in every pose, also ``static``: the same if they kept their shape.
    """
    report: dict[str, Any] = {"poses": len(poses), **_outside(body, colliders, poses)}
    static = tuple(_static(c) for c in colliders.colliders)
    if any(a is not b for a, b in zip(static, colliders.colliders)):
        report["static"] = _outside(body, replace(colliders, colliders=static), poses)
    return report


def range_report(body: Body, colliders: ColliderSet) -> dict[str, Any]:
    """What `motion_report` says about random poses within the joints' range."""
    if colliders.has_skin:  # the skin itself
        return {"poses": 0, "bare_share": 0.0, "bare_share_max": 0.0, "bare_bones": {}}
    poses = random_poses(body, _RANGE_POSES, seed=_RANGE_SEED)
    return motion_report(body, colliders, list(poses))


def _static(collider: Collider) -> Collider:
    if "points" not in collider.geometry:
        return collider
    kept = {key: g for key, g in collider.geometry.items() if key not in REFIT_KEYS}
    return replace(collider, geometry=kept)


def _outside(body: Body, colliders: ColliderSet, poses: Sequence[FloatArray]) -> dict[str, Any]:
    poser = ColliderPoser(colliders, body)
    skinner = Skinner.of(body)
    union = Union(colliders, poser.poses(poses[0]))
    distance = []
    for T_world_joint in poses:
        union.move(poser.poses(T_world_joint))
        distance.append(union.distance(skinner.vertices(T_world_joint)))
    one = vertex_areas(body.skin.vertices, body.skin.triangles)
    bare = (np.array(distance) > SHOWS) * (one / one.sum())
    outside = np.maximum(np.array(distance), 0.0).astype(np.float64).ravel()
    area = np.tile(one, len(poses))
    order = np.argsort(outside)
    rank = np.searchsorted(np.cumsum(area[order]), 0.99 * area.sum())
    return {
        "outside_share": round(float(area[outside > AT_ALL].sum() / area.sum()), 5),
        "outside_mm_mean": round(1e3 * float(outside @ area / area.sum()), 4),
        "outside_mm_p99": round(1e3 * float(outside[order[min(rank, len(order) - 1)]]), 3),
        "outside_mm_max": round(1e3 * float(outside.max()), 2),
        "bare_share": round(float(bare.sum(axis=1).mean()), 5),
        "bare_share_max": round(float(bare.sum(axis=1).max()), 5),
        "bare_bones": _by_bone(body, bare.mean(axis=0)),
    }


def _by_bone(body: Body, share: FloatArray) -> dict[str, float]:
    """Shares of vertices [v] summed over those of each major bone, largest first."""
    bones = major_bones(body)
    owner = bone_weights(body.skin, bones).argmax(axis=1)
    total = np.bincount(owner, share, minlength=len(bones))
    order = [m for m in np.argsort(-total, kind="stable") if total[m] > 0.0]
    return {bones.names[m]: round(float(total[m]), 5) for m in order}
