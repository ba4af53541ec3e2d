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


class _Limbs:
    """Shares of bones in points of the body.

    Args:
        x: Points [m], shape [v, 3].
        at: Joint centres by name [m].
        unit: Stature over 1.7 m.
    """

    def __init__(self, x: FloatArray, at: dict[str, FloatArray], unit: float) -> None:
        self.x, self.at, self.unit = x, at, unit

    def across(
        self, joint: str, normal: tuple[float, float, float], half_band: float
    ) -> FloatArray:
        """How far each point is past a joint, 0 to 1, in a band of half a width [m of 1.7 m]."""
        n = np.asarray(normal) / np.linalg.norm(normal)
        return _handover((self.x - self.at[joint]) @ n, half_band * self.unit)

    def arm(self, side: str, arm: FloatArray) -> dict[str, FloatArray]:
        """The arm's share divided among its bones."""
        upper, lower, hand = (
            self.at[f"{side}{part}"] for part in ("UpperArm", "LowerArm", "Hand")
        )
        elbow = self.across(f"{side}LowerArm", tuple(hand - upper), 0.04)
        wrist = self.across(f"{side}Hand", tuple(hand - lower), 0.025)
        return {
            f"{side}UpperArm": arm * (1.0 - elbow),
            f"{side}LowerArm": arm * elbow * (1.0 - wrist),
            f"{side}Hand": arm * elbow * wrist,
        }

    def leg(self, side: str, sign: float, trunk: FloatArray) -> dict[str, FloatArray]:
        """What a leg takes of the trunk's share, divided among its bones; the leg as ``""``."""
        hip = self.across(f"{side}UpperLeg", (0.0, 0.62 * sign, -0.78), 0.085)
        leg = trunk * hip * _handover(sign * self.x[:, 1], 0.02 * self.unit)
        knee = self.across(f"{side}LowerLeg", (0.0, 0.0, -1.0), 0.055)
        ankle = self.across(f"{side}Foot", (0.45, 0.0, -0.9), 0.035)
        toes = self.across(f"{side}Toes", (1.0, 0.0, 0.0), 0.02)
        return {
            "": leg,
            f"{side}UpperLeg": leg * (1.0 - knee),
            f"{side}LowerLeg": leg * knee * (1.0 - ankle),
            f"{side}Foot": leg * knee * ankle * (1.0 - toes),
            f"{side}Toes": leg * knee * ankle * toes,
        }

    def girdle(self, side: str, sign: float, trunk: FloatArray) -> FloatArray:
        """What a shoulder takes of the trunk's share: nothing of the head."""
        armpit = 0.5 * (self.at["upperChest"][2] + self.at["leftUpperArm"][2])
        nape = self.at["neck"][2] + 0.03 * self.unit
        reach = abs(self.at[f"{side}UpperArm"][1])
        result: FloatArray = (
            0.8
            * trunk
            * _handover(sign * self.x[:, 1] - 0.6 * reach, 0.5 * reach)
            * _handover(self.x[:, 2] - armpit, 0.07 * self.unit)
            * _handover(nape - self.x[:, 2], 0.05 * self.unit)
        )
        return result

    def spine(self, trunk: FloatArray) -> dict[str, FloatArray]:
        """The trunk's share divided among its bones, neck and head."""
        up = (0.0, 0.0, 1.0)
        steps = (
            self.across("spine", up, 0.07),
            self.across("chest", up, 0.07),
            self.across("upperChest", up, 0.07),
            self.across("neck", (0.35, 0.0, 0.94), 0.04),
            self.across("head", (0.62, 0.0, 0.78), 0.035),
        )
        share = {}
        for name, step in zip(("hips", "spine", "chest", "upperChest", "neck"), steps):
            share[name] = trunk * (1.0 - step)
            trunk = trunk * step
        return share | {"head": trunk}


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
    unit = height / 1.7
    limbs = _Limbs(x, dict(zip(names, joints)), unit)
    sides = (("left", 1.0), ("right", -1.0))
    share: dict[str, FloatArray] = {}
    trunk = np.ones(len(x))
    taken = _handover(left_arm_lead - 0.015 * unit, 0.05 * unit)
    for side, sign in sides:
        arm = np.where(sign * x[:, 1] > 0.0, taken, 0.0)
        share |= limbs.arm(side, arm)
        trunk = trunk - arm
    legs = np.zeros(len(x))
    for side, sign in sides:
        bones = limbs.leg(side, sign, trunk)
        legs = legs + bones.pop("")
        share |= bones
    trunk = trunk - legs
    for side, sign in sides:
        share[f"{side}Shoulder"] = girdle = limbs.girdle(side, sign, trunk)
        trunk = trunk - girdle
    share |= limbs.spine(trunk)
    return _strongest(np.stack([share[name] for name in names], axis=1))


def _strongest(weight: FloatArray) -> tuple[IntArray, FloatArray]:
    """The bones of most weight of each vertex [v, n], and their weights, with sum 1."""
    bone = np.argsort(-weight, axis=1, kind="stable")[:, :INFLUENCES].astype(np.int32)
    weight = np.take_along_axis(weight, bone, axis=1)
    weight[weight < 1e-3] = 0.0
    weight /= weight.sum(axis=1, keepdims=True)
    return np.where(weight > 0.0, bone, 0).astype(np.int32), weight
