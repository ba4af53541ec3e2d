"""What is to be seen of a frame: meshes, each of one colour, world, z up."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.recording.metrics import GarmentMesh
from garment_sim_ros.view.collider_surface import ColliderSurface
from garment_sim_ros.view.frame import Cloth, Frame
from garment_sim_ros.view.levels import (
    LEVELS,
    PENETRATION,
    STRAIN,
    Rgb,
    colour,
    edges_of_triangles,
    part,
    strain_of_triangles,
)
from garment_sim_ros.view.wearer import Wearer

PLAIN, LAYER = "garment", "layer"
COLOURS = (PLAIN, STRAIN.name, PENETRATION.name, LAYER)
"""What the colour of a garment's outside may mean."""
SKIN_COLOUR: Rgb = (204, 173, 153)
COLLIDER_COLOUR: Rgb = (89, 140, 217)
_COLLIDER_OPACITY = 0.35
_INSIDE = 0.6
"""The inside of cloth is darker than its outside by this factor."""
_REST = 3.0
"""Least time between two measurements of the penetration, per time that one takes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """A mesh of one colour.

    Attributes:
        name: Unique in the scene.
        vertices: In the world [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        colour: Red, green and blue, 0 to 255.
        side: Which side is seen: ``front``, ``back`` or ``double``.
        opacity: 0 to 1; None: opaque.
    """

    name: str
    vertices: SingleArray
    triangles: IntArray
    colour: Rgb
    side: Literal["front", "back", "double"]
    opacity: float | None = None


@dataclass(kw_only=True)
class Shows:
    """What the user wants to see.

    Attributes:
        body: The skin.
        colliders: The collider shapes.
        garments: The garments.
        colours: One of `COLOURS`.
    """

    body: bool = True
    colliders: bool = False
    garments: bool = True
    colours: str = PLAIN


class _Worn:
    """A garment, and what its colours are worked out from."""

    def __init__(self, cloth: Cloth, number: int) -> None:
        self.cloth = cloth
        self.mesh = GarmentMesh.from_rest(cloth.vertices, cloth.triangles)
        self.edges = edges_of_triangles(self.mesh)
        self.colour = _rgb(garment_colour(number))
        self.depth = np.zeros(len(cloth.triangles))


class Scene:
    """Turns frames into meshes.

    Attributes:
        shows: What is wanted; may be changed at any time.
        skinless: Why there is no skin; empty where there is one.
        is_behind: Whether colours are of an earlier frame, so that it is to be drawn again.
    """

    def __init__(self) -> None:
        self.shows = Shows()
        self.skinless = "body not known"
        self._worn: dict[str, _Worn] = {}
        self._cloths: Mapping[str, Cloth] = {}
        self._colliders: ColliderSet | None = None
        self._surface: ColliderSurface | None = None
        self._wearer: Wearer | None = None
        self.is_behind = False
        self._not_before = 0.0

    def dress(self, cloths: Mapping[str, Cloth]) -> None:
        """Take over other garments."""
        if cloths is not self._cloths:
            before, self._cloths = self._worn, cloths
            self._worn = {}
            for number, (name, cloth) in enumerate(cloths.items()):
                known = before.get(name)
                kept = known is not None and known.cloth is cloth
                self._worn[name] = known if known and kept else _Worn(cloth, number)
                self._worn[name].colour = _rgb(garment_colour(number))

    def set_colliders(self, colliders: ColliderSet | None) -> None:
        """Take over other colliders."""
        if colliders is not self._colliders:
            self._colliders, self._surface = colliders, None
            if self._wearer is not None and self._wearer.colliders is not colliders:
                self._wearer = None

    def set_wearer(self, wearer: Wearer | None, why: str = "") -> None:
        """Take over another body; without one, the reason why there is none."""
        self.skinless = why
        known = wearer is not None and wearer.colliders is self._colliders
        self._wearer = wearer if known else None

    def draw(self, frame: Frame) -> list[Drawn]:
        """The meshes of a frame, all there are to be seen."""
        poses = frame.poses
        if poses is not None and (
            self._colliders is None or len(poses.position) != len(self._colliders)
        ):
            poses = None
        self.is_behind = False
        drawn = list(self._draw_body(poses))
        if self.shows.garments:
            if self.shows.colours == PENETRATION.name:
                self._measure(frame, poses)
            for name, x in frame.positions.items():
                worn = self._worn.get(name)
                if worn is not None and len(x) == len(worn.cloth.vertices):
                    drawn += self._draw_garment(name, worn, x, frame)
        return drawn

    def centre(self, frame: Frame) -> FloatArray:
        """The middle of the avatar [m], shape [3]."""
        if frame.poses is not None and len(frame.poses.position):
            points = frame.poses.position
        else:
            points = np.concatenate([*frame.positions.values(), np.zeros((0, 3))])
        return points.mean(axis=0) if len(points) else np.zeros(3)

    def _draw_body(self, poses: ColliderPoses | None) -> Iterator[Drawn]:
        if poses is None:
            return
        if self.shows.body and self._wearer is not None:
            yield Drawn(
                name="body",
                vertices=self._wearer.vertices(poses),
                triangles=self._wearer.triangles,
                colour=SKIN_COLOUR,
                side="front",
            )
        if not self.shows.colliders or self._colliders is None:
            return
        if self._surface is None:
            self._surface = ColliderSurface(self._colliders)
        if len(self._surface.triangles):
            yield Drawn(
                name="colliders",
                vertices=self._surface.vertices(poses),
                triangles=self._surface.triangles,
                colour=COLLIDER_COLOUR,
                side="front",
                opacity=_COLLIDER_OPACITY,
            )

    def _draw_garment(
        self, name: str, worn: _Worn, x: SingleArray, frame: Frame
    ) -> Iterator[Drawn]:
        triangles = worn.cloth.triangles
        outside = worn.colour
        if self.shows.colours == LAYER:
            layer = frame.quality.get(name, {}).get("layer", float("nan"))
            outside = _rgb(garment_colour(int(layer))) if layer >= 0 else (128, 128, 128)
        r, g, b = (round(_INSIDE * c) for c in outside)
        yield Drawn(
            name=f"{name}/inside", vertices=x, triangles=triangles, colour=(r, g, b), side="back"
        )
        values: FloatArray | None = None
        if self.shows.colours == STRAIN.name:
            values, scale = strain_of_triangles(worn.mesh, worn.edges, x), STRAIN
        elif self.shows.colours == PENETRATION.name:
            values, scale = worn.depth, PENETRATION
        if values is None:
            yield Drawn(
                name=f"{name}/outside", vertices=x, triangles=triangles, colour=outside,
                side="front",
            )  # fmt: skip
            return
        levels = scale.levels(values)
        for level in range(LEVELS):
            chosen = levels == level
            if chosen.any():
                vertices, faces = part(triangles[chosen], x)
                yield Drawn(
                    name=f"{name}/level_{level}",
                    vertices=vertices,
                    triangles=faces,
                    colour=colour(level),
                    side="front",
                )

    def _measure(self, frame: Frame, poses: ColliderPoses | None) -> None:
        """Depth of the garments in the skin; less often where it takes long."""
        if poses is None or self._wearer is None or not self._wearer.measures:
            for worn in self._worn.values():
                worn.depth[:] = 0.0
            return
        began = time.monotonic()
        self.is_behind = began < self._not_before
        if self.is_behind:
            return
        self._wearer.pose(poses)
        for name, x in frame.positions.items():
            known = self._worn.get(name)
            if known is not None and len(x) == len(known.cloth.vertices):
                known.depth = self._wearer.depth(x)[known.cloth.triangles].max(axis=1)
        now = time.monotonic()
        self._not_before = now + _REST * (now - began)


def _rgb(colour: tuple[float, float, float]) -> Rgb:
    r, g, b = (round(255 * c) for c in colour)
    return r, g, b
