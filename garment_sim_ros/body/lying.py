"""Bodies that lie, sit or kneel do so on the ground, not in it and not over it.

Trunk, head, thighs, knees and upper arms are parts that may lie on the ground. How low they are in
the source is told by the height of its joints, to scale, and the skin that the body has under its
own. Where a part is nearly as low as one that lies, the body's lowest skin goes to the height of
the source's, and to the ground where that lies on it; and what is under the ground is lifted out
of it. Feet that stand stay where they are, and legs bend for it, but where their knees are in the
ground; other feet go along, but not into the ground.

It depends on the pose alone: it comes and goes as the body does.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.anatomy import SIDES, TRUNK, leg_length
from garment_sim_ros.body.arms import NORMALS_BY_AXIS, skin_of_bones
from garment_sim_ros.body.feet import Feet
from garment_sim_ros.body.feet_pass import lowest, smooth_step
from garment_sim_ros.body.leg_reach import bend_leg
from garment_sim_ros.body.skeleton import Skeleton
from garment_sim_ros.body.skin import Body
from garment_sim_ros.jit import kernel

_LIMITS = (0.02, 0.08, 0.15, 0.25, 0.18)
"""Heights of skin over the ground up to which a part lies on it, and from which it does not; depth
of a joint from which it is somewhere else; how far skin under a joint counts: heads may be long;
height from which a part is not near the ground, where no foot stands: who crouches stands. In leg
lengths."""
_UPPER = {*TRUNK, "neck"}
_HIP, _KNEE = 0.4, (0.75, 0.5)
"""Where the part of a hip ends on its thigh, and where that of a knee begins there and ends on its
shank, in their lengths."""


class Parts(NamedTuple):
    """Parts of a body that may lie on the ground, m of them.

    Attributes:
        joint: Joint of each of the points of skin that may be the lowest of their part, shape [p].
        offset: These points in their joints' frames [m], shape [p, 3].
        start: First point of each part, and the end, shape [m + 1].
        target: Joints of the body whose mean height is compared, shape [m, 2].
        source: Those of the source, shape [m, 2].
        upper: Whether each is of the upper trunk or the head, shape [m].
        knee: Whether each is of a knee: it may kneel while the other foot stands, shape [m].
    """

    joint: IntArray
    offset: FloatArray
    start: IntArray
    target: IntArray
    source: IntArray
    upper: NDArray[np.bool_]
    knee: NDArray[np.bool_]


@kernel(inner=True)
def _joint(T_source, parts, part, scale):
    """Height of the source's joints of a part, to scale [m]."""
    a, b = parts.source[part]
    return scale * 0.5 * (T_source[a, 2, 3] + T_source[b, 2, 3])


@kernel(inner=True)
def _there(T_source, parts, part, scale, limits):
    """How much the source's part is not far below the ground, 0 to 1."""
    depth = -_joint(T_source, parts, part, scale)
    return 1.0 - smooth_step(0.5 * limits[2], limits[2], depth)


@kernel(inner=True)
def _move(T, shift, legs, soles, stands):
    """Move a body up, but for feet that stand."""
    for j in range(T.shape[0]):
        T[j, 2, 3] += shift
    goal = np.empty(3)
    for i in range(legs.joints.shape[0]):
        points = slice(soles.start[i], soles.start[i + 1])
        under = max(0.0, -lowest(T, soles.joint[points], soles.offset[points]))
        for k in range(3):
            goal[k] = T[legs.joints[i, 2], k, 3]
        goal[2] += stands[i, 1] * (1.0 - stands[i, 0]) * under - stands[i, 0] * shift
        bend_leg(T, legs.joints[i], legs.part[i], legs.hinge[i], goal)


@kernel()
def look(T_source, T, parts, scale, limits, height):
    """How much a body lies on the ground, by its source, as its arms and legs are now.

    Args:
        T_source: Poses of the source's joints, shape [k, 4, 4].
        T: Poses of the body's, shape [n, 4, 4].
        parts: `Parts`.
        scale: Target length per source length.
        limits: Heights up to which a part lies and from which it does not, depth from which it is
            somewhere else, how far skin under a joint counts, and height from which a part is not
            near the ground where no foot stands [m], shape [5].
        height: Output, height of the source's lowest skin of each part [m], shape [m].

    Returns:
        How much one of the upper trunk or the head lies, 0 to 1.
    """
    upper = 0.0
    for r in range(parts.target.shape[0]):
        points = slice(parts.start[r], parts.start[r + 1])
        low = lowest(T, parts.joint[points], parts.offset[points])
        a, b = parts.target[r]
        flesh = min(0.5 * (T[a, 2, 3] + T[b, 2, 3]) - low, limits[3])
        height[r] = _joint(T_source, parts, r, scale) - flesh
        if parts.upper[r]:
            there = _there(T_source, parts, r, scale, limits)
            upper = max(upper, there * (1.0 - smooth_step(limits[0], limits[4], height[r])))
    return upper


@kernel()
def rest(T_source, T, parts, legs, soles, stands, scale, limits, height, turned):
    """Put a body's lowest skin on the ground where its source lies on it, and none into it.

    Args:
        T_source: Poses of the source's joints, shape [k, 4, 4].
        T: Poses of the body's, changed in place, shape [n, 4, 4].
        parts: `Parts`.
        legs: `body.leg_reach.Legs`, f of them.
        soles: `body.feet_pass.Soles`.
        stands: How much each foot stands, and is kept out of the ground, 0 to 1, shape [f, 2].
        scale: Target length per source length.
        limits: See `look`.
        height: Of the source's lowest skin of each part, by `look` [m], shape [m].
        turned: Whether legs were turned since, and may be in the ground.

    Returns:
        How far the body went up [m].
    """
    least, sunk = np.inf, 0.0
    for r in range(parts.target.shape[0]):
        points = slice(parts.start[r], parts.start[r + 1])
        low = lowest(T, parts.joint[points], parts.offset[points])
        least = min(least, low)
        sunk = max(sunk, -_there(T_source, parts, r, scale, limits) * low)
    shift = sunk
    free = stands.copy()
    for r in range(parts.target.shape[0]):
        for i in range(legs.joints.shape[0]):
            if sunk > 0.0 and parts.knee[r] and parts.target[r, 0] == legs.joints[i, 1]:
                points = slice(parts.start[r], parts.start[r + 1])
                low = lowest(T, parts.joint[points], parts.offset[points])
                free[i, 0] *= 1.0 - max(-low, 0.0) / max(sunk, -low)
    if sunk <= 0.0:
        standing = 0.0
        for i in range(stands.shape[0]):
            standing = max(standing, stands[i, 0])
        for r in range(parts.target.shape[0]):
            over = max(height[r], 0.0) * smooth_step(limits[0], limits[1], height[r])
            far = limits[4]
            if not parts.knee[r]:
                far += standing * (limits[1] - limits[4])
            near = 1.0 - smooth_step(limits[0], far, height[r])
            near *= _there(T_source, parts, r, scale, limits)
            shift = min(shift, near * min(over - least, 0.0))
    if shift != 0.0 or turned:
        _move(T, shift, legs, soles, free)
    return shift


class Lying:
    """Puts one body on the ground where its source lies, sits or kneels on it.

    Args:
        source: Source skeleton in its reference pose.
        rest: The body's skeleton at rest.
        body: The body; without skin nothing is done.
        scale: Target length per source length.

    Attributes:
        lies: How much its upper trunk or head lay on the ground last, 0 to 1.
        shift: How far the body went up [m].
    """

    def __init__(self, source: Skeleton, rest: Skeleton, body: Body, scale: float) -> None:
        self.lies = self.shift = 0.0
        self._scale = scale
        self._limits = np.array(_LIMITS) * (leg_length(rest.marks) or 1.0)
        skins = skin_of_bones(body)
        joints, offsets, starts, target, other, upper, knee = [], [], [0], [], [], [], []
        for bones, compared in _parts(source, rest):
            found = [
                (rest.bones[bone], _lowest_skin(rest, bone, skins[bone], shares))
                for bone, shares in bones.items()
                if bone in skins
            ]
            joints += [joint for joint, x in found for _ in x]
            offsets += [x for _, x in found]
            if len(joints) == starts[-1]:
                continue
            starts.append(len(joints))
            target.append([rest.bones[bone] for bone in compared])
            other.append([source.bones[bone] for bone in compared])
            upper.append("hips" not in bones and not _UPPER.isdisjoint(bones))
            knee.append("LowerLeg" in compared[0])
        self._parts = Parts(
            np.array(joints, np.int32),
            np.concatenate([np.zeros((0, 3)), *offsets]),
            np.array(starts, np.int32),
            np.array(target, np.int32).reshape(-1, 2),
            np.array(other, np.int32).reshape(-1, 2),
            np.array(upper, np.bool_),
            np.array(knee, np.bool_),
        )
        self._height = np.zeros(len(knee))

    def look(self, T_source: FloatArray, T_world_joint: FloatArray) -> None:
        """See how much a pose lies on the ground.

        Args:
            T_source: The source's joints, shape [m, 4, 4].
            T_world_joint: The body's joints, shape [n, 4, 4].
        """
        self.lies = look(
            T_source, T_world_joint, self._parts, self._scale, self._limits, self._height
        )

    def rest(self, T_source: FloatArray, T_world_joint: FloatArray, feet: Feet) -> None:
        """Put the pose that was looked at, and changed since, on the ground.

        Args:
            T_source: The source's joints, shape [m, 4, 4].
            T_world_joint: The body's joints, changed in place, shape [n, 4, 4].
            feet: The body's feet, which were grounded.
        """
        self.shift = rest(
            T_source, T_world_joint, self._parts, feet.legs, feet.soles, feet.stands[:, :2],
            self._scale, self._limits, self._height, self.lies > 0.0,
        )  # fmt: skip


def _parts(
    source: Skeleton, rest: Skeleton
) -> list[tuple[dict[str, tuple[float, float]], tuple[str, str]]]:
    """Bones of each part, from where to where, and two bones whose mean height is compared."""

    def both(*bones: str) -> bool:
        return all(bone in source.bones and bone in rest.bones for bone in bones)

    whole = -np.inf, np.inf
    legs, arms = ("leftUpperLeg", "rightUpperLeg"), ("leftUpperArm", "rightUpperArm")
    trunk = rest.marks.trunk()
    upper = (trunk[1:] or trunk) if both(*arms) else []
    lower = [bone for bone in trunk if bone not in upper]
    parts = [(dict.fromkeys(("hips", *lower), whole), legs if both(*legs) else ("hips", "hips"))]
    if upper:
        parts.append((dict.fromkeys(upper, whole), arms))
    top = "head" if both("head") else "neck"
    if both(top):
        parts.append((dict.fromkeys(("neck", "head"), whole), (top, top)))
    for side in SIDES:
        arm, leg, knee = (f"{side}{part}" for part in ("UpperArm", "UpperLeg", "LowerLeg"))
        if both(arm):
            parts.append(({arm: whole}, (arm, arm)))
        if both(leg):
            parts.append(({leg: (-np.inf, _HIP)}, (leg, leg)))
        if both(leg, knee) and f"{side}Foot" in rest.bones:
            at_knee = {leg: (_KNEE[0], np.inf), knee: (-np.inf, _KNEE[1])}
            parts.append((at_knee, (knee, knee)))
    return parts


def _lowest_skin(
    rest: Skeleton, bone: str, skin: FloatArray, shares: tuple[float, float]
) -> FloatArray:
    """Skin of a bone that may be its lowest, in its joint's frame [m].

    Args:
        rest: The body's skeleton at rest.
        bone: The bone.
        skin: Its skin [m].
        shares: From where to where along it, in its lengths.
    """
    T = rest.T_world_joint[rest.bones[bone]]
    x = (skin - T[:3, 3]) @ T[:3, :3]
    below = bone.replace("LowerLeg", "Foot").replace("UpperLeg", "LowerLeg")
    end = rest.marks.joint.get(below) if below != bone else None
    if end is not None:
        along = (end - T[:3, 3]) @ T[:3, :3]
        share = x @ along / max(float(along @ along), 1e-12)
        x = x[(share >= shares[0]) & (share < shares[1])]
    return x[np.unique(np.argmax(x @ NORMALS_BY_AXIS, axis=0))] if len(x) else x
