"""An arm measured: sections across the axis from its shoulder to its finger tips."""

from dataclasses import dataclass, replace

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.tape_sections import Level, girth_of, loops_at

_TRUNK = 1.8
"""A section longer than the median of an arm's by this is not that of the arm alone."""
_SHORTEST = 0.2
"""Distance of a wrist from the armpit at least, in heights of the armpit."""


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One arm.

    Attributes:
        shoulder: Where it leaves the trunk, on the upper arm's axis [m], shape [3].
        direction: From there to the elbow, shape [3].
        length: From the shoulder point over the elbow to the wrist [m].
        elbow: On the arm's axis, halfway [m], shape [3].
        wrist_place: On the arm's axis [m], shape [3].
        upper: Largest girth of the upper arm, below the armpit [m].
        wrist: Girth of the wrist [m].
        girths: Along the arm at even places from the shoulder to the wrist [m], shape [k].
    """

    shoulder: FloatArray
    direction: FloatArray
    length: float
    elbow: FloatArray
    wrist_place: FloatArray
    upper: float
    wrist: float
    girths: FloatArray


def arm_of(
    x: FloatArray,
    triangles: IntArray,
    side: float,
    mid: float,
    armpit: float,
    waist: Level,
    name: str,
) -> Arm:
    """One arm: sections across its axis, which runs from the shoulder to the wrist."""
    part = (x[:, 1] - mid) * side > 0.5 * waist.size[1] + 0.02 * waist.height
    part &= x[:, 2] > 0.55 * armpit
    tip = x[part][np.argmax((x[part, 1] - mid) * side)] if part.any() else None
    if tip is None:
        raise GeometryError(f"{name}: no arm on one side; allowed: a body with two arms")
    trunk_half = 0.5 * waist.size[1]
    near = 0.014 * armpit
    root = np.array([waist.centre[0], mid + side * (trunk_half + near), armpit + near])
    arm = _along_arm(x, triangles, root, tip, side, name)
    reach = arm.wrist_place - root
    if reach[1] * side < 0.0 or np.linalg.norm(reach) < _SHORTEST * armpit:
        raise GeometryError(
            f"{name}: no arm on one side: what is there does not lead away from the trunk; "
            "allowed: a body with two arms"
        )
    return arm


def _along_arm(
    x: FloatArray, triangles: IntArray, root: FloatArray, tip: FloatArray, side: float, name: str
) -> Arm:
    """Sections of an arm between a rough root and its finger tips."""
    start, end = root, tip
    for _ in range(3):  # the axis of the sections' middles
        axis = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
        reach = float((tip - start) @ axis)
        places = np.linspace(0.05, 0.95, 48) * reach
        found = [_arm_section(x, triangles, start, axis, s, tip) for s in places]
        there = [(s, m, g) for s, hit in zip(places, found, strict=True) if hit for m, g in [hit]]
        if len(there) < 12:
            raise GeometryError(f"{name}: an arm cannot be measured; allowed: arms off the trunk")
        s, middles, girths = (np.array(v) for v in zip(*there, strict=True))
        own = girths < _TRUNK * np.median(girths)  # others go through the trunk as well
        s, middles, girths = s[own], middles[own], girths[own]
        fore = s < 0.7 * reach
        line = np.polyfit(s[fore], middles[fore], 1)
        start, end = line[1], line[1] + reach * line[0]
    # The wrist is the narrowest place before the hand.
    hand = (s > 0.55 * reach) & (s < 0.85 * reach)
    at = np.flatnonzero(hand)[np.argmin(girths[hand])]
    upper = (s > 0.04 * reach) & (s < 0.3 * reach)
    # The arm is bent at the elbow: garments hang on the axis of the upper arm.
    fore = (s > 0.05 * reach) & (s < 0.42 * reach)
    line = np.polyfit(s[fore], middles[fore], 1)
    half = int(np.argmin(np.abs(s - 0.45 * reach)))
    return Arm(
        shoulder=line[1],
        direction=line[0] / np.linalg.norm(line[0]),
        length=0.0,  # once the shoulder point is known
        elbow=middles[half],
        wrist_place=middles[at],
        upper=float(girths[upper].max()),
        wrist=float(girths[at]),
        girths=girths[: at + 1],
    )


def _arm_section(
    x: FloatArray,
    triangles: IntArray,
    start: FloatArray,
    axis: FloatArray,
    s: float,
    tip: FloatArray,
) -> tuple[FloatArray, float] | None:
    """Middle and girth of an arm's section at s along its axis; None where it is no arm."""
    first = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
    first /= np.linalg.norm(first)
    frame = np.stack([first, np.cross(axis, first), axis])
    near = np.linalg.norm(x - tip, axis=1) < 1.6 * np.linalg.norm(tip - start)
    kept = triangles[near[triangles].all(axis=1)]
    loops = loops_at((x - start) @ frame.T, kept, s, 2)
    best = None
    for points, middle in zip(loops.points, loops.middle, strict=True):
        apart = float(np.linalg.norm(middle))
        if len(points) > 5 and (best is None or apart < best[0]):
            best = apart, points, middle
    if best is None:
        return None
    _, points, middle = best
    return start + s * axis + middle @ frame[:2], girth_of(points)


def from_shoulder(arm: Arm, out: float, mid: float, top: float) -> Arm:
    """An arm whose length counts from the shoulder point, straight above the armpit."""
    side = np.sign(arm.direction[1])
    axis_y = max(abs(float(arm.direction[1])), 0.2)
    s = (out - side * (arm.shoulder[1] - mid)) / axis_y
    start = arm.shoulder + s * arm.direction
    point = np.array([start[0], mid + side * out, top])
    length = np.linalg.norm(arm.elbow - point) + np.linalg.norm(arm.wrist_place - arm.elbow)
    return replace(arm, shoulder=start, length=float(length))
