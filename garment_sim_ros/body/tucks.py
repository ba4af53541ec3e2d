"""Thighs out of the trunk: what one body does in a tuck, softer ones do inside themselves.

Where a thigh is pressed into the belly by more than flesh gives, no cloth fits between the two,
and what is there has nowhere to go. The trunk is then bent back, at its lowest joint above the
hips and about the line between the hip joints, until no thigh is deeper in it than `_DEEP`. Legs
and feet stay where they are. The bend depends on the pose alone: it comes and goes as the thighs
do.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray
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
from garment_sim_ros.constants import PERSON_HEIGHT

_TRUNK = ("spine", "chest", "upperChest")
_DEEP = 0.025
"""Depth of a thigh in the trunk up to which cloth is at rest between them [m]."""
_ALONG_THIGH = np.array([0.5, 0.6, 0.7, 0.85, 1.0])
"""Where its spheres are, from hip to knee: nearer to the hip it is in the trunk in any pose."""
_SLICE = 0.1
"""Half the length of the thigh that one sphere stands for, as a share of it."""
_ANGLES = np.radians(np.arange(0.0, 31.0, 3.0))


class Tucks:
    """Keeps the thighs of one body out of its trunk.

    Args:
        body: Rig and skin; without a trunk or thighs that have skin nothing is done.

    Attributes:
        bend: By how much the trunk was bent back last [rad].
    """

    def __init__(self, body: Body) -> None:
        self.bend = 0.0
        T = rest_transforms(body.rig)
        self._deep = _DEEP * max(float(np.ptp(body.skin.vertices[:, 2])), 1e-6) / PERSON_HEIGHT
        skins = skin_of_bones(body)
        trunk = [bone for bone in _TRUNK if len(skins.get(bone, ())) >= LEAST_SKIN]
        legs = [f"{side}{name}" for side in SIDES for name in ("UpperLeg", "LowerLeg")]
        self._works = bool(trunk) and all(bone in body.humanoid for bone in legs)
        if not self._works:
            return
        parts = [part_of(body, T, bone, skins[bone]) for bone in trunk]
        self._joint_of_part = np.array([part.joint for part in parts], np.int32)
        self._support = np.array([part.support for part in parts])
        pivot = body.rig.index(body.humanoid[trunk[0]])
        self._pivot, self._above = pivot, np.flatnonzero(body.rig.below(pivot))
        spheres = [_spheres(body, T, side, skins) for side in SIDES]
        self._hips = [joint for joint, _, _ in spheres]
        self._mover = np.repeat(self._hips, [len(radius) for _, _, radius in spheres])
        self._centre = np.concatenate([centre for _, centre, _ in spheres])
        self._radius = np.concatenate([radius for _, _, radius in spheres])
        # Of a rig whose legs hang on its spine, all would be bent.
        self._works = len(self._radius) > 0 and not np.isin(self._hips, self._above).any()
        if self._works:
            self._gaps(T, _ANGLES[:1])  # compiled or loaded: not in the midst of a motion

    def clear(self, T_world_joint: FloatArray) -> None:
        """Bend the trunk back off thighs that are deep in it.

        Args:
            T_world_joint: Poses of the joints, changed in place, shape [n, 4, 4].
        """
        self.bend = 0.0
        if not self._works or self._gaps(T_world_joint, _ANGLES[:1])[0] >= -self._deep:
            return
        least = self._gaps(T_world_joint, _ANGLES)
        clear = np.flatnonzero(least[1:] >= -self._deep)
        if clear.size:
            k = int(clear[0]) + 1
            share = (-self._deep - least[k - 1]) / (least[k] - least[k - 1])
            self.bend = float(_ANGLES[k - 1] + share * (_ANGLES[k] - _ANGLES[k - 1]))
        else:
            self.bend = float(_ANGLES[-1])
        R = Rotation.from_rotvec(-self.bend * self._axis(T_world_joint)).as_matrix()
        pivot = T_world_joint[self._pivot, :3, 3].copy()
        above = T_world_joint[self._above]
        above[:, :3, 3] = (above[:, :3, 3] - pivot) @ R.T + pivot
        above[:, :3, :3] = R @ above[:, :3, :3]
        T_world_joint[self._above] = above

    def _axis(self, T: FloatArray) -> FloatArray:
        """Unit vector from the right hip joint to the left one: to bend forward is positive."""
        left, right = self._hips
        axis = T[left, :3, 3] - T[right, :3, 3]
        return np.asarray(axis / max(float(np.linalg.norm(axis)), 1e-9))

    def _gaps(self, T: FloatArray, angles: FloatArray) -> FloatArray:
        """Least distance of the thighs from the trunk, bent back by angles [rad], [m], shape [a].

        The thighs are turned instead, the other way.
        """
        P = T[self._mover]
        pivot = T[self._pivot, :3, 3].copy()
        centre = np.einsum("mij,mj->mi", P[:, :3, :3], self._centre) + P[:, :3, 3] - pivot
        R = Rotation.from_rotvec(angles[:, None] * self._axis(T)).as_matrix()
        turned = np.ascontiguousarray(centre @ np.swapaxes(R, 1, 2))
        gaps = np.empty((len(self._support), *turned.shape[:2]))
        trunk = Trunk(T[self._joint_of_part], NORMALS_BY_AXIS, self._support)
        find_gaps(trunk, turned, pivot, self._radius, gaps)
        return np.asarray(gaps.min(axis=(0, 2)))


def _spheres(
    body: Body, T: FloatArray, side: str, skins: dict[str, FloatArray]
) -> tuple[int, FloatArray, FloatArray]:
    """A thigh: its joint, centres of its spheres in that joint's frame [m], their radii [m]."""
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
    return hip, centre, radius
