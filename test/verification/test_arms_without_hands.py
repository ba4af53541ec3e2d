"""A body whose forearms are the last joints of its arms moves like one that has hands."""

import dataclasses

import numpy as np

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.rig import Dofs, Rig
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.mocap.clips import load_clip

SIDES = ("left", "right")


def without_hands(body):
    """The body without the joints below its forearms, to which their skin goes."""
    rig, skin = body.rig, body.skin
    elbows = [rig.index(body.humanoid[f"{side}LowerArm"]) for side in SIDES]
    kept = np.ones(len(rig), bool)
    owner = np.arange(len(rig))
    for elbow in elbows:
        below = rig.below(elbow)
        owner[below] = elbow
        kept &= ~below
    kept[elbows] = True
    number = np.cumsum(kept) - 1
    names = tuple(name for name, k in zip(rig.joint_names, kept) if k)
    parent = np.where(rig.parent >= 0, number[rig.parent], -1)[kept]
    return dataclasses.replace(
        body,
        rig=Rig(
            joint_names=names,
            parent=parent,
            T_parent_joint=rig.T_parent_joint[kept],
            dofs=Dofs.none(),
        ),
        skin=dataclasses.replace(
            skin, bone=number[owner[skin.bone]], T_bone_bind=skin.T_bone_bind[kept]
        ),
        humanoid={bone: joint for bone, joint in body.humanoid.items() if joint in names},
    )


def test_its_forearms_lie_as_with_hands(data_file):
    """Told from the skin: the MakeHuman body's elbows are bent at rest, the clip's are straight.

    Hands turn a little against forearms, which a body without them cannot.
    """
    whole = load_body(data_file("bodies", "mh_female_young.glb"))
    bare = without_hands(whole)
    clip = load_clip(data_file("mocap", "deepmimic_walk.bvh"))
    ways = []
    for body in (whole, bare):
        to_body = Retargeter(
            clip.rig, body, T_world_source=clip.T_world_file, reference=clip.source_reference
        )
        T = to_body.world_joints(clip.values[0], 0.0)
        x = Skinner.of(body).vertices(T)
        for side in SIDES:
            joint = bare.rig.index(bare.humanoid[f"{side}LowerArm"])
            share = (bare.skin.weight * (bare.skin.bone == joint)).sum(axis=1)
            elbow = T[body.rig.index(body.humanoid[f"{side}LowerArm"]), :3, 3]
            way = x[share > 0.5].mean(axis=0) - elbow
            ways.append(way / np.linalg.norm(way))
    off = np.degrees(np.arccos(np.einsum("ai,ai->a", np.array(ways[:2]), np.array(ways[2:]))))
    assert off.max() < 8.0
