"""A skeleton in the pose in which it is compared with another one."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.anatomy import (
    Landmarks,
    SourceReference,
    anatomical_frames,
    find_landmarks,
)
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.errors import GeometryError

_SAME_PLACE = 0.01
"""Difference of joints that are in one place, as a share of the skeleton's size."""


@dataclass(frozen=True, kw_only=True)
class Skeleton:
    """One of the two skeletons in the pose that is compared.

    Attributes:
        rig: Its rig.
        bones: Humanoid bone to joint index.
        T_world_joint: Pose, z up, shape [n, 4, 4].
        marks: Its landmarks.
        frames: Its anatomical frames.
        at_rest: Whether the pose is the rig's own, not a captured one.
    """

    rig: Rig
    bones: dict[str, int]
    T_world_joint: FloatArray
    marks: Landmarks
    frames: dict[str, FloatArray]
    at_rest: bool

    @classmethod
    def compare(
        cls,
        name: str,
        rig: Rig,
        mapping: Mapping[str, str],
        T_world_joint: FloatArray,
        reference: SourceReference,
    ) -> "Skeleton":
        """Measure a posed skeleton; `reference.values` being empty says that it is at rest."""
        if "hips" not in mapping:
            raise GeometryError(
                f"{name}: no joint is known to be the hips; allowed: a YAML file of bone names "
                "that maps hips to a joint"
            )
        marks = find_landmarks(rig, mapping, T_world_joint, reference)
        at_rest = not reference.values
        frames = anatomical_frames(marks, designed=at_rest)
        if not frames:
            raise GeometryError(
                f"{name}: neither both hip joints nor both shoulders are known; allowed: a YAML "
                "file of bone names that maps the upper legs or the upper arms to joints"
            )
        bones = {bone: rig.joint_names.index(joint) for bone, joint in mapping.items()}
        return cls(
            rig=rig,
            bones=bones,
            T_world_joint=T_world_joint,
            marks=marks,
            frames=frames,
            at_rest=at_rest,
        )

    def is_posed_as(self, other: "Skeleton") -> bool:
        """Whether both are one skeleton in one rest pose: the same bones in the same places."""
        if not (self.at_rest and other.at_rest) or self.bones.keys() != other.bones.keys():
            return False
        mine, its = list(self.bones.values()), [other.bones[bone] for bone in self.bones]
        x, y = self.T_world_joint[mine, :3, 3], other.T_world_joint[its, :3, 3]
        x, y = x - x.mean(axis=0), y - y.mean(axis=0)
        return bool(np.abs(x - y).max() <= _SAME_PLACE * np.abs(y).max())

    def rotation(self, joint: int) -> FloatArray:
        """World rotation of a joint in the compared pose."""
        return self.T_world_joint[joint, :3, :3]
