"""Where a garment sits on a body: heights, outlines and arm axes, from its rig and its skin."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.constants import PERSON_HEIGHT
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.slices import Profile, crossings, sections
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.geometry.transforms import matrix_from_quaternion

_SLICES = 128
_ARM_SLICES = 24
# Arms that hang closer than this to the vertical are raised to make what has sleeves, which is
# then placed on the rest pose like on any other.
_LEAST_ARM_ANGLE = np.radians(30.0)
_ARM_ANGLE = np.radians(45.0)
_BENT = 0.7  # cosine of the bend of an elbow from which on an arm is not straight
_NECK_RADIUS = 0.035  # per body height, where the skin has no neck
_NECK_RISE = 0.015  # per body height: how far its base may be above its joint
_NECK_SLICES = 24
_WIDEST_NECK = 0.6  # of the way from shoulder to shoulder
_FLAT_SHOULDERS = 0.9  # of that way: what is so wide where a neck begins is no neck
_SHORT_NECK = 0.75  # of the girth at the shoulders: what is thicker is no neck


@dataclass(frozen=True, kw_only=True)
class Arm:
    """An upper arm.

    Attributes:
        frame: Two axes across the arm, the axis from shoulder to elbow, and the shoulder joint,
            as a rigid transform to the world, shape [4, 4].
        length: From shoulder to elbow [m].
        profile: Outlines across the arm, by distance from the shoulder [m]; only where the whole
            section belongs to the arm.
    """

    frame: FloatArray
    length: float
    profile: Profile

    def along(self, points: FloatArray) -> FloatArray:
        """Distance along the arm from the shoulder, of points [..., 3] [m], shape [...]."""
        return (points - self.frame[:3, 3]) @ self.frame[:3, 2]

    @property
    def radius(self) -> float:
        """Radius of a circle as long as the mean girth [m]."""
        return float(self.profile.girth.mean()) / (2.0 * np.pi)


@dataclass(frozen=True, kw_only=True)
class Neck:
    """Where the neck leaves the shoulders.

    Attributes:
        centre: Middle of the neck at its base [m], shape [3].
        radius: Radius of a circle as long as its girth [m].
        half_width: Half its extent from side to side at its base, trapezius included [m].
    """

    centre: FloatArray
    radius: float
    half_width: float


class Measures:
    """Measurements of one body in rest pose; each is taken when it is first asked for.

    Args:
        body: The body, z up, x forward.
        T_world_joint: The pose that it is measured in, shape [n, 4, 4]; None for its rest pose.

    Attributes:
        vertices: Skin in that pose [m], shape [v, 3].
        T_world_joint: Joints in that pose, shape [n, 4, 4].

    Raises:
        GeometryError: In the properties: a bone that they need is missing or has no skin.
    """

    def __init__(self, body: Body, T_world_joint: FloatArray | None = None) -> None:
        self.body = body
        self.T_world_joint = rest_transforms(body.rig) if T_world_joint is None else T_world_joint
        self.vertices = skin_vertices(body.skin, self.T_world_joint)

    def with_arms_away(
        self, least: float = _LEAST_ARM_ANGLE, angle: float = _ARM_ANGLE
    ) -> "Measures":
        """The body with arms that hang closer than `least` to the vertical raised to `angle`.

        Args:
            least: Angle of the upper arms from straight down that is left as it is [rad].
            angle: Angle to which others are raised sideways [rad].
        """
        T = self.T_world_joint.copy()
        for side, sign in (("left", 1.0), ("right", -1.0)):
            shoulder = self.joint(f"{side}UpperArm")
            axis = self.joint(f"{side}LowerArm") - shoulder
            now = np.arctan2(np.hypot(axis[0], axis[1]), -axis[2])
            if sign * axis[1] < -abs(axis[0]) and axis[2] < 0.0:  # inwards, under the trunk
                now = -now
            if now >= least:
                continue
            raised = np.eye(4)
            raised[:3, :3] = matrix_from_quaternion(
                np.array(
                    [sign * np.sin(0.5 * (angle - now)), 0.0, 0.0, np.cos(0.5 * (angle - now))]
                )
            )
            raised[:3, 3] = shoulder - raised[:3, :3] @ shoulder
            below = self._below([f"{side}UpperArm"])
            T[below] = raised @ T[below]
        if np.array_equal(T, self.T_world_joint):
            return self
        return Measures(self.body, T)

    @property
    def has_arms(self) -> bool:
        """Whether the rig has upper and lower arms that are known."""
        return {
            f"{side}{part}Arm" for side in ("left", "right") for part in ("Upper", "Lower")
        } <= set(self.body.humanoid)

    def joint(self, *bones: str) -> FloatArray:
        """Position of the first of these humanoid bones that the body has [m], shape [3].

        Raises:
            GeometryError: It has none of them.
        """
        return self.T_world_joint[self._joint_index(bones), :3, 3]

    def share(self, *bones: str) -> FloatArray:
        """How much each skin vertex follows these bones and what hangs on them, shape [v]."""
        skin = self.body.skin
        return (skin.weight * self._below(bones)[skin.bone]).sum(axis=1)

    @cached_property
    def height(self) -> float:
        """Extent of skin and joints [m]; heads and feet may be missing."""
        joints = [self.joint(bone)[2] for bone in self.body.humanoid]
        return float(np.ptp(np.concatenate([self.vertices[:, 2], joints])))

    @cached_property
    def unit(self) -> float:
        """A metre on a person of 1.65 m: sizes of a garment scale with its wearer."""
        return self.height / PERSON_HEIGHT

    @cached_property
    def trunk_share(self) -> FloatArray:
        """How much each vertex belongs to neither arms nor head, shape [v]."""
        return 1.0 - self.share("leftUpperArm", "rightUpperArm", "head")

    @cached_property
    def trunk(self) -> Profile:
        """Outlines of trunk and legs at heights from the soles to the head's joint."""
        low = self.sole + 0.02 * self.height
        heights = np.linspace(low, max(self.neck, self.joint("head", "neck")[2]), _SLICES)
        skin = self.body.skin
        profile = sections(
            self.vertices, skin.triangles, self.trunk_share, np.eye(4), heights
        ).filled()
        if len(profile.offset) < _SLICES // 4:
            raise GeometryError(f"{self.body.name}: too little skin on trunk and legs")
        return profile

    @cached_property
    def sole(self) -> float:
        """Height of the lowest skin [m]."""
        return float(self.vertices[:, 2].min())

    @cached_property
    def instep(self) -> float:
        """Height of the highest skin of the feet [m]; of a twentieth of the body without feet."""
        feet = [bone for bone in ("leftFoot", "rightFoot") if bone in self.body.humanoid]
        high = self.vertices[self.share(*feet) > 0.5, 2] if feet else np.zeros(0)
        usual = self.sole + 0.05 * self.height
        return float(min(high.max(), self.knee)) if high.size else usual

    @cached_property
    def knee(self) -> float:
        """Height of the knees [m]."""
        return self._mean_height("leftLowerLeg", "rightLowerLeg")

    @cached_property
    def pelvis(self) -> float:
        """Height of the hip joints [m]."""
        return self._mean_height("leftUpperLeg", "rightUpperLeg")

    @cached_property
    def neck(self) -> float:
        """Height of the neck's joint [m]; of the head's lowest skin where it is under the arms."""
        z = float(self.joint("neck", "head")[2])
        skin = self.vertices[self.share("neck", "head") > 0.5, 2]
        if self.has_arms and z < self.shoulders and skin.size:
            z = max(z, float(skin.min()))  # a robot's head is fixed to its chest anywhere
        if not z > self.pelvis > self.knee:
            raise GeometryError(
                f"{self.body.name}: neck, hips and knees stand at {z:.3g}, {self.pelvis:.3g} and "
                f"{self.knee:.3g} m; garments need an upright rest pose"
            )
        return z

    @cached_property
    def waist(self) -> float:
        """Height of the narrowest girth of the trunk between hips and chest [m]."""
        s = (self.trunk.offset - self.pelvis) / (self.neck - self.pelvis)
        # Where the trunk is a plain cylinder the waist is at its usual place, 0.4 of the way.
        girth = self.trunk.girth * (1.0 + 0.5 * (s - 0.4) ** 2)
        candidates = np.flatnonzero((s > 0.15) & (s < 0.65))
        if not candidates.size:
            raise GeometryError(f"{self.body.name}: no skin between hips and chest for a waist")
        return float(self.trunk.offset[candidates[np.argmin(girth[candidates])]])

    @cached_property
    def hips(self) -> float:
        """Height of the widest girth below the waist and above the crotch [m]."""
        z = self.trunk.offset
        candidates = np.flatnonzero((z < self.waist) & (z > self.crotch))
        if not candidates.size:
            return 0.5 * (self.waist + self.crotch)
        return float(z[candidates[np.argmax(self.trunk.girth[candidates])]])

    @cached_property
    def crotch(self) -> float:
        """Height at which the legs part [m]."""
        middle = 0.5 * (self.joint("leftUpperLeg") + self.joint("rightUpperLeg"))
        turned = (self.vertices - middle)[:, [2, 0, 1]]  # left becomes up
        edges = edge_table(self.body.skin.triangles)[0]
        z = crossings(turned, edges, self.trunk_share, 0.0)[:, 0]
        thigh = self.pelvis - self.knee
        z = z[(z > -0.6 * thigh) & (z < 0.6 * thigh)]
        return float(middle[2] + z.min()) if z.size else self.pelvis - 0.15 * thigh

    @cached_property
    def shoulders(self) -> float:
        """Height of the shoulder joints [m]."""
        return self._mean_height("leftUpperArm", "rightUpperArm")

    @cached_property
    def neck_base(self) -> Neck:
        """The neck's base: where the trunk has narrowed to half its girth at the shoulders.

        A short neck, such as a small child's, never does: its base is where it is thinnest.
        """
        z, girth = self.trunk.offset, self.trunk.girth
        wide = np.interp(self.shoulders, z, girth)
        thinnest = np.append(girth[1:] > girth[:-1], False) & (girth < _SHORT_NECK * wide)
        narrow = np.flatnonzero((z > self.shoulders) & ((girth < 0.5 * wide) | thinnest))
        i = int(narrow[0]) if narrow.size else len(z) - 1
        radius = girth[i] / (2.0 * np.pi) if narrow.size else _NECK_RADIUS * self.height
        # Trapezius muscles narrow the girth late; the neck's joint is where it bends.
        height = min(0.5 * (z[i] + min(z[i], self.neck)), self.neck + _NECK_RISE * self.height)
        profile = self.trunk
        if not narrow.size and len(self.body.rig.dofs) and len(self._above_neck.offset):
            # A robot's neck has its joint inside the chest.
            profile = self._above_neck
            thin = np.flatnonzero(profile.girth < 0.5 * wide)
            k = int(thin[0]) if thin.size else len(profile.offset) - 1
            height = float(profile.offset[k])
            if thin.size:
                radius = profile.girth[k] / (2.0 * np.pi)
        centre, half_width = _middle_at(profile, height)
        if self.has_arms:
            apart = self.joint("leftUpperArm")[1] - self.joint("rightUpperArm")[1]
            between = 0.5 * abs(float(apart))
            is_flat = narrow.size and half_width > _FLAT_SHOULDERS * between
            if is_flat:  # a puppet's shoulders reach as high as its neck does
                centre, half_width = _middle_at(profile, max(height, float(z[i])))
            if is_flat or profile is not self.trunk:
                half_width = min(half_width, _WIDEST_NECK * between)
        return Neck(centre=centre, radius=float(radius), half_width=half_width)

    @cached_property
    def _above_neck(self) -> Profile:
        """Outlines of the trunk from the neck's joint to its highest skin."""
        top = float(self.vertices[self.trunk_share > 0.5, 2].max(initial=self.neck))
        heights = np.linspace(self.neck, top, _NECK_SLICES if top > self.neck else 0)
        skin = self.body.skin
        share = self.trunk_share
        return sections(self.vertices, skin.triangles, share, np.eye(4), heights).filled()

    @cached_property
    def arms(self) -> tuple[Arm, Arm]:
        """The left and the right upper arm."""
        return self._arm("left"), self._arm("right")

    def _arm(self, side: str) -> Arm:
        shoulder, elbow = self.joint(f"{side}UpperArm"), self.joint(f"{side}LowerArm")
        length = float(np.linalg.norm(elbow - shoulder))
        if length < 0.02 * self.height:
            raise GeometryError(f"{self.body.name}: the {side} upper arm has a length of {length}")
        frame = np.eye(4)
        axis = (elbow - shoulder) / length
        first = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
        first /= np.linalg.norm(first)
        frame[:3, :4] = np.column_stack([first, np.cross(axis, first), axis, shoulder])
        offsets = length * np.linspace(0.35, 0.95, _ARM_SLICES)
        # A forearm that points elsewhere is no part of what goes through a sleeve.
        hand = f"{side}Hand" if f"{side}Hand" in self.body.humanoid else f"{side}LowerArm"
        bent = axis @ (self.joint(hand) - elbow) < _BENT * np.linalg.norm(self.joint(hand) - elbow)
        left_out = f"{side}LowerArm" if bent else f"{side}Hand"
        share = self.share(f"{side}UpperArm") - self.share(left_out)
        triangles = self.body.skin.triangles
        profile = sections(self.vertices, triangles, share, frame, offsets).filled()
        if not len(profile.offset):
            raise GeometryError(f"{self.body.name}: no skin on the {side} upper arm")
        return Arm(frame=frame, length=length, profile=profile)

    def _mean_height(self, *bones: str) -> float:
        return float(np.mean([self.joint(bone)[2] for bone in bones]))

    def _below(self, bones: Sequence[str]) -> NDArray[np.bool_]:
        """Whether each joint is one of the bones, as far as the body has them, or below one."""
        there = [self._joint_index([bone]) for bone in bones if bone in self.body.humanoid]
        return self.body.rig.below(*there)

    def _joint_index(self, bones: Sequence[str]) -> int:
        for bone in bones:
            if bone in self.body.humanoid:
                return self.body.rig.index(self.body.humanoid[bone])
        raise GeometryError(
            f"{self.body.name}: no bone {' or '.join(bones)}; garments need hips, upper and lower "
            "legs, and neck or head; shirts also upper and lower arms"
        )


def _middle_at(profile: Profile, height: float) -> tuple[FloatArray, float]:
    """Middle of an upright outline, shape [3], and half its extent from side to side [m]."""
    front, left, back, right = profile.at(np.array([height]))[0].reshape(4, -1)[:, 0]
    return np.array([0.5 * (front - back), 0.5 * (left - right), height]), 0.5 * (left + right)
