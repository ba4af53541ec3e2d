"""Ellipsoids on a moving body (the future work that Gong et al. name).

Every ellipsoid is fixed to the bone that moves most of its skin. One at a joint, whose skin
several bones move, does not fit once the joint bends: it gets what `contact.ellipsoid_refit` needs
to find the smallest ellipsoid around its skin in any pose. Of its vertices only those are kept
that some pose needs.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.major_bones import MajorBones, major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import EllipsoidSettings
from garment_sim_ros.colliders.capsules.capsules import frame_colliders
from garment_sim_ros.colliders.ellipsoids.ellipsoids import EllipsoidFit, ellipsoids_around
from garment_sim_ros.colliders.range_of_motion import joint_rotations
from garment_sim_ros.colliders.regions import bone_weights
from garment_sim_ros.contact.kinds.ellipsoid import ELLIPSOID
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.mvee import mvee
from garment_sim_ros.geometry.transforms import quaternion_from_matrix, transform_points

_ALSO = ("leftToes", "rightToes")
"""Bones that are not major but bend far from the one above."""
_SHARED = 0.8
"""An ellipsoid of which no bone carries this share lies at a joint."""
_LITTLE = 0.01
"""A bone that has a smaller share of every vertex is left out."""
_POSES = 48
_OUTSIDE = 0.02
"""How far above 1 the zeta of a vertex that is left out may be in the poses that were tried."""


def fit_ellipsoids(
    body: Body,
    settings: EllipsoidSettings | None = None,
    *,
    delta: float = 0.0,
    thickness: float = 0.002,
) -> tuple[ColliderSet, dict[str, Any]]:
    """Ellipsoid colliders bound to the major bones, then one frame per major bone.

    Args:
        body: Rig and skin.
        settings: Thresholds and more; without `refit` all ellipsoids keep their shape.
        delta: Inflation of all shapes [m].
        thickness: Distance that cloth keeps on top [m].

    Returns:
        The set, and `EllipsoidFit.report` with the number that is ``refitted``.

    Raises:
        GeometryError: The body cannot be segmented.
        ParameterError: An option is out of range.
    """
    for name, value in (("delta", delta), ("thickness", thickness)):
        if not 0.0 <= value < np.inf:
            raise ParameterError(name, f"found {value!r}", "allowed: 0 m or more")
    settings = settings or EllipsoidSettings()
    fit = ellipsoids_around(body, settings)
    shapes = ellipsoid_colliders(body, fit, delta)
    if settings.refit:
        shapes = _refitted_at_joints(body, fit, shapes, delta)
    frames = frame_colliders(major_bones(body, also=_ALSO))
    colliders = ColliderSet(colliders=(*shapes, *frames), thickness=thickness)
    refitted = sum("points" in c.geometry for c in shapes)
    return colliders, {"refitted": refitted, **fit.report()}


def ellipsoid_colliders(body: Body, fit: EllipsoidFit, delta: float) -> list[Collider]:
    """Ellipsoids on the major bones that carry most of their skin, inflated by `delta` [m]."""
    bones = major_bones(body, also=_ALSO)
    weights = bone_weights(body.skin, bones)
    colliders = []
    for i, (e, members) in enumerate(zip(fit.ellipsoids, fit.members)):
        m = int(members.of(weights).sum(axis=0).argmax())
        T_bone_bind = body.skin.T_bone_bind[bones.joint[m]]
        colliders.append(
            Collider(
                name=f"{fit.region[i]}_{i}",
                kind=ELLIPSOID.name,
                bone=bones.names[m],
                position=transform_points(T_bone_bind, e.centre[None])[0],
                orientation=quaternion_from_matrix(T_bone_bind[:3, :3] @ e.axes),
                geometry={"radii": e.radii + delta},
            )
        )
    return colliders


def _refitted_at_joints(
    body: Body, fit: EllipsoidFit, colliders: list[Collider], delta: float
) -> list[Collider]:
    """The same, of which those at joints carry their points; frames will follow them."""
    bones = major_bones(body, also=_ALSO)
    weights = bone_weights(body.skin, bones)
    frame = {f.bone: len(colliders) + i for i, f in enumerate(frame_colliders(bones))}
    frames = np.array([frame[name] for name in bones.names], np.int32)
    motions = _random_poses(body, bones)
    x = body.skin.vertices
    result = []
    for collider, members in zip(colliders, fit.members):
        share = members.of(weights)
        if len(members) < 4 or share.mean(axis=0).max() >= _SHARED:
            result.append(collider)
            continue
        mine = np.flatnonzero(share.max(axis=0) >= _LITTLE)
        share = share[:, mine]
        # What each bone carries of a point between vertices: their places, by weight.
        own = members.of(weights[:, mine, None] * x[:, None]).transpose(1, 0, 2)
        own = np.where(
            share.T[..., None] > 1e-9, own / np.maximum(share.T[..., None], 1e-9), members.of(x)
        )
        share /= share.sum(axis=1, keepdims=True)
        carried = np.einsum("pbij,bvj->pbvi", motions[:, mine][..., :3, :3], own)
        carried += motions[:, mine][:, :, None, :3, 3]
        kept = _needed_points(np.einsum("vb,pbvi->pvi", share, carried))
        T_bone_bind = body.skin.T_bone_bind[bones.joint[mine]]
        geometry = {
            **collider.geometry,
            "frames": frames[mine],
            "points": np.stack(
                [transform_points(T, points[kept]) for T, points in zip(T_bone_bind, own)]
            ),
            "weights": np.ascontiguousarray(share[kept].T),
            "inflation": delta,
        }
        result.append(replace(collider, geometry=geometry))
    return result


def _needed_points(posed: FloatArray) -> IntArray:
    """Points whose smallest ellipsoid holds all others, nearly, in every pose.

    Args:
        posed: All points in each pose [m], shape [p, n, 3].

    Returns:
        Their indices, ascending.
    """
    first = posed[0]
    kept = {
        int(k) for axis in range(3) for k in (first[:, axis].argmin(), first[:, axis].argmax())
    }
    for points in posed:
        while True:
            zeta = mvee(points[sorted(kept)], tolerance=_OUTSIDE).zeta(points)
            farthest = int(zeta.argmax())
            if zeta[farthest] <= 1.0 + _OUTSIDE or farthest in kept:
                break
            kept.add(farthest)
    return np.array(sorted(kept), np.int32)


def _random_poses(body: Body, bones: MajorBones) -> FloatArray:
    """Motions of the major bones from the bind pose, all joints at once, shape [p, m, 4, 4].

    The first is no motion; in the others every joint is turned within its range.
    """
    rng = np.random.default_rng(0)
    pivot = rest_transforms(body.rig)[bones.first][:, :3, 3]
    owner = bone_weights(body.skin, bones).argmax(axis=1)
    motions = np.tile(np.eye(4), (_POSES, len(bones), 1, 1))
    for m, human in enumerate(bones.human):
        above = int(bones.parent[m])
        if above < 0:
            continue
        along = body.skin.vertices[owner == m].mean(axis=0) - pivot[m]
        length = np.linalg.norm(along)
        along = along / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])
        turns = joint_rotations(human, along)
        local = np.tile(np.eye(4), (_POSES, 1, 1))
        if len(turns):
            local[1:, :3, :3] = turns[rng.integers(len(turns), size=_POSES - 1)]
        local[:, :3, 3] = pivot[m] - local[:, :3, :3] @ pivot[m]
        motions[:, m] = motions[:, above] @ local
    return motions
