"""Which bones that matter for colliders and garments a skeleton is not known to have."""

from collections.abc import Collection, Sequence

import numpy as np

from garment_sim_ros.body.major_bones import joint_areas
from garment_sim_ros.body.skin import Body

_LIMBS = ("UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot")
_NEEDED: tuple[tuple[str, ...], ...] = (
    ("hips",),
    ("spine", "chest", "upperChest"),
    ("neck", "head"),
    *((f"{side}{part}",) for part in _LIMBS for side in ("left", "right")),
)
"""Groups of bones of which one is enough."""

_SHOWN = 8
_MIN_SHARE = 0.005
"""Joints that carry less of the skin than this do not stand for a missing bone."""


def missing_bones(name: str, bones: Collection[str], others: Sequence[str], option: str) -> str:
    """What to tell about a skeleton before it is used.

    Args:
        name: What to call it.
        bones: Humanoid bones that it is known to have.
        others: Its joints that are no such bone, those that matter most first.
        option: The parameter that can say which joint is which bone.

    Returns:
        One line; empty where nothing is missing.
    """
    missing = ["/".join(group) for group in _NEEDED if not any(bone in bones for bone in group)]
    if not missing:
        return ""
    shown = ", ".join(others[:_SHOWN]) + (", ..." if len(others) > _SHOWN else "")
    return (
        f"{name}: no joint is known to be {', '.join(missing)}; "
        f"joints without a known bone: {shown or 'none'}; {option} can say which is which"
    )


def missing_bones_of(body: Body, option: str = "bone_names") -> str:
    """The same for a body; joints that carry most skin come first, those with little are left out.

    A body with a single joint has no skeleton that could be named: nothing is told.
    """
    if len(body.rig) == 1:
        return ""
    carried = joint_areas(body.skin)
    known = set(body.humanoid.values())
    below = np.zeros(len(body.rig), bool)  # fingers, toes and faces are no missing bone
    ends = [body.humanoid.get(bone) for bone in ("head", "leftHand", "rightHand")]
    for joint, parent in enumerate(body.rig.parent):
        below[joint] = parent >= 0 and (below[parent] or body.rig.joint_names[int(parent)] in ends)
    order = np.argsort(-carried, kind="stable")
    others = [
        body.rig.joint_names[j]
        for j in order
        if carried[j] > _MIN_SHARE * carried.sum()
        and not below[j]
        and body.rig.joint_names[j] not in known
    ]
    return missing_bones(body.name, body.humanoid, others, option)
