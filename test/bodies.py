"""Bodies made from others."""

import dataclasses

import numpy as np
import trimesh

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.rig import Rig


def scaled(body, factor):
    """The same body, so many times as large."""
    T = body.rig.T_parent_joint.copy()
    inverse = body.skin.T_bone_bind.copy()
    T[:, :3, 3] *= factor
    inverse[:, :3, 3] *= factor
    rig = Rig(
        joint_names=body.rig.joint_names,
        parent=body.rig.parent,
        T_parent_joint=T,
        dofs=body.rig.dofs,
    )
    skin = dataclasses.replace(
        body.skin, vertices=factor * body.skin.vertices, T_bone_bind=inverse
    )
    return dataclasses.replace(body, rig=rig, skin=skin)


def with_fingers(body, length):
    """The body with a point of skin beyond each wrist, sideways [m]."""
    hands = [body.rig.index(f"{side}Hand") for side in ("left", "right")]
    tips = rest_transforms(body.rig)[hands, :3, 3] + [[0.0, length, 0.0], [0.0, -length, 0.0]]
    skin = dataclasses.replace(
        body.skin,
        vertices=np.vstack([body.skin.vertices, tips]),
        bone=np.vstack([body.skin.bone, np.array(hands)[:, None]]),
        weight=np.vstack([body.skin.weight, np.ones((2, 1))]),
    )
    return dataclasses.replace(body, skin=skin)


def with_yoke(body, low, high):
    """The body with a flat box on its chest, from shoulder to shoulder, open below [m]."""
    T, bones = rest_transforms(body.rig), body.humanoid
    left, right = (T[body.rig.index(bones[f"{s}UpperArm"]), :3, 3] for s in ("left", "right"))
    middle = 0.5 * (left + right)
    box = trimesh.creation.box(extents=[0.16, abs(left[1] - right[1]) + 0.02, high - low])
    box.update_faces(box.face_normals[:, 2] > -0.5)
    box = box.subdivide().subdivide().subdivide()
    box.apply_translation([middle[0], middle[1], 0.5 * (low + high)])
    chest = np.zeros((len(box.vertices), body.skin.bone.shape[1]))
    weight = chest.copy()
    chest[:], weight[:, 0] = body.rig.index(bones["upperChest"]), 1.0
    skin = dataclasses.replace(
        body.skin,
        vertices=np.vstack([body.skin.vertices, box.vertices]),
        triangles=np.vstack([body.skin.triangles, box.faces + len(body.skin.vertices)]),
        bone=np.vstack([body.skin.bone, chest]),
        weight=np.vstack([body.skin.weight, weight]),
    )
    return dataclasses.replace(body, skin=skin)
