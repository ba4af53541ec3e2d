"""The built-in walk: normal gait on a circle, a straight line or the spot, made by code.

Hips, pelvis, arms and feet's pitch follow published curves (`gait_curves`); the legs are then
solved so that a foot on the ground stays where it is: it rolls over its heel, stands flat and
rolls over its ball.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.constants import GRAVITY
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.mocap import gait_curves as gait
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.gait_foot import FootPath
from garment_sim_ros.mocap.walker import (
    ANKLE,
    BALL,
    HAND,
    HEAD,
    HIP_WIDTH,
    SHANK,
    SIDES,
    THIGH,
    TOE,
    channel_values,
    walker_rig,
)
from garment_sim_ros.params import parameter, validated

_SPEEDS = (0.6, 1.8)
"""Speeds at which a person of 1.7 m walks so [m/s]."""
_FRAME_RATE = 100.0

_TREAD = 0.030
"""Half the distance between the feet's lines, as a fraction of the height."""
_TOE_OUT = np.radians(6.0)
_BOB, _SWAY = 0.008, 0.011
"""Half the way of the pelvis up and down, and to the sides, as fractions of the height."""
_REACH = 0.9985
"""Share of the stretched leg's length that is used at most: knees never lock."""
_TRUNK_LEAN = np.radians(3.0)
_ARM_OUT = np.radians(17.0)  # clear of a skirt; without one, arms hang at about 7


@dataclass(frozen=True, kw_only=True)
class WalkOptions:
    """How the built-in walk is walked."""

    height: float = parameter(1.7, "Height of the walker.", unit="m", minimum=0.5, maximum=3.0)
    speed: float = parameter(1.3, "Walking speed.", unit="m/s", minimum=0.4, maximum=2.4)
    path: str = parameter(
        "circle",
        "Once around a circle to the left, straight along x, or on the spot.",
        choices=("circle", "straight", "in_place"),
    )
    strides: int = parameter(
        9, "Length of the clip in strides; 9 make a circle of 2 m radius.", minimum=4, maximum=1000
    )


def walk(
    *, height: float = 1.7, speed: float = 1.3, path: str = "circle", strides: int = 9
) -> Clip:
    """A walk that loops without a seam; see `WalkOptions` for the arguments.

    Returns:
        A clip with its own skeleton, z up, whose joints are called as the humanoid bones. On the
        circle and in place it loops; straight on it continues with ``repeat="carry"``.

    Raises:
        ParameterError: An option is outside its range.
    """
    validated(WalkOptions, {"height": height, "speed": speed, "path": path, "strides": strides})
    size = height / 1.7  # equal Froude numbers give equal angles
    if not _SPEEDS[0] <= speed / np.sqrt(size) <= _SPEEDS[1]:
        low, high = (v * np.sqrt(size) for v in _SPEEDS)
        raise ParameterError(
            "speed", f"is {speed:g} m/s", f"allowed at {height:g} m: {low:.2f} to {high:.2f}"
        )
    stride, period = gait.stride_at(speed / np.sqrt(size))
    stride, period = stride * size, period * np.sqrt(size)
    frames = max(round(strides * period * _FRAME_RATE), 8)
    way = _Way(path, stride * strides / (2.0 * np.pi) if path == "circle" else np.inf)
    phase = np.linspace(0.0, strides, frames + 1)
    figure, root = _pose(phase, stride, height, speed, way)
    values = channel_values(figure, root)
    if path != "straight":
        values[-1] = values[0]  # but for a full turn on the circle
        values[-1, 3] += 2.0 * np.pi * np.round((values[-2, 3] - values[-1, 3]) / (2.0 * np.pi))
    return Clip(
        name="walk",
        rig=walker_rig(height),
        times=np.linspace(0.0, strides * period, frames + 1),
        values=values,
        T_world_file=np.eye(4),
        end_sites=(
            ("head", (0.0, 0.0, HEAD * height)),
            *((f"{side}Hand", (0.0, 0.0, -HAND * height)) for side, _ in SIDES),
            *((f"{side}Toes", ((TOE - BALL) * height, 0.0, 0.0)) for side, _ in SIDES),
        ),
        ankle_height=ANKLE * height,
        loops=path != "straight",
        notes=(f"Built-in walk at {speed:g} m/s: stride {stride:.2f} m in {period:.2f} s.",),
    )


@dataclass(frozen=True)
class _Way:
    """Where the walk leads: way and sideways distance to the ground, and heading.

    Attributes:
        path: As in `WalkOptions`.
        radius: Radius of the circle [m], which is walked to the left around the origin.
    """

    path: str
    radius: float

    def heading(self, along: FloatArray) -> FloatArray:
        return along / self.radius

    def ground(
        self, along: FloatArray, left: float | FloatArray, walker: FloatArray
    ) -> FloatArray:
        """World x, y of a point; `walker` is how far the walker has come."""
        if self.path == "circle":
            angle = along / self.radius
            r = self.radius - left
            return np.stack([r * np.sin(angle), -r * np.cos(angle)], axis=-1)
        start = walker if self.path == "in_place" else 0.0
        return np.stack(np.broadcast_arrays(along - start, left), axis=-1)


def _pose(
    phase: FloatArray, stride: float, height: float, speed: float, way: _Way
) -> tuple[dict[str, FloatArray], FloatArray]:
    """World rotations of all joints, shape [f, 3, 3] each, and the hips' position, [f, 3].

    Args:
        phase: Time in strides since a heel strike of the right foot, shape [f].
        stride: Length of a stride [m].
        height: Height of the walker [m].
        speed: Walking speed [m/s].
        way: Where the walk leads.
    """
    along = stride * phase
    heading = way.heading(along)
    lean = np.arctan(speed**2 / (GRAVITY * way.radius))
    turn, lists = gait.pelvis_turn(phase), gait.pelvis_list(phase)
    pelvis = _turned(heading + turn, np.zeros_like(phase), -lists - lean)
    counter = heading - turn
    chest = _turned(counter, _TRUNK_LEAN, 0.3 * lists - lean)
    figure = {
        "hips": pelvis,
        "spine": _turned(heading + 0.4 * turn, 0.5 * _TRUNK_LEAN, -0.5 * lists - lean),
        "chest": chest,
        "neck": _turned(heading - 0.5 * turn, 0.7 * _TRUNK_LEAN, -0.8 * lean),
        "head": _turned(heading, 0.0, -0.5 * lean),
    }
    legs = {
        side: FootPath(phase + (0.5 if sign > 0 else 0.0), stride, height) for side, sign in SIDES
    }
    sway = -_SWAY * height * np.cos(2.0 * np.pi * (phase - 0.31))
    rise = -_BOB * height * np.cos(4.0 * np.pi * phase)
    hip_offset = {
        side: pelvis @ np.array([0.0, sign * HIP_WIDTH * height, 0.0]) for side, sign in SIDES
    }
    ankles = {
        side: np.concatenate(
            [
                way.ground(along + legs[side].ahead, sign * _TREAD * height, along),
                legs[side].up[:, None],
            ],
            axis=1,
        )
        for side, sign in SIDES
    }
    level = 0.5 * height
    for _ in range(3):  # leaning moves the hips sideways, which changes how high they can be
        left = sway + level * np.tan(lean)
        root = np.concatenate([way.ground(along, left, along), rise[:, None]], axis=1)
        level = min(_highest(ankles[side], root + hip_offset[side], height) for side, _ in SIDES)
    root[:, 2] += level
    for side, sign in SIDES:
        figure.update(
            _leg(
                side, sign, root + hip_offset[side], ankles[side], legs[side], heading, way, along
            )
        )
        own = phase + (0.5 if sign > 0 else 0.0)
        still = np.zeros_like(phase)
        swung = _turned(still, -gait.shoulder_flexion(own), still)
        figure[f"{side}UpperArm"] = chest @ _turned(still, 0.0, sign * _ARM_OUT) @ swung
        bent = _turned(still, -gait.elbow_flexion(own), still)
        figure[f"{side}LowerArm"] = figure[f"{side}Hand"] = figure[f"{side}UpperArm"] @ bent
    return figure, root


def _turned(yaw: FloatArray, pitch: float | FloatArray, roll: float | FloatArray) -> FloatArray:
    """Rotations about z, then the turned y, then the turned x, shape [f, 3, 3]."""
    angles = np.stack(np.broadcast_arrays(yaw, pitch, roll), axis=-1)
    return Rotation.from_euler("ZYX", angles).as_matrix()


def _highest(ankle: FloatArray, hip: FloatArray, height: float) -> float:
    """How far the hips can be raised before a leg is stretched."""
    reach = _REACH * (THIGH + SHANK) * height
    across = np.linalg.norm(ankle[:, :2] - hip[:, :2], axis=1)
    return float((ankle[:, 2] + np.sqrt(np.maximum(reach**2 - across**2, 0.0)) - hip[:, 2]).min())


def _leg(
    side: str, sign: float, hip: FloatArray, ankle: FloatArray, foot: FootPath,
    heading: FloatArray, way: _Way, along: FloatArray,
) -> dict[str, FloatArray]:  # fmt: skip
    """World rotations of a leg whose hip and ankle are given: the knee bends forward.

    By the law of cosines in the plane of hip, ankle and the walking direction.
    """
    thigh, shank = THIGH * foot.height, SHANK * foot.height
    line = ankle - hip
    distance = np.linalg.norm(line, axis=1)
    down = line / distance[:, None]
    facing = heading - 0.5 * sign * -_TOE_OUT
    left = np.stack([-np.sin(facing), np.cos(facing), np.zeros_like(facing)], axis=1)
    left -= (left * down).sum(axis=1)[:, None] * down
    left /= np.linalg.norm(left, axis=1)[:, None]
    forward = np.cross(down, left)
    cosine = (thigh**2 + distance**2 - shank**2) / (2.0 * thigh * distance)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))[:, None]
    upper = np.cos(angle) * down + np.sin(angle) * forward
    lower = line - thigh * upper
    lower /= np.linalg.norm(lower, axis=1)[:, None]
    rotations = [
        np.stack([np.cross(left, -bone), left, -bone], axis=-1) for bone in (upper, lower)
    ]
    foot_heading = way.heading(along + foot.ahead) + sign * _TOE_OUT
    return {
        f"{side}UpperLeg": rotations[0],
        f"{side}LowerLeg": rotations[1],
        f"{side}Foot": _turned(foot_heading, -foot.pitch, 0.0),
        f"{side}Toes": _turned(foot_heading, -foot.pitch - foot.toes, 0.0),
    }
