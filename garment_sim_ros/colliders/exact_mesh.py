"""The skin itself as a collider: the yardstick of all others, and far too slow for real time."""

import numpy as np

from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.contact.kinds.mesh import MESH
from garment_sim_ros.contact.shapes import Collider, ColliderSet, frame_of
from garment_sim_ros.errors import GeometryError


def fit_mesh(body: Body, *, thickness: float = 0.002) -> ColliderSet:
    """One collider of kind mesh, after a frame for each major bone and each that moves skin.

    Args:
        body: Rig and skin.
        thickness: Distance that cloth keeps from the skin [m].

    Raises:
        GeometryError: The skin has no triangles.
    """
    skin = body.skin
    if len(skin.triangles) == 0:
        raise GeometryError(f"body {body.name!r} has no triangles to collide with")
    moving = skin.bone[skin.weight > 0.0]
    bones = major_bones(body)
    root = body.rig.index(bones.root)
    others = np.setdiff1d(np.union1d(bones.joint, moving), [root])
    joints = np.concatenate([[root], others])  # see `ColliderSet.root`
    names = [body.rig.joint_names[j] for j in joints]
    number = np.zeros(len(body.rig), np.int32)
    number[joints] = np.arange(len(joints))
    mesh = Collider(
        name="skin",
        kind=MESH.name,
        bone=names[0],
        geometry={
            "vertices": skin.vertices,
            "triangles": skin.triangles,
            "frame": np.where(skin.weight > 0.0, number[skin.bone], 0),
            "weight": skin.weight,
            "bind": skin.T_bone_bind[joints, :3],
        },
    )
    frames = (frame_of(name) for name in names)
    return ColliderSet(colliders=(*frames, mesh), thickness=thickness)
