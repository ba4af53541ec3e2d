"""Skin weights of the mannequin: smooth partitions of space at each joint.

An arm takes a point that its own surface is nearer to than the trunk's is, so that the side of
the chest stays free of it however close the arm hangs. Within trunk, arms and legs each joint
hands over from parent to child across a plane, in a band about as wide as the limb. Shares
multiply along the chains, so that they always sum to 1.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray

INFLUENCES = 4


def _handover(s: FloatArray, half_band: float) -> FloatArray:
    """0 below -half_band, 1 above +half_band, cubic between."""
    h = np.clip(0.5 + 0.5 * s / half_band, 0.0, 1.0)
    return h * h * (3.0 - 2.0 * h)


def skin_weights(
    x: FloatArray,
    names: tuple[str, ...],
    joints: FloatArray,
    left_arm_lead: FloatArray,
    height: float,
) -> tuple[IntArray, FloatArray]:
    """Bones and weights of each vertex.

    Args:
        x: Vertices [m], shape [v, 3].
        names: Joint names.
        joints: Joint centres [m], shape [n, 3].
        left_arm_lead: Distance to the rest of the body minus distance to the arm of its own side
            [m], shape [v].
        height: Stature [m].

    Returns:
        Joint indices and weights, shape [v, 4] each; unused influences are 0 with weight 0.
    """
    at = dict(zip(names, joints))
    unit = height / 1.7

    def across(joint: str, normal: tuple[float, float, float], half_band: float) -> FloatArray:
        n = np.asarray(normal) / np.linalg.norm(normal)
        return _handover((x - at[joint]) @ n, half_band * unit)

    share: dict[str, FloatArray] = {}
    trunk = np.ones(len(x))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        own = sign * x[:, 1]
        arm = np.where(own > 0.0, _handover(left_arm_lead - 0.015 * unit, 0.05 * unit), 0.0)
        elbow = across(f"{side}LowerArm", tuple(at[f"{side}Hand"] - at[f"{side}UpperArm"]), 0.04)
        wrist = across(f"{side}Hand", tuple(at[f"{side}Hand"] - at[f"{side}LowerArm"]), 0.025)
        share[f"{side}UpperArm"] = arm * (1.0 - elbow)
        share[f"{side}LowerArm"] = arm * elbow * (1.0 - wrist)
        share[f"{side}Hand"] = arm * elbow * wrist
        trunk = trunk - arm
    legs = np.zeros(len(x))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        own = sign * x[:, 1]
        hip = across(f"{side}UpperLeg", (0.0, 0.62 * sign, -0.78), 0.085)
        leg = trunk * hip * _handover(own, 0.02 * unit)
        knee = across(f"{side}LowerLeg", (0.0, 0.0, -1.0), 0.055)
        ankle = across(f"{side}Foot", (0.45, 0.0, -0.9), 0.035)
        toes = across(f"{side}Toes", (1.0, 0.0, 0.0), 0.02)
        share[f"{side}UpperLeg"] = leg * (1.0 - knee)
        share[f"{side}LowerLeg"] = leg * knee * (1.0 - ankle)
        share[f"{side}Foot"] = leg * knee * ankle * (1.0 - toes)
        share[f"{side}Toes"] = leg * knee * ankle * toes
        legs = legs + leg
    trunk = trunk - legs
    armpit = 0.5 * (at["upperChest"][2] + at["leftUpperArm"][2])
    for side, sign in (("left", 1.0), ("right", -1.0)):
        reach = abs(at[f"{side}UpperArm"][1])
        girdle = (
            0.8
            * trunk
            * _handover(sign * x[:, 1] - 0.6 * reach, 0.5 * reach)
            * _handover(x[:, 2] - armpit, 0.07 * unit)
        )
        share[f"{side}Shoulder"] = girdle
        trunk = trunk - girdle
    chain = ("hips", "spine", "chest", "upperChest", "neck", "head")
    up = (0.0, 0.0, 1.0)
    steps = (
        across("spine", up, 0.07),
        across("chest", up, 0.07),
        across("upperChest", up, 0.07),
        across("neck", (0.35, 0.0, 0.94), 0.04),
        across("head", (0.62, 0.0, 0.78), 0.035),
    )
    rest = trunk
    for name, step in zip(chain, steps):
        share[name] = rest * (1.0 - step)
        rest = rest * step
    share["head"] = rest

    weight = np.stack([share[name] for name in names], axis=1)
    bone = np.argsort(-weight, axis=1, kind="stable")[:, :INFLUENCES].astype(np.int32)
    weight = np.take_along_axis(weight, bone, axis=1)
    weight[weight < 1e-3] = 0.0
    weight /= weight.sum(axis=1, keepdims=True)
    return np.where(weight > 0.0, bone, 0).astype(np.int32), weight
