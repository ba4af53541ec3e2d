"""How garments follow the body: names of frames, pins, and placing on a pose."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.carrying import carry
from garment_sim_ros.geometry.transforms import invert_transform, transform_from
from garment_sim_ros.params import Material
from garment_sim_ros.sim.elastic import ElasticEdges


@dataclass(frozen=True, kw_only=True)
class SoftAttachments:
    """Springs between vertices and their places on frames.

    Attributes:
        vertices: Different vertices, none of them pinned, shape [s].
        frame: The frame of the garment that each one follows, shape [s].
        stiffness: Force per distance from there [N/m], shape [s].
        damping: Force per speed relative to it [N s/m], shape [s].
    """

    vertices: IntArray
    frame: IntArray
    stiffness: FloatArray
    damping: FloatArray


class GarmentLike(Protocol):
    """What the simulation reads of a garment, as in `garment.garment.Garment`."""

    @property
    def name(self) -> str:
        """Unique name."""

    @property
    def vertices(self) -> FloatArray:
        """Rest positions in file order [m], shape [v, 3]."""

    @property
    def triangles(self) -> IntArray:
        """Vertex indices, shape [t, 3]."""

    @property
    def material(self) -> Material:
        """Its fabric."""

    @property
    def frames(self) -> tuple[str, ...]:
        """Bones or colliders that it follows, length b."""

    @property
    def T_world_frame_rest(self) -> FloatArray:  # noqa: N802
        """Rest transforms of those frames, shape [b, 4, 4]."""

    @property
    def T_world_bone_rest(self) -> Mapping[str, FloatArray]:  # noqa: N802
        """Rest transforms of all bones that are known, by name, shape [4, 4]."""

    @property
    def frame_index(self) -> IntArray:
        """Frames that each vertex follows when placed, shape [v, k]."""

    @property
    def frame_weight(self) -> FloatArray:
        """Weights of those frames, rows sum to 1, shape [v, k]."""

    @property
    def pins(self) -> IntArray:
        """Vertices with zero inverse mass, shape [p]."""

    @property
    def pin_frame(self) -> IntArray:
        """The frame that each pin follows, shape [p]."""

    @property
    def layer(self) -> int:
        """Garments with a higher number are worn over those with a lower one."""

    @property
    def passed_by(self) -> tuple[str, ...]:
        """Bones whose colliders only brush it from outside."""

    @property
    def skin_limits(self) -> Mapping[str, FloatArray]:
        """Limits by their names in `holds.skin_limits`: one for each vertex [m], shape [v]."""

    @property
    def soft(self) -> SoftAttachments | None:
        """Springs to places on its frames; or None."""

    @property
    def tethers(self) -> float | None:
        """Part of its way over the cloth that a vertex may be farther from its pins; or None."""

    @property
    def flat(self) -> FloatArray | None:
        """Corners of each triangle in its panel [m], shape [t, 3, 2]; or None."""

    @property
    def rest(self) -> FloatArray | None:
        """Positions where its edges have their rest lengths [m], shape [v, 3]; or None."""

    @property
    def stitches(self) -> IntArray | None:
        """Number of the stitch that draws each vertex, -1 for none, shape [v]; or None."""

    @property
    def elastic(self) -> ElasticEdges | None:
        """Elastic bands along its edges; or None."""

    @property
    def self_collision(self) -> float | None:
        """The distance that its parts keep from each other [m]; or None."""


@dataclass(frozen=True, kw_only=True)
class Frames:
    """The frames that a garment follows, found among a set's colliders.

    Attributes:
        collider: The collider that carries each frame, shape [b].
        T_collider_frame: Each frame in that collider's own frame, shape [b, 4, 4].
    """

    collider: IntArray
    T_collider_frame: FloatArray

    def world(self, poses: ColliderPoses) -> FloatArray:
        """World transforms of the frames, shape [b, 4, 4]."""
        T = transform_from(poses.position[self.collider], poses.orientation[self.collider])
        return T @ self.T_collider_frame


def find_frames(garment: str, names: tuple[str, ...], colliders: ColliderSet) -> Frames:
    """Finds each name: a bone (by its `frame` collider, else any collider on it) or a collider.

    Raises:
        GeometryError: Names that are neither, all of them listed.
    """
    by_name = {c.name: i for i, c in enumerate(colliders.colliders)}
    by_bone: dict[str, int] = {}
    for i, c in enumerate(colliders.colliders):
        if c.bone not in by_bone or (
            c.is_frame and not colliders.colliders[by_bone[c.bone]].is_frame
        ):
            by_bone[c.bone] = i
    missing = [n for n in names if n not in by_bone and n not in by_name]
    if missing:
        raise GeometryError(
            f"garment {garment!r} is attached to {', '.join(map(repr, missing))}, which the "
            f"collider set does not have; bones: {', '.join(by_bone)}; "
            f"colliders: {', '.join(by_name)}"
        )
    index = [by_bone.get(n, by_name.get(n, -1)) for n in names]
    T = np.tile(np.eye(4), (len(names), 1, 1))
    for k, name in enumerate(names):
        if name in by_bone:
            c = colliders.colliders[index[k]]
            T[k] = invert_transform(transform_from(c.position, c.orientation))
    return Frames(collider=np.array(index, dtype=np.int32), T_collider_frame=T)


def rest_transforms(garments: Iterable[GarmentLike], colliders: ColliderSet) -> FloatArray:
    """Where colliders are in the rest pose that garments were made in.

    Returns:
        Their world transforms, shape [n, 4, 4]; NaN where no garment knows their bones.
    """
    T = np.full((len(colliders), 4, 4), np.nan)
    bones = {c.bone for c in colliders.colliders}
    for garment in garments:
        frame_of = {name: f for f, name in enumerate(garment.frames)}
        for i, c in enumerate(colliders.colliders):
            own = transform_from(c.position, c.orientation)
            # As in `find_frames`, a name that both have is the bone's.
            if c.bone in garment.T_world_bone_rest:
                T[i] = garment.T_world_bone_rest[c.bone] @ own
            if c.bone in frame_of:
                T[i] = garment.T_world_frame_rest[frame_of[c.bone]] @ own
            elif c.name in frame_of and c.name not in bones:
                T[i] = garment.T_world_frame_rest[frame_of[c.name]]
    return T


def places_in_frames(
    garment: GarmentLike, frames: Frames, vertices: IntArray, frame: IntArray
) -> FloatArray:
    """Vertices [p] at rest in the colliders that carry their frames [p] [m], shape [p, 3]."""
    to_frame = invert_transform(garment.T_world_frame_rest)
    T = (frames.T_collider_frame @ to_frame)[frame]
    x = np.asarray(garment.vertices, dtype=np.float64)[vertices]
    return np.einsum("pij,pj->pi", T[:, :3, :3], x) + T[:, :3, 3]


class Carried:
    """Vertices of a garment that are carried by its frames like skin, blended linearly.

    Args:
        garment: The garment.
        of: Which of its vertices; all by default.
    """

    def __init__(self, garment: GarmentLike, of: IntArray | slice = slice(None)) -> None:
        self._x = np.array(garment.vertices[of], np.float64)
        self._frame = np.array(garment.frame_index[of], np.int32)
        self._weight = np.array(garment.frame_weight[of], np.float64)
        self._to_frame = invert_transform(garment.T_world_frame_rest)

    def at(self, T_world_frame: FloatArray) -> FloatArray:
        """Where they are, a new array; linear in the transforms.

        Differences of transforms give displacements.

        Args:
            T_world_frame: Current transforms of its frames, shape [b, 4, 4].

        Returns:
            World positions [m], shape [v, 3].
        """
        x_world = np.empty_like(self._x)
        carry(self._x, self._frame, self._weight, T_world_frame @ self._to_frame, x_world)
        return x_world


def blend(
    garment: GarmentLike, T_world_frame: FloatArray, of: IntArray | slice = slice(None)
) -> FloatArray:
    """Vertices of a garment as skin, once; see `Carried`."""
    return Carried(garment, of).at(T_world_frame)
