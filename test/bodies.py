"""Bodies made from others."""

import dataclasses

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
