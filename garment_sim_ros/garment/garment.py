"""A garment ready to be simulated: mesh, material, pins and how it follows the body."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.params import Material
from garment_sim_ros.sim.placement import SoftAttachments

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


@dataclass(frozen=True, kw_only=True)
class Garment:
    """One garment on one body in rest pose.

    It needs nothing of the body at run time but the poses of the frames it names: each is a bone
    (the `frame` collider of that bone) or a collider's name.

    Attributes:
        name: Matches ``[a-z][a-z0-9_]*``.
        vertices: Positions in the body's rest pose, z up, file order [m], shape [v, 3]. Edges have
            their rest lengths here.
        triangles: Vertex indices, counter-clockwise seen from outside, shape [t, 3].
        material: Its fabric.
        frames: Names of the frames that it rides on, length b.
        T_world_frame_rest: Transforms of those frames in the pose of `vertices`, shape [b, 4, 4].
            A shirt is made with the arms away from the trunk, whatever the body's rest pose.
        frame_index: Frames that each vertex would follow if it were skin, shape [v, k].
        frame_weight: Weights of those frames, rows sum to 1, shape [v, k]. Used to place the
            garment on a pose far from the current one (start, reset, teleport).
        pins: Vertices with zero inverse mass, shape [p].
        pin_frame: Index into `frames` that each pin rides on rigidly, shape [p].
        passed_by: Bones whose colliders only brush it from outside: a hand that swings along a
            skirt would else press it through the thigh.
        layer: Garments with a higher number are worn over those with a lower one.
        max_distance: How far each vertex may be from where it would be as skin [m], shape [v];
            None where nothing holds it.
        backstop: How far each vertex may be behind where it would be as skin, along the normal
            that it would have there [m], shape [v]; None where nothing holds it.
        soft: Springs to places on its frames; None without.
        tethers: Part of its way over the cloth that a vertex may be farther away from its pins;
            None where nothing holds it.
        self_collision: The distance that its parts keep from each other [m]; None where it may
            pass through itself.
    """

    name: str
    vertices: FloatArray
    triangles: IntArray
    material: Material
    frames: tuple[str, ...]
    T_world_frame_rest: FloatArray
    frame_index: IntArray
    frame_weight: FloatArray
    pins: IntArray
    pin_frame: IntArray
    passed_by: tuple[str, ...] = ()
    layer: int = 0
    max_distance: FloatArray | None = None
    backstop: FloatArray | None = None
    soft: SoftAttachments | None = None
    tethers: float | None = None
    self_collision: float | None = None

    def __post_init__(self) -> None:
        v = len(self.vertices)
        if not np.isfinite(self.vertices).all():
            raise GeometryError(f"garment {self.name!r}: vertices must be finite")
        if self.triangles.size and not 0 <= self.triangles.min() <= self.triangles.max() < v:
            raise GeometryError(f"garment {self.name!r}: triangle indices must lie in 0..{v - 1}")
        if self.pins.size and not 0 <= self.pins.min() <= self.pins.max() < v:
            raise GeometryError(f"garment {self.name!r}: pins must lie in 0..{v - 1}")


def without_bones(colliders: ColliderSet, bones: Sequence[str]) -> ColliderSet:
    """A set without the shapes on some bones; frames stay."""
    kept = (c for c in colliders.colliders if c.kind == "frame" or c.bone not in bones)
    return replace(colliders, colliders=tuple(kept))
