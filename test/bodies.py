"""Bodies made from others."""

import dataclasses

import numpy as np

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
