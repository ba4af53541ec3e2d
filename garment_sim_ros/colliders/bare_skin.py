"""Skin that leaves all shapes of a fit, as a collider of its own that cloth is shown over.

Shapes go with one bone or with a joint. Where a rig hangs skin on bones that are far away, as that
of the back on the upper arms, no shape holds it in all poses: cloth lies on the shapes, and skin
shows through. Such skin is found over random poses and goes along with the set.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.random_poses import random_poses
from garment_sim_ros.colliders.regions import bone_weights
from garment_sim_ros.colliders.report.fatness import Union
from garment_sim_ros.contact.kinds.bare_skin import BARE_SKIN
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.geometry.ties import to_nanometres
from garment_sim_ros.geometry.triangles import triangle_areas

_POSES, _SEED = 48, 7
_OUT = 0.003
"""Skin that is farther out of all shapes is bare [m]."""
_OFTEN = 0.08
"""Share of the poses in which a triangle is bare that is taken."""
_LEAST = 0.03
"""Share of the skin's area from which on it is worth it: good rigs have less."""
_INFLUENCES = 4


def with_bare_skin(body: Body, colliders: ColliderSet) -> ColliderSet:
    """A fit with the skin that often leaves its shapes, where that is much; else as it is.

    Args:
        body: Rig and skin.
        colliders: What was fitted to it, a frame for each major bone among them.
    """
    found = bare_triangles(body, colliders)
    area = triangle_areas(body.skin.vertices, body.skin.triangles)
    if area[found].sum() <= _LEAST * area.sum():
        return colliders
    return replace(colliders, colliders=(*colliders.colliders, patch(body, colliders, found)))


def bare_triangles(body: Body, colliders: ColliderSet) -> NDArray[np.bool_]:
    """Which triangles of a skin are often out of all shapes, shape [t]."""
    triangles = body.skin.triangles
    poser, skinner = ColliderPoser(colliders, body), Skinner(body.skin)
    union: Union | None = None
    count = np.zeros(len(triangles), np.int32)
    for joints in random_poses(body, _POSES, seed=_SEED):
        posed = poser.poses(joints)
        if union is None:
            union = Union(colliders, posed)
        union.move(posed)
        x = skinner.vertices(joints)
        out = union.distance(np.concatenate([x, x[triangles].mean(axis=1)])) > _OUT
        count += out[: len(x)][triangles].any(axis=1) | out[len(x) :]
    return count > _OFTEN * _POSES


def patch(body: Body, colliders: ColliderSet, bare: NDArray[np.bool_]) -> Collider:
    """Some triangles of a skin and those around them, moved by the frames of a set.

    Args:
        body: Rig and skin.
        colliders: What was fitted to it.
        bare: Which triangles, shape [t].
    """
    skin, bones = body.skin, major_bones(body)
    same, triangles = _welded(skin.vertices, skin.triangles)
    at_bare = np.zeros(len(same), np.bool_)
    at_bare[triangles[bare]] = True
    triangles = triangles[at_bare[triangles].any(axis=1)]
    used, corner = np.unique(triangles, return_inverse=True)
    frames = [c.bone for c in colliders.colliders if c.is_frame]
    weight = bone_weights(skin, bones)[same[used]]
    most = np.argsort(-weight, axis=1, kind="stable")[:, :_INFLUENCES]
    weight = np.take_along_axis(weight, most, axis=1)
    frame = np.array([frames.index(name) for name in bones.names], np.int32)
    joint = [body.rig.index(name) for name in frames]
    return Collider(
        name=BARE_SKIN.name,
        kind=BARE_SKIN.name,
        bone=frames[0],
        geometry={
            "vertices": skin.vertices[same[used]],
            "triangles": corner.reshape(-1, 3).astype(np.int32),
            "frame": frame[most],
            "weight": weight / weight.sum(axis=1, keepdims=True),
            "bind": skin.T_bone_bind[joint, :3],
        },
    )


def _welded(vertices: FloatArray, triangles: IntArray) -> tuple[IntArray, IntArray]:
    """One vertex of all that are in one place, as at seams of a texture, and triangles of these.

    Returns:
        The vertices [n], and triangles as rows of these, shape [t, 3].
    """
    _, first, row = np.unique(
        to_nanometres(vertices), axis=0, return_index=True, return_inverse=True
    )
    return first.astype(np.int32), row.ravel()[triangles].astype(np.int32)
