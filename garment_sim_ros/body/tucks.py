"""Thighs out of the trunk: what one body does in a tuck, softer ones do inside themselves.

Where a thigh is pressed into the belly by more than flesh gives, no cloth fits between the two,
and what is there has nowhere to go. The body is then bent back, about the line between the hip
joints: the hips with all above them, until the middle of no thigh is in them; then the trunk, at
its lowest joint above the hips, until no thigh is deeper in it than flesh gives; then the hips
again, where that is not enough. Legs and feet stay where they are. The bends depend on the pose
alone: they come and go as the thighs do.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.anatomy import SIDES
from garment_sim_ros.body.arm_pushes import Trunk, find_gaps
from garment_sim_ros.body.arms import (
    LEAST_SKIN,
    NORMALS_BY_AXIS,
    part_of,
    skin_of_bones,
    thickness,
)
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.skin import Body

_TRUNK = ("spine", "chest", "upperChest")
_GIVES = 0.35
"""Depth of a thigh in the trunk up to which cloth is at rest between them, as a share of its
thickness: 3 cm of a slim one."""
_ALONG_THIGH = np.array([0.5, 0.6, 0.7, 0.85, 1.0])
"""Where its spheres are, from hip to knee: nearer to the hip it is in the trunk in any pose."""
_NEAR_HIP = {0.3: 0.1, 0.4: 0.3, 0.5: 1.0 - _GIVES}
"""How much of the thigh's thickness stays out of the hips, at places from hip to knee."""
_SLICE = 0.1
"""Half the length of the thigh that one sphere stands for, as a share of it."""
_ASIDE = 15.0
"""Room that a thigh has beside the body, in radii of its largest sphere; none where it is turned
up by 30 degrees and more."""
_ANGLES = np.radians(np.arange(0.0, 31.0, 3.0))
_MOST = np.radians(60.0)
"""As far as all bends go together: a body that has more to clear would lean backwards."""


class Tucks:
    """Keeps the thighs of one body out of its hips and trunk.

    Args:
        body: Rig and skin; without a trunk or thighs that have skin nothing is done.

    Attributes:
        bend: By how much it was bent back last, at the hips and in the trunk together [rad].
    """

    def __init__(self, body: Body) -> None:
        self.bend = 0.0
        self._bends: list[_Bend] = []
        T = rest_transforms(body.rig)
        skins = skin_of_bones(body)
        legs = [f"{side}{name}" for side in SIDES for name in ("UpperLeg", "LowerLeg")]
        trunk = [bone for bone in _TRUNK if len(skins.get(bone, ())) >= LEAST_SKIN]
        if not trunk or not all(bone in body.humanoid for bone in (*legs, "hips")):
            return
        thighs = [body.rig.index(body.humanoid[f"{side}UpperLeg"]) for side in SIDES]
        self._thighs = thighs
        spine, hips = (body.rig.index(body.humanoid[bone]) for bone in (trunk[0], "hips"))
        of_legs = body.rig.below(thighs[0]) | body.rig.below(thighs[1])
        above = body.rig.below(spine)
        spheres = [_spheres(body, T, side, skins) for side in SIDES]
        # Of a rig whose legs hang on its spine, all would be bent.
        if not sum(len(radius) for _, radius in spheres) or above[thighs].any():
            return
        lean = [(centre, (1.0 - _GIVES) * radius) for centre, radius in spheres]
        near = [_Near.of(body, T, skins, trunk, thighs, lean)]
        up = np.array([0.0, 0.0, 1.0])
        ways = hips, np.stack([np.cross(_axis(T, thighs), up), up]) @ T[hips, :3, :3]
        moved = (body.rig.below(hips) | above) & ~of_legs
        if len(skins.get("hips", ())) >= LEAST_SKIN:
            of_hips = [_middles(body, T, s, r) for s, (_, r) in zip(SIDES, spheres, strict=True)]
            in_hips = _Near.of(body, T, skins, ["hips"], thighs, of_hips)
            self._bends.append(_Bend([in_hips], thighs, ways, moved, thighs))
            near.append(in_hips)
        self._bends.append(_Bend(near[:1], thighs, ways, above, [spine]))
        self._bends.append(_Bend(near, thighs, ways, moved, thighs))
        for bend in self._bends:
            bend.clear(T.copy(), 0.0)  # compiled or loaded: not in the midst of a motion

    def clear(self, T_world_joint: FloatArray, lies: float = 0.0) -> None:
        """Bend the body back off thighs that are deep in it.

        Args:
            T_world_joint: Poses of the joints, changed in place, shape [n, 4, 4].
            lies: How much its trunk lies on the ground, from 0 to 1: the legs go, then.
        """
        self.bend = 0.0
        # The last one looks at all that the others do.
        if not self._bends or self._bends[-1].is_clear(T_world_joint):
            return
        for bend in self._bends:
            self.bend += bend.clear(T_world_joint, _MOST - self.bend)
        if lies > 0.0:
            axis = _axis(T_world_joint, self._thighs)
            everywhere = np.ones(len(T_world_joint), np.bool_)
            _turn(T_world_joint, everywhere, self._thighs, lies * self.bend * axis)


class _Near(NamedTuple):
    """What of the thighs is kept out of some bones.

    Attributes:
        joint: Joints of the bones, shape [p].
        support: How far their skin goes in directions, see `body.arm_pushes`, shape [p, d].
        thigh: The thigh that each sphere is of, shape [m].
        centre: Centres of the spheres in its frame [m], shape [m, 3].
        radius: Their radii [m], shape [m].
    """

    joint: IntArray
    support: FloatArray
    thigh: IntArray
    centre: FloatArray
    radius: FloatArray

    @classmethod
    def of(
        cls,
        body: Body,
        T: FloatArray,
        skins: Mapping[str, FloatArray],
        bones: Sequence[str],
        thighs: Sequence[int],
        spheres: Sequence[tuple[FloatArray, FloatArray]],
    ) -> "_Near":
        """Of bones with skin [m], and of spheres of each thigh, in the pose T of the joints."""
        parts = [part_of(body, T, bone, skins[bone]) for bone in bones]
        return cls(
            joint=np.array([part.joint for part in parts], np.int32),
            support=np.array([part.support for part in parts]),
            thigh=np.repeat(thighs, [len(radius) for _, radius in spheres]).astype(np.int32),
            centre=np.concatenate([centre for centre, _ in spheres]),
            radius=np.concatenate([radius for _, radius in spheres]),
        )


class _Bend:
    """One place at which a body bends back.

    Args:
        near: What of the thighs is kept out of what it moves.
        thighs: The joints of both thighs, the left one first.
        ways: The hips' joint, and the ways ahead and up in its frame, shape [2, 3].
        moved: Which joints it moves, shape [n].
        pivot: Joints between which it bends.
    """

    def __init__(
        self,
        near: Sequence[_Near],
        thighs: Sequence[int],
        ways: tuple[int, FloatArray],
        moved: NDArray[np.bool_],
        pivot: Sequence[int],
    ) -> None:
        self._near, self._thighs, self._pivot = tuple(near), list(thighs), list(pivot)
        self._hips, self._ways = ways
        self._moved = np.flatnonzero(moved)

    def clear(self, T: FloatArray, most: float) -> float:
        """Bends back as far as it has to; by how much [rad].

        Args:
            T: Poses of the joints, changed in place, shape [n, 4, 4].
            most: How far it may [rad].
        """
        if self.is_clear(T):
            return 0.0
        axis = _axis(T, self._thighs)
        turns = Rotation.from_rotvec(_ANGLES[:, None] * axis).as_matrix()
        least = self._gaps(T, turns)
        clear = np.flatnonzero(least[1:] >= 0.0)
        if clear.size:
            k = int(clear[0]) + 1
            share = -least[k - 1] / (least[k] - least[k - 1])
            bend = float(_ANGLES[k - 1] + share * (_ANGLES[k] - _ANGLES[k - 1]))
        else:
            bend = float(_ANGLES[-1])
        bend = min(bend, most)
        _turn(T, self._moved, self._pivot, -bend * axis)
        return bend

    def is_clear(self, T: FloatArray) -> bool:
        """Whether there is nothing to do with the joints in poses T, shape [n, 4, 4]."""
        return bool(self._gaps(T, np.eye(3)[None])[0] >= 0.0)

    def _gaps(self, T: FloatArray, turns: FloatArray) -> FloatArray:
        """Least distance of the thighs from what bends back [m], shape [a].

        Args:
            T: Poses of the joints, shape [n, 4, 4].
            turns: Rotations of the thighs instead, the other way, shape [a, 3, 3].
        """
        pivot = T[self._pivot, :3, 3].mean(axis=0)
        R = np.swapaxes(turns, 1, 2)
        ways = self._ways @ T[self._hips, :3, :3].T
        least = np.full(len(turns), np.inf)
        for near in self._near:
            P = T[near.thigh]
            centre = np.einsum("mij,mj->mi", P[:, :3, :3], near.centre) + P[:, :3, 3] - pivot
            turned = np.ascontiguousarray(centre @ R)
            gaps = np.empty((len(near.support), *turned.shape[:2]))
            trunk = Trunk(T[near.joint], NORMALS_BY_AXIS, near.support)
            find_gaps(trunk, turned, pivot, near.radius, gaps)
            # Beside the body it bends past the thigh; behind it, as in a split, into it.
            ahead, up = ways @ _unit(centre + pivot - P[:, :3, 3]).T
            room = np.clip(1.0 - 2.0 * (ahead + np.maximum(up, 0.0)), 0.0, None)
            gaps += _ASIDE * near.radius.max(initial=0.0) * room
            least = np.minimum(least, gaps.min(axis=(0, 2)))
        return np.asarray(least)


def _turn(T: FloatArray, moved: NDArray[Any], pivot: Sequence[int], rotation: FloatArray) -> None:
    """Turn joints by a rotation vector [rad] about the middle of some."""
    R = Rotation.from_rotvec(rotation).as_matrix()
    middle = T[pivot, :3, 3].mean(axis=0)
    turned = T[moved]
    turned[:, :3, 3] = (turned[:, :3, 3] - middle) @ R.T + middle
    turned[:, :3, :3] = R @ turned[:, :3, :3]
    T[moved] = turned


def _axis(T: FloatArray, thighs: Sequence[int]) -> FloatArray:
    """Unit vector from the right hip joint to the left one: to bend forward is positive."""
    left, right = thighs
    return _unit(T[left, :3, 3] - T[right, :3, 3])


def _unit(v: FloatArray) -> FloatArray:
    """Vectors [..., 3] of length 1."""
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9))


def _spheres(
    body: Body, T: FloatArray, side: str, skins: dict[str, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """A thigh: centres of its spheres in the frame of its joint [m], their radii [m]."""
    hip, knee = (body.rig.index(body.humanoid[f"{side}{b}"]) for b in ("UpperLeg", "LowerLeg"))
    start, end = T[hip, :3, 3], T[knee, :3, 3]
    skin = skins.get(f"{side}UpperLeg", np.zeros((0, 3)))
    along = end - start
    share = (skin - start) @ along / max(float(along @ along), 1e-12)
    centre, radius = np.zeros((0, 3)), np.zeros(0)
    for s in _ALONG_THIGH:
        near = skin[np.abs(share - s) < _SLICE]
        if len(near) >= LEAST_SKIN:
            middle = near.mean(axis=0)
            centre = np.vstack([centre, (middle - start) @ T[hip, :3, :3]])
            radius = np.append(radius, thickness(near, middle, middle + along))
    return centre, radius


def _middles(
    body: Body, T: FloatArray, side: str, radius: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What of a thigh is kept out of the hips: spheres between hip and knee, as `_spheres`.

    Args:
        body: Rig and skin.
        T: Poses of its joints at rest, shape [n, 4, 4].
        side: The thigh's.
        radius: Radii of the spheres that are kept out of the trunk [m].
    """
    hip, knee = (body.rig.index(body.humanoid[f"{side}{b}"]) for b in ("UpperLeg", "LowerLeg"))
    along = (T[knee, :3, 3] - T[hip, :3, 3]) @ T[hip, :3, :3]
    share = np.array(list(_NEAR_HIP.items())) if len(radius) else np.zeros((0, 2))
    return share[:, :1] * along, share[:, 1] * radius[:1]
