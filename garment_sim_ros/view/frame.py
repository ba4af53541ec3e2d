"""What a source of pictures gives: garments and colliders at one time."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet

Figures = Mapping[str, Mapping[str, float]]
"""Numbers of each garment by key, as the topic `quality` has them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloth:
    """A garment's mesh.

    Attributes:
        vertices: At rest [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
    """

    vertices: FloatArray
    triangles: IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """An avatar at one time.

    Attributes:
        stamp: The time [ns].
        positions: World positions of each garment's vertices [m], shape [v, 3].
        poses: World poses of the colliders; None where they are not known.
        quality: Figures of the garments.
    """

    stamp: int
    positions: Mapping[str, SingleArray]
    poses: ColliderPoses | None = None
    quality: Figures = field(default_factory=dict)


class Source(Protocol):
    """Where frames come from.

    Attributes:
        cloths: The garments there are now, inner ones first; another object once they changed.
        colliders: The colliders there are now; None where they are not known.
    """

    cloths: Mapping[str, Cloth]
    colliders: ColliderSet | None

    def frame(self) -> Frame | None:
        """The frame to show now; None where it is the same as before, or there is none."""

    def body(self) -> tuple[str, str] | None:
        """Body file and file of its bones' names; None where they are not known."""

    def words(self) -> str:
        """How the source is, in a few words that are safe to show."""
