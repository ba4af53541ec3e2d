"""Feet that stand in the source stand on the ground, in one place.

Two bodies of other proportions cannot have the same angles and the same places of their feet. So
while a foot of the source stands (it is as low as feet stand and hardly moves) the target's foot
goes where the source's is, to scale, with its sole on the ground: the root goes down or up, and
the legs bend (two bones each, in the plane of the knee). What is not to be seen is when: weights
fade in and out within a tenth of a second. Then the part of the sole that bears is held in its
place, even where the source's slides; what the foot is off its way by that fades once it is
lifted.

It works sample by sample, from past and present only, at any rate, and the past fades: a motion
looks the same wherever one begins to watch it, but for the first steps.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.anatomy import SIDES, leg_length
from garment_sim_ros.body.feet_lock import hold, touch
from garment_sim_ros.body.feet_pass import Soles, ground, missed, watch
from garment_sim_ros.body.knees import open_knees
from garment_sim_ros.body.leg_reach import FOOT, SHANK, THIGH, Legs
from garment_sim_ros.body.skeleton import Skeleton
from garment_sim_ros.body.skin import Body

PAST = 0.4
"""After a gap as long as this, what was before no longer counts [s]."""

_FADING = 0.04
"""Time in which the past fades to a third [s]."""
_LIMITS = (0.03, 0.09, 0.25, 0.9, 0.15)
"""Heights, speeds and depth of `feet_pass.watch`, in leg lengths (and per second)."""
_TOUCHING = (0.045, 0.35, 0.08, 0.5, 0.15)
"""Heights, speeds and depth of `feet_lock.touch`, likewise."""
_LEG = ("UpperLeg", "LowerLeg", "Foot")
_DOWNWARD = 0.2
"""Directions that reach no higher look for points of the sole."""
_ROLLS = 0.3
"""How much a foot that stands on its ball alone leads the root."""
_POINTING = 0.06
"""Time in which a foot that is lifted points no longer, to a third [s]: toes do not snap up."""
_BALL = 0.7
"""Where the ball of a foot is between ankle and toes, where no joint tells."""


class Feet:
    """Grounds the feet of a posed body; remembers where they were put down.

    Attributes:
        legs: `leg_reach.Legs`.
        soles: `feet_pass.Soles`.
        stands: How much each foot stood last, was kept out of the ground, led the root, and
            pointed, 0 to 1, shape [f, 4].
        slipped: How often a foot that touches the ground was let slip, by feet and poses.

    Args:
        source: Source skeleton in its reference pose.
        rest: The body's skeleton at rest.
        body: The body.
        scale: Target length per source length.
        ankle_height: World height of the source's ankle in a foot that stands [m].
        end_sites: Joint name to where its bone ends, in the joint's frame [m], of the source.
    """

    def __init__(
        self,
        source: Skeleton,
        rest: Skeleton,
        body: Body,
        *,
        scale: float,
        ankle_height: float,
        end_sites: Mapping[str, FloatArray],
    ) -> None:
        whole = [
            side
            for side in SIDES
            if all(side + part in rest.bones for part in _LEG)
            and side + "Foot" in source.bones
            and {f"{side}Foot", f"{side}UpperLeg"} <= rest.frames.keys()
            and f"{side}Foot" in source.frames
        ]
        n, f = len(body.rig), len(whole)
        self._scale = scale
        self.legs = Legs(
            joints=np.zeros((f, 3), np.int32),
            part=np.full((f, n), -1, np.int8),
            hinge=np.zeros((f, 3)),
            ahead=np.zeros((f, 3)),
            reach=np.zeros(f),
        )
        self._joint = np.full((f, 2), -1, np.int32)
        self._offset, self._target_offset = np.zeros((2, f, 2, 3))
        self._standing, self._faded, self._weight, self._depth, self._place = np.zeros((5, f, 2))
        self._stretch = np.zeros((f, 2))
        self._before = np.zeros((f, 2, 3))
        self.stands = np.zeros((f, 4))
        self._limits = np.array([*_LIMITS, 0.0]) * (leg_length(source.marks) or 1.0)
        self._limits[5] = _FADING
        self._touch_limits = np.array(_TOUCHING) * (leg_length(source.marks) or 1.0)
        self._touching, self._off = np.zeros((2, f, 2))
        self._last = np.zeros((f, 2, 3))
        self._lock = np.zeros(f)
        self.slipped = 0
        self._time: float | None = None
        joints: list[int] = []
        offsets: list[FloatArray] = []
        starts = [0]
        for i, side in enumerate(whole):
            self._measure_leg(i, side, rest, body)
            self._measure_foot(i, side, source, rest, ankle_height, end_sites)
            joint, offset = _sole(body, rest, self.legs.part[i] == FOOT, self.legs.joints[i, 2])
            joints += joint
            offsets += offset
            starts.append(len(joints))
        self.soles = Soles(
            np.array(joints, np.int32),
            np.array(offsets, np.float64).reshape(-1, 3),
            np.array(starts, np.int32),
        )
        self._sole_last = np.zeros((len(joints), 2))

    def forget(self) -> None:
        """Begin anew: what comes next has no past."""
        self._time = None

    def ground(self, T_source: FloatArray, T_world_joint: FloatArray, time: float) -> None:
        """Ground the feet of one pose.

        Args:
            T_source: The source's joints, shape [m, 4, 4].
            T_world_joint: The body's joints, changed in place, shape [n, 4, 4].
            time: Time of the pose [s]; earlier than the last one, or much later, begins anew.
        """
        if not len(self.legs.joints):
            return
        dt = -1.0
        if self._time is not None and 0.0 <= time - self._time < PAST:
            dt = time - self._time
        self._time = time
        watch(
            T_source, self._joint.ravel(), self._offset.reshape(-1, 3), self._standing.ravel(),
            dt, self._limits, self._before.reshape(-1, 3), self._faded.reshape(-1),
            self._weight.reshape(-1), self._depth.reshape(-1),
        )  # fmt: skip
        missed(
            T_source, T_world_joint, self._joint, self._offset, self.legs.joints[:, 2],
            self._target_offset, self.legs.ahead, self._stretch, self._scale, self._weight,
            self._place,
        )  # fmt: skip
        touch(
            T_source, self._joint, self._offset, self._standing, dt, self._touch_limits,
            self._last, self._touching,
        )  # fmt: skip
        if dt < 0.0:
            self._off[:] = 0.0
        self._place += self._off
        self.stands[:, 0] = 1.0 - (1.0 - self._weight[:, 0]) * (1.0 - self._weight[:, 1])
        self.stands[:, 1] = self._depth[:, 0]
        # A foot that rolls off would pull the body down after its heel.
        self.stands[:, 2] = 1.0 - (1.0 - self._weight[:, 0]) * (1.0 - _ROLLS * self._weight[:, 1])
        fade = 1.0 if dt < 0.0 else 1.0 - np.exp(-dt / _POINTING)
        self.stands[:, 3] += fade * (self.stands[:, 0] - self.stands[:, 3])
        ground(T_world_joint, self.legs, self.soles, self.stands, self._place)
        self.slipped += hold(
            T_world_joint, self.legs, self.soles, self._touching, dt,
            self._sole_last, self._lock, self._off,
        )  # fmt: skip

    def open_knees(self, T_world_joint: FloatArray) -> None:
        """Open knees of the pose that was grounded last, see `body.knees`.

        Args:
            T_world_joint: The body's joints, changed in place, shape [n, 4, 4].
        """
        if len(self.legs.joints):
            open_knees(T_world_joint, self.legs, self.soles, self.stands[:, 0])

    def _measure_leg(self, i: int, side: str, rest: Skeleton, body: Body) -> None:
        """Joints, lengths and knee of one of the body's legs."""
        upper, lower, foot = (rest.bones[side + part] for part in _LEG)
        self.legs.joints[i] = upper, lower, foot
        for j, parent in enumerate(body.rig.parent):
            above = self.legs.part[i, parent] if parent >= 0 else -1
            self.legs.part[i, j] = {upper: THIGH, lower: SHANK, foot: FOOT}.get(j, above)
        hip, knee, ankle = rest.T_world_joint[self.legs.joints[i], :3, 3]
        self.legs.reach[i] = np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee)
        # Across the thigh, to the left: knees bend backwards about it.
        self.legs.hinge[i] = rest.rotation(upper).T @ rest.frames[f"{side}UpperLeg"][:, 1]

    def _measure_foot(
        self,
        i: int,
        side: str,
        source: Skeleton,
        rest: Skeleton,
        ankle_height: float,
        end_sites: Mapping[str, FloatArray],
    ) -> None:
        """Ankle and ball of both feet, and where they are when the foot stands flat."""
        ankle = source.bones[f"{side}Foot"]
        # From a foot's frame (forward, left, up as it stands flat) to its joint's.
        R_s = source.rotation(ankle).T @ source.frames[f"{side}Foot"]
        R_t = rest.rotation(int(self.legs.joints[i, 2])).T @ rest.frames[f"{side}Foot"]
        self.legs.ahead[i] = R_t[:, 0]
        self._joint[i, 0] = ankle
        self._standing[i, 0] = ankle_height
        ball = source.bones.get(f"{side}Toes")
        end = end_sites.get(source.rig.joint_names[ankle])
        if ball is not None:
            T = source.T_world_joint
            along = T[ankle, :3, :3].T @ (T[ball, :3, 3] - T[ankle, :3, 3])
            self._joint[i, 1] = ball
        elif end is not None:
            along = _BALL * end
            self._joint[i, 1] = ankle
            self._offset[i, 1] = along
        else:
            return
        flat = R_s.T @ along
        self._standing[i, 1] = ankle_height + flat[2]
        toes = rest.marks.joint.get(f"{side}Toes")
        if toes is None:
            self._target_offset[i, 1] = R_t @ flat * self._scale
            return
        foot = rest.marks.joint[f"{side}Foot"]
        own = rest.rotation(int(self.legs.joints[i, 2])).T @ (toes - foot)
        self._target_offset[i, 1] = own
        self._stretch[i] = (R_t.T @ own - self._scale * flat)[:2]


def _sole(
    body: Body, rest: Skeleton, of_foot: NDArray[np.bool_], ankle: int
) -> tuple[list[int], list[FloatArray]]:
    """Points of a foot's skin that may be its lowest: joints that move them, places in these."""
    skin = body.skin
    main = skin.bone[np.arange(len(skin.bone)), np.argmax(skin.weight, axis=1)]
    mine = np.flatnonzero(of_foot[main])
    if not len(mine):  # no feet: the leg's end stands
        below = rest.T_world_joint[ankle, :3, 3].copy()
        if len(skin.vertices):
            below[2] = skin.vertices[:, 2].min()
        R = rest.rotation(ankle)
        return [ankle], [R.T @ (below - rest.T_world_joint[ankle, :3, 3])]
    k = np.arange(200) + 0.5  # a Fibonacci spiral
    z = 1.0 - 2.0 * k / 200
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    level = np.sqrt(1.0 - z * z)
    directions = np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=1)
    directions = directions[z < _DOWNWARD]
    found = np.unique(mine[np.argmax(skin.vertices[mine] @ directions.T, axis=0)])
    joints = main[found]
    T = skin.T_bone_bind[joints]
    offsets = np.einsum("pij,pj->pi", T[:, :3, :3], skin.vertices[found]) + T[:, :3, 3]
    return [int(j) for j in joints], list(offsets)
