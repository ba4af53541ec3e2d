"""The body's surface, bound to a rig."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.errors import GeometryError


@dataclass(frozen=True, kw_only=True)
class Skin:
    """A triangle mesh with bone weights, in bind pose, z up, x forward, metres.

    Attributes:
        vertices: Bind-pose positions in the rig's root frame [m], shape [v, 3].
        triangles: Vertex indices, counter-clockwise seen from outside, shape [t, 3].
        bone: Joint index of each influence, shape [v, k]; unused influences are 0 with weight 0.
        weight: Weight of each influence, rows sum to 1, shape [v, k].
        T_bone_bind: Inverse bind matrix of each joint: bind-pose root frame to joint frame,
            shape [n, 4, 4].
    """

    vertices: FloatArray
    triangles: IntArray
    bone: IntArray
    weight: FloatArray
    T_bone_bind: FloatArray

    def __post_init__(self) -> None:
        arrays: dict[str, NDArray[Any]] = {
            "vertices": np.ascontiguousarray(self.vertices, dtype=np.float64),
            "triangles": np.ascontiguousarray(self.triangles, dtype=np.int32),
            "bone": np.ascontiguousarray(self.bone, dtype=np.int32),
            "weight": np.ascontiguousarray(self.weight, dtype=np.float64),
            "T_bone_bind": np.ascontiguousarray(self.T_bone_bind, dtype=np.float64),
        }
        v = len(arrays["vertices"])
        if arrays["vertices"].shape != (v, 3) or not np.isfinite(arrays["vertices"]).all():
            raise GeometryError("skin vertices must be finite, shape [v, 3]")
        if arrays["bone"].shape != arrays["weight"].shape or len(arrays["bone"]) != v:
            raise GeometryError(f"bone and weight must both have shape [{v}, k]")
        if not np.allclose(arrays["weight"].sum(axis=1), 1.0, atol=1e-6):
            raise GeometryError("skin weights must sum to 1 for every vertex")
        triangles = arrays["triangles"]
        if triangles.size and (triangles.min() < 0 or triangles.max() >= v):
            raise GeometryError(f"triangle indices must lie in 0..{v - 1}")
        for name, array in arrays.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rig with its skin: what colliders are fitted to and garments are made for.

    Attributes:
        name: Short name for logs and files.
        rig: The skeleton in rest pose.
        skin: The surface in bind pose (normally equal to the rest pose).
        humanoid: Joint name of each humanoid bone that the rig has (keys: `HUMANOID_BONES`).
        notes: What a loader assumed or repaired, one sentence each.
        skinning: How the skin follows the bones, one of `skinning.METHODS`.
    """

    name: str
    rig: Rig
    skin: Skin
    humanoid: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    skinning: str = "linear"


_SIDED = ("Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "Toes")
HUMANOID_BONES: tuple[str, ...] = (
    *("hips", "spine", "chest", "upperChest", "neck", "head"),
    *(f"left{part}" for part in _SIDED),
    *(f"right{part}" for part in _SIDED),
)
"""Humanoid bone names of the VRM 1.0 specification, without fingers and face."""
