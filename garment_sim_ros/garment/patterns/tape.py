"""Tape measurements of a body, taken from its skin in rest pose.

Nothing but the surface is asked for, so that bodies without a rig are measured as others are. The
body stands upright, z up, facing x, arms away from the trunk. A girth is the length of the convex
outline of a horizontal section of the trunk: a tape does not follow hollows. Places are those of
ISO 8559-1: the bust girth is taken at the bust points, the waist where the trunk is the narrowest
between chest and hips, the hips where it is the widest below. Shoulder points lie straight above
the armpits.
"""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.tape_arms import Arm, arm_of, from_shoulder
from garment_sim_ros.garment.patterns.tape_sections import (
    Level,
    Loops,
    girth_of,
    level_of,
    loops_at,
    trunk_of,
)

_LEVELS = 240
_NEAR_HEAD, _HEAD = 0.65, 0.92  # of the height: a neck is between


@dataclass(frozen=True, kw_only=True)
class Tape:
    """Measurements [m].

    Attributes:
        floor: Height of the soles in the body's frame.
        height: From the soles to the top of the head.
        neck: The neck at its narrowest.
        bust: Where the chest is the widest.
        waist: Where the trunk is the narrowest.
        hip: Where it is the widest below.
        crotch: Height of the crotch: the inside leg.
        armpit: Height of the armpits.
        shoulder: Width from shoulder point to shoulder point.
        shoulder_height: Height of the shoulder points.
        neck_base: The section where the neck leaves the shoulders.
        back_neck: Height of the nape.
        thigh: Girth of a thigh below the crotch.
        knee: Girth of a leg halfway down.
        ankle: Least girth of a leg.
        foot_out: Distance of an ankle's middle from the mid-plane.
        arms: The left and the right arm.
        levels: Sections of the trunk from crotch to neck, upwards.
    """

    floor: float
    height: float
    neck: Level
    bust: Level
    waist: Level
    hip: Level
    crotch: float
    armpit: float
    shoulder: float
    shoulder_height: float
    neck_base: Level
    thigh: float
    knee: float
    ankle: float
    foot_out: float
    arms: tuple[Arm, Arm]
    levels: tuple[Level, ...]

    @property
    def leg(self) -> float:
        """Inside leg: from crotch to floor."""
        return self.crotch

    @property
    def arm(self) -> float:
        """Arm length: from shoulder point to wrist, of both the mean."""
        return 0.5 * (self.arms[0].length + self.arms[1].length)

    def at(self, height: float) -> Level:
        """The section nearest to a height over the ground [m]."""
        return min(self.levels, key=lambda level: abs(level.height - height))

    def named(self) -> dict[str, float]:
        """What a tailor asks for, by name [m]."""
        return {
            "height": self.height,
            "bust": self.bust.girth,
            "waist": self.waist.girth,
            "hip": self.hip.girth,
            "neck": self.neck.girth,
            "shoulder": self.shoulder,
            "arm": self.arm,
            "leg": self.leg,
        }


def measured(vertices: FloatArray, triangles: IntArray, name: str = "the body") -> Tape:
    """Measures a body.

    Args:
        vertices: Skin in rest pose, z up, facing x [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        name: What messages call it.

    Raises:
        GeometryError: It does not stand upright with legs and arms away from the trunk.
    """
    x = np.asarray(vertices, dtype=np.float64)
    used = np.unique(triangles)
    low, size = x[used].min(axis=0), np.ptp(x[used], axis=0)
    height = float(size[2])
    if not (size[2] > 0.9 * size[1] and size[2] > 1.5 * size[0]):
        raise GeometryError(
            f"{name} is {size[2]:.3g} m high, {size[1]:.3g} m wide and {size[0]:.3g} m deep; "
            "allowed: a body that stands upright, z up, facing x"
        )
    x = x - [0.0, 0.0, low[2]]
    mid = _mid_plane(x, used, height)
    cuts = [(z, loops_at(x, triangles, z, 2)) for z in np.linspace(0.03, 0.97, _LEVELS) * height]
    crotch, legs = _crotch(cuts, mid, height, name)
    trunk = {z: trunk_of(loops, mid) for z, loops in cuts if z > crotch}
    levels = tuple(level_of(z, p) for z, p in trunk.items() if p is not None)
    # What is beside the head are ears.
    near_head = [v for v in levels if _NEAR_HEAD < v.height / height < _HEAD]
    throat = min(near_head, key=lambda v: v.girth).height if near_head else _HEAD * height
    armpit, armpit_out = _armpit([c for c in cuts if crotch < c[0] <= throat], mid, height, name)
    below = [v for v in levels if v.height < armpit]
    waist = _waist(below, crotch, armpit, name)
    hip = max((v for v in below if v.height <= waist.height), key=lambda v: v.girth)
    bust = _bust([v for v in below if v.height >= waist.height])
    neck = _neck(levels, armpit, height, name)
    arms = tuple(arm_of(x, triangles, side, mid, armpit, waist, name) for side in (1.0, -1.0))
    shoulder_height = _top(x, used, mid, armpit_out, armpit, neck)
    arms = tuple(from_shoulder(arm, armpit_out, mid, shoulder_height) for arm in arms)
    thigh, knee, ankle = _leg_girths(legs, mid, crotch)
    return Tape(
        floor=float(low[2]),
        height=height,
        neck=neck,
        bust=bust,
        waist=waist,
        hip=hip,
        crotch=crotch,
        armpit=armpit,
        shoulder=2.0 * armpit_out,
        shoulder_height=shoulder_height,
        neck_base=_neck_base(levels, neck, shoulder_height),
        thigh=thigh,
        knee=knee,
        ankle=ankle,
        foot_out=_foot_out(legs, mid, height),
        arms=(arms[0], arms[1]),
        levels=tuple(v for v in levels if v.height <= neck.height),
    )


def _mid_plane(x: FloatArray, used: IntArray, height: float) -> float:
    """The y of the middle of head and trunk [m]."""
    upper = x[used][x[used, 2] > 0.85 * height]
    return float(0.5 * (upper[:, 1].min() + upper[:, 1].max()))


def _crotch(
    cuts: list[tuple[float, Loops]], mid: float, height: float, name: str
) -> tuple[float, list[tuple[float, Loops]]]:
    """Height at which the legs part, and the sections below."""
    legs = []
    for z, loops in cuts:
        trunk = trunk_of(loops, mid)
        # Thighs that touch may reach a little across the middle.
        if (
            z > 0.3 * height
            and trunk is not None
            and min(mid - trunk[:, 1].min(), trunk[:, 1].max() - mid) > 0.03 * height
        ):
            break
        legs.append((z, loops))
    z = legs[-1][0] if legs else 0.0
    if not 0.3 * height < z < 0.65 * height:
        raise GeometryError(
            f"{name}: its legs do not part between 0.3 and 0.65 of its height; allowed: a body "
            "that stands on two legs, head up"
        )
    return float(z), legs


def _armpit(
    cuts: list[tuple[float, Loops]], mid: float, height: float, name: str
) -> tuple[float, float]:
    """Where arms leave the trunk, of cuts from crotch to neck: below it they have their own.

    Returns:
        Its height, and its distance from the mid-plane [m].
    """
    apart = []
    for z, loops in cuts:
        sides = [
            np.sign(p[:, 1].mean() - mid)
            for p in loops.points
            if (p[:, 1].min() > mid or p[:, 1].max() < mid) and girth_of(p) > 0.05 * height
        ]
        if {1.0, -1.0} <= set(sides):
            apart.append(z)
    if not apart:
        # Arms held out level have no sections of their own: they widen the trunk at once.
        wide = [
            z
            for z, loops in cuts
            if (t := trunk_of(loops, mid)) is not None and np.ptp(t[:, 1]) > 0.5 * height
        ]
        beneath = [cut for cut in cuts if wide and cut[0] < wide[0]]
        if not beneath:
            raise GeometryError(
                f"{name}: no arms beside its trunk; allowed: a body with arms held away from it"
            )
        z, loops = beneath[-1]
        trunk = trunk_of(loops, mid)
        assert trunk is not None
        return float(z), float(0.5 * np.ptp(trunk[:, 1]))
    z, loops = next(cut for cut in cuts if cut[0] == max(apart))
    half = []
    for side in (1.0, -1.0):
        trunk = trunk_of(loops, mid)
        inner = min(
            (side * (p[:, 1] - mid)).min()
            for p in loops.points
            if (side * (p[:, 1] - mid)).min() > 0.0 and girth_of(p) > 0.05 * height
        )
        outer = inner if trunk is None else (side * (trunk[:, 1] - mid)).max()
        half.append(0.5 * (inner + outer))
    return float(z), float(np.mean(half))


def _waist(below: list[Level], crotch: float, armpit: float, name: str) -> Level:
    """The narrowest section between the hips and the chest."""
    span = armpit - crotch
    low, high = crotch + 0.3 * span, crotch + 0.75 * span
    candidates = [v for v in below if low <= v.height <= high]
    if not candidates:
        raise GeometryError(f"{name}: no trunk between legs and arms; allowed: a whole body")
    # Where the trunk is a plain cylinder the waist is at its usual place, halfway.
    usual = 0.5 * (low + high)
    return min(candidates, key=lambda v: v.girth * (1.0 + 0.3 * ((v.height - usual) / span) ** 2))


def _bust(chest: list[Level]) -> Level:
    """Where the chest stands out the most from a line up from the belly.

    The widest girth is nearer to the armpits on many bodies, where shoulder blades and the root of
    the arm count in.
    """
    low, high = chest[0], chest[-1]
    span = max(high.height - low.height, 1e-9)
    upper = [v for v in chest if v.height >= low.height + 0.4 * span]

    def stands_out(v: Level) -> float:
        s = (v.height - low.height) / span
        return v.front - (1.0 - s) * low.front - s * high.front

    return max(upper, key=stands_out)


def _neck(levels: tuple[Level, ...], armpit: float, height: float, name: str) -> Level:
    """The narrowest section between the shoulders and the head."""
    above = [v for v in levels if armpit + 0.04 * height < v.height < _HEAD * height]
    if not above:
        raise GeometryError(f"{name}: no neck above its arms; allowed: a body with a head")
    return min(above, key=lambda v: v.girth)


def _neck_base(levels: tuple[Level, ...], neck: Level, shoulder_height: float) -> Level:
    """Where the trunk, coming down from the neck, gets a third wider than it."""
    for level in reversed(levels):
        if level.height < neck.height and level.size[1] > 1.3 * neck.size[1]:
            return level
        if level.height <= shoulder_height:
            return level
    return neck


def _top(
    x: FloatArray, used: IntArray, mid: float, out: float, armpit: float, neck: Level
) -> float:
    """Height of the shoulder points: on top of the surface, straight above the armpits [m]."""
    heights = []
    for side in (1.0, -1.0):
        y = mid + side * out
        near = used[(np.abs(x[used, 1] - y) < 0.012 * neck.height) & (x[used, 2] > armpit)]
        near = near[x[near, 2] < neck.height]
        heights.append(float(x[near, 2].max()) if len(near) else 1.07 * armpit)
    return float(np.mean(heights))


def _leg_girths(
    legs: list[tuple[float, Loops]], mid: float, crotch: float
) -> tuple[float, float, float]:
    """Girths of a leg below the crotch, halfway down, and at its narrowest [m]."""

    def girth(share: float) -> float:
        _, loops = min(legs, key=lambda cut: abs(cut[0] - share * crotch))
        sides = [girth_of(p) for p in loops.points if not p[:, 1].min() < mid < p[:, 1].max()]
        own = sorted(sides)[-2:]
        return float(np.mean(own)) if own else 0.0

    ankle = min(girth(s) for s in np.linspace(0.08, 0.3, 12))
    return girth(0.96), girth(0.58), ankle


def _foot_out(legs: list[tuple[float, Loops]], mid: float, height: float) -> float:
    """Mean distance of the legs' middles from the mid-plane at the ankles [m]."""
    _, loops = min(legs, key=lambda cut: abs(cut[0] - 0.06 * height))
    return float(np.mean([abs(m[1] - mid) for m in loops.middle]))
