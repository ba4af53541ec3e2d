"""Anatomical frames of a skeleton in one pose, from the positions of its joints.

Two skeletons whose bones are called differently, rest differently and are proportioned differently
still have the same anatomy: a thigh runs from hip to knee and its knee is a hinge. A frame that is
built from these facts alone, by the same rule in both, says which orientation of one corresponds
to which of the other.

All positions are in a frame with z up. Columns of an anatomical frame: any fixed choice, the same
for all skeletons.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.rig import Rig

UP = np.array([0.0, 0.0, 1.0])
SIDES = ("left", "right")
_NEXT = {"LowerArm": "Hand", "LowerLeg": "Foot"}
TRUNK = ("spine", "chest", "upperChest")

_MIN_LENGTH = 1e-6
_BENT = np.radians(15.0)
"""Bend from which on elbow and knee show their hinge axis."""
_HEAD_TIP = np.cos(np.radians(45.0))
"""A head's end farther off the trunk's direction is a program's filler, not the head's top."""
_LEANING = np.radians(10.0)
"""Tilt of the shank beyond which a rest pose's foot is taken to be at right angles to it."""


@dataclass(frozen=True, kw_only=True)
class SourceReference:
    """What the joints of a source skeleton alone do not tell.

    Attributes:
        values: Channel name to value [rad or m] of a pose that shows the body standing; channels
            left out are 0. Empty where the zero pose is such a pose.
        end_sites: Joint name to where its bone ends, in the joint's frame [m].
        hinges: Joint name of an upper arm or leg to the axis about which its elbow or knee bends,
            in the joint's frame.
        soles: Joint name of a foot to the direction that is up when it stands flat, in the
            joint's frame.
        ankle_height: World height of the ankle of a foot that stands on the ground [m]. None
            takes that of the target's body, scaled, or for a skeleton that cannot move from its
            place that of its reference pose.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    end_sites: Mapping[str, FloatArray] = field(default_factory=dict)
    hinges: Mapping[str, FloatArray] = field(default_factory=dict)
    soles: Mapping[str, FloatArray] = field(default_factory=dict)
    ankle_height: float | None = None


@dataclass(frozen=True, kw_only=True)
class Landmarks:
    """Where the bones of a skeleton are in one pose.

    Attributes:
        joint: Position of each humanoid bone's joint [m], shape [3] each.
        tip: Where feet, forearms and head end, for those with a joint or end site beyond them.
        hinge: Axis about which elbow or knee bends, for those upper arms and legs where it is
            known from elsewhere.
        sole: Direction at right angles to the sole, upwards, for those feet where it is known
            from elsewhere.
    """

    joint: Mapping[str, FloatArray]
    tip: Mapping[str, FloatArray] = field(default_factory=dict)
    hinge: Mapping[str, FloatArray] = field(default_factory=dict)
    sole: Mapping[str, FloatArray] = field(default_factory=dict)

    def between(self, start: str, end: str) -> FloatArray | None:
        """Unit vector from one bone's joint to another's; None where undefined."""
        if start not in self.joint or end not in self.joint:
            return None
        return unit(self.joint[end] - self.joint[start])

    def lower(self, side: str, lower: str) -> FloatArray | None:
        """Unit vector along a forearm or shank, by its end where the next joint is unknown."""
        end = self.joint.get(side + _NEXT[lower], self.tip.get(side + lower))
        if end is None or side + lower not in self.joint:
            return None
        return unit(end - self.joint[side + lower])

    def trunk(self) -> list[str]:
        """Bones of the trunk above the hips, lowest first."""
        return [bone for bone in TRUNK if bone in self.joint]

    def lateral(self, part: str) -> FloatArray | None:
        """Unit vector from the right to the left joint of a paired bone."""
        return self.between(f"right{part}", f"left{part}")

    def middle(self, part: str) -> FloatArray | None:
        """Midpoint of a paired bone's joints."""
        if f"left{part}" not in self.joint or f"right{part}" not in self.joint:
            return None
        return 0.5 * (self.joint[f"left{part}"] + self.joint[f"right{part}"])


def find_landmarks(
    rig: Rig,
    mapping: Mapping[str, str],
    T_world_joint: FloatArray,
    known: SourceReference,
) -> Landmarks:
    """Landmarks of a posed rig.

    Args:
        rig: The rig.
        mapping: Humanoid bone to joint name.
        T_world_joint: Pose of its joints, z up, shape [n, 4, 4].
        known: What is known beside the rig.
    """
    index = {name: i for i, name in enumerate(rig.joint_names)}
    joint = {bone: T_world_joint[index[name], :3, 3].copy() for bone, name in mapping.items()}
    tip: dict[str, FloatArray] = {}
    for bone in (*(side + part for side in SIDES for part in ("Foot", "LowerArm")), "head"):
        if bone not in mapping:
            continue
        name = mapping[bone]
        beyond = bone.replace("Foot", "Toes").replace("LowerArm", "Hand")
        children = np.flatnonzero(rig.parent == index[name])
        if beyond != bone and beyond in joint:
            tip[bone] = joint[beyond]
        elif name in known.end_sites:
            T = T_world_joint[index[name]]
            tip[bone] = T[:3, :3] @ known.end_sites[name] + T[:3, 3]
        elif bone != "head" and len(children):
            tip[bone] = T_world_joint[children, :3, 3].mean(axis=0)
    turned = [
        {
            bone: T_world_joint[index[name], :3, :3] @ axes[name]
            for bone, name in mapping.items()
            if name in axes
        }
        for axes in (known.hinges, known.soles)
    ]
    return Landmarks(joint=joint, tip=tip, hinge=turned[0], sole=turned[1])


def unit(vector: FloatArray) -> FloatArray | None:
    """The vector at length 1; None where it has no direction."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > _MIN_LENGTH else None


def frame(primary: FloatArray, secondary: FloatArray) -> FloatArray | None:
    """Rotation whose first column is `primary` and whose second leans towards `secondary`."""
    x = unit(primary)
    z = None if x is None else unit(np.cross(x, secondary))
    if x is None or z is None:
        return None
    return np.stack([x, np.cross(z, x), z], axis=1)


def shortest_arc(a: FloatArray, b: FloatArray) -> FloatArray:
    """The smallest rotation that takes unit vector a to unit vector b, shape [3, 3]."""
    c = float(a @ b)
    if c < -1.0 + 1e-9:  # opposite: any axis at right angles will do
        axis = unit(np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))]))
        assert axis is not None
        return 2.0 * np.outer(axis, axis) - np.eye(3)
    v = np.cross(a, b)
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + skew + skew @ skew / (1.0 + c)


def heading_frame(marks: Landmarks) -> FloatArray | None:
    """Forward, left, up of the whole body, up along z; None where its left is not known."""
    left = np.zeros(3)
    for part in ("UpperLeg", "UpperArm"):
        line = marks.lateral(part)
        if line is not None:
            left += line
    left_level = unit(left - left[2] * UP)
    if left_level is None:
        return None
    return np.stack([np.cross(left_level, UP), left_level, UP], axis=1)


def stands(marks: Landmarks, up: FloatArray = UP) -> bool:
    """Whether a pose is that of a standing person: legs down, trunk up, hips level.

    Args:
        marks: The pose; both legs and arms, or neck, must be known.
        up: Unit vector away from the ground.
    """
    hips, shoulders = marks.middle("UpperLeg"), marks.middle("UpperArm")
    top = shoulders if shoulders is not None else marks.joint.get("neck")
    hip_line, shoulder_line = marks.lateral("UpperLeg"), marks.lateral("UpperArm")
    if hips is None or top is None or hip_line is None:
        return False
    trunk = unit(top - hips)
    if trunk is None or trunk @ up < 0.8 or abs(hip_line @ up) > 0.35:
        return False
    if shoulder_line is not None and shoulder_line @ hip_line < 0.7:
        return False
    for side in SIDES:
        for upper, lower in (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot")):
            bone = marks.between(side + upper, side + lower)
            if bone is None or bone @ up > -0.8:
                return False
    return True


def leg_length(marks: Landmarks) -> float | None:
    """Thigh plus shank [m], mean of the legs that are known."""
    lengths = [
        sum(
            float(np.linalg.norm(marks.joint[side + b] - marks.joint[side + a]))
            for a, b in (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot"))
        )
        for side in SIDES
        if {f"{side}UpperLeg", f"{side}LowerLeg", f"{side}Foot"} <= marks.joint.keys()
    ]
    return float(np.mean(lengths)) if lengths and min(lengths) > _MIN_LENGTH else None


def anatomical_frames(marks: Landmarks, *, designed: bool) -> dict[str, FloatArray]:
    """Frame of each bone that the pose determines.

    Args:
        marks: The pose, z up.
        designed: True for a rest pose that was drawn: its trunk and head are upright and look
            ahead whatever the curve of the spine's joints. False for a captured pose: there the
            joints tell how trunk and head lean.

    Returns:
        Humanoid bone to rotation, shape [3, 3]; bones whose frame cannot be told are absent.
    """
    body = heading_frame(marks)
    if body is None:
        return {}
    frames = dict.fromkeys(("hips", *marks.trunk(), "neck", "head"), body)
    if not designed:
        frames.update(_leaning_trunk(marks, body))
    top = frames[marks.trunk()[-1]] if marks.trunk() else frames["hips"]
    for side in SIDES:
        frames[f"{side}Shoulder"] = top
        frames.update(_limb(marks, side, ("UpperArm", "LowerArm", "Hand"), -body[:, 1]))
        legs = _limb(marks, side, ("UpperLeg", "LowerLeg", "Foot"), body[:, 1])
        frames.update(legs)
        foot = _foot(marks, side, body, designed)
        frames[f"{side}Foot"] = frames[f"{side}Toes"] = foot
    return {bone: rotation for bone, rotation in frames.items() if bone in marks.joint}


def _leaning_trunk(marks: Landmarks, body: FloatArray) -> dict[str, FloatArray]:
    """Frames of hips, trunk, neck and head that lean as their joints do."""
    trunk = ["hips", *marks.trunk()]
    chain = [*trunk, *(bone for bone in ("neck", "head") if bone in marks.joint)]
    shoulder_line = marks.lateral("UpperArm")
    frames: dict[str, FloatArray] = {}
    top = body
    for i, bone in enumerate(trunk):
        left = marks.lateral("UpperLeg") if bone in ("hips", "spine") else shoulder_line
        directions = (marks.between(bone, above) for above in chain[i + 1 :])
        up = next((direction for direction in directions if direction is not None), None)
        rotation = _upright(up, left)
        top = frames[bone] = top if rotation is None else rotation
    # Necks lean forward by nature, each skeleton's by another angle: no use for comparison.
    frames["neck"] = top
    frames["head"] = top
    tip = unit(marks.tip["head"] - marks.joint["head"]) if "head" in marks.tip else None
    if tip is not None and tip @ top[:, 2] > _HEAD_TIP:
        rotation = _upright(tip, shoulder_line)
        frames["head"] = top if rotation is None else rotation
    return frames


def _upright(up: FloatArray | None, left: FloatArray | None) -> FloatArray | None:
    """Forward, left, up with `up` exact; None where undefined."""
    if up is None or left is None:
        return None
    turned = frame(up, left)
    if turned is None:
        return None
    up, left = turned[:, 0], turned[:, 1]
    return np.stack([np.cross(left, up), left, up], axis=1)


def _limb(
    marks: Landmarks, side: str, parts: tuple[str, str, str], hanging_hinge: FloatArray
) -> dict[str, FloatArray]:
    """Frames of an arm's or leg's bones: each along its bone, turned by the middle joint's hinge.

    A straight limb does not show its hinge. It is then the one of a hanging limb, where it points
    sideways (elbows flex forward, knees backward), carried to the limb's direction.
    """
    upper, lower, end = (side + part for part in parts)
    upper_direction = marks.between(upper, lower)
    if upper_direction is None:
        return {}
    lower_direction = marks.lower(side, parts[1])
    if lower_direction is None:
        lower_direction = upper_direction
    normal = np.cross(upper_direction, lower_direction)
    bend = float(np.arctan2(np.linalg.norm(normal), upper_direction @ lower_direction))
    shows_hinge = _BENT < bend < np.pi - _BENT
    if upper in marks.hinge:
        normal, shows_hinge = marks.hinge[upper], True
    frames: dict[str, FloatArray | None] = {}
    for bone, direction in ((upper, upper_direction), (lower, lower_direction)):
        hinge = normal if shows_hinge else shortest_arc(-UP, direction) @ hanging_hinge
        frames[bone] = frame(direction, hinge)
    if parts[2] == "Hand":
        # Fingers differ too much between skeletons to say more than "along the forearm".
        frames[end] = frames.get(lower)
    return {bone: rotation for bone, rotation in frames.items() if rotation is not None}


def _foot(marks: Landmarks, side: str, body: FloatArray, designed: bool) -> FloatArray:
    """Frame of a foot flat on the ground, turned to where its toes point."""
    neutral = np.eye(3)
    shank = marks.between(f"{side}LowerLeg", f"{side}Foot")
    if f"{side}Foot" in marks.sole:
        neutral = shortest_arc(UP, marks.sole[f"{side}Foot"])
    elif designed and shank is not None and np.arccos(np.clip(-shank[2], -1, 1)) > _LEANING:
        neutral = shortest_arc(-UP, shank)
    forward = body[:, 0]
    if f"{side}Foot" in marks.tip and f"{side}Foot" in marks.joint:
        along = neutral.T @ (marks.tip[f"{side}Foot"] - marks.joint[f"{side}Foot"])
        level = unit(np.array([along[0], along[1], 0.0]))
        if level is not None and level @ forward > 0.0:
            forward = level
    return neutral @ np.stack([forward, np.cross(UP, forward), UP], axis=1)
