"""Garments over garments at rest: which is worn over which, and room for both.

Meshes are modelled apart. Where a skirt's waist is cut narrower than the shirt to be tucked into
it, or two surfaces run through each other, no simulation finds a state of rest: the cut itself is
changed first, the inner garment's as far as the body leaves room, the outer one's by the rest.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.garment.dressing import over_the_body
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.letting_out import let_out_panels, spread
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import GarmentMesh
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.geometry.triangles import area_vectors
from garment_sim_ros.sim.placement import blend

_REACH = 0.06
"""Surfaces farther apart [m] have nothing to do with each other."""
_STRAIGHT = 0.7
"""Least cosine between the way to the other surface and its normal: past its border it is less."""
_WORTH_A_WORD = 1e-3
"""Smaller changes of a cut [m] are not told."""
_LEAST = 0.02
"""Share of the vertices of two that lie along the other one, from which they are in layers."""


@dataclass(frozen=True, kw_only=True)
class Cut:
    """A garment and the body in the pose that it is cut for.

    Attributes:
        garment: The garment.
        measures: The body.
        sewn: Its vertices as they were sewn [m], shape [v, 3]; None: it was not cut from panels.
    """

    garment: Garment
    measures: Measures
    sewn: FloatArray | None = None

    def let_out(self) -> Garment:
        """The garment with its panels let out to where its vertices are by now."""
        garment = self.garment
        if self.sewn is None or garment.flat is None:
            return garment
        return replace(
            garment,
            flat=let_out_panels(garment.flat, garment.triangles, self.sewn, garment.vertices),
        )


def layers_of(cuts: Sequence[Cut]) -> list[int]:
    """How many garments each one is worn over, as they lie at rest.

    Where two cannot be told apart, the later one is worn over the other.
    """
    over: dict[int, set[int]] = {i: set() for i in range(len(cuts))}
    for j in range(len(cuts)):
        for i in range(j):
            height = np.concatenate(
                [_heights(cuts[j], cuts[i]), -_heights(cuts[i], cuts[j])], dtype=np.float64
            )
            many = len(cuts[i].garment.vertices) + len(cuts[j].garment.vertices)
            if len(height) < _LEAST * many:
                continue
            outer, inner = (j, i) if np.median(height) >= 0.0 else (i, j)
            over[outer].add(inner)
    layers: dict[int, int] = {}
    while len(layers) < len(cuts):
        # In a ring of garments, each over the next one, the first of the file is the inner one.
        ready = [i for i in over if i not in layers and over[i] <= layers.keys()]
        for i in ready or [min(over.keys() - layers.keys())]:
            below = over[i] & layers.keys()
            layers[i] = 1 + max((layers[k] for k in below), default=-1)
    return [layers[i] for i in range(len(cuts))]


def with_room(cuts: Sequence[Cut], colliders: ColliderSet | None) -> tuple[list[Cut], list[str]]:
    """Garments whose cut leaves each its place under or over the others.

    Args:
        cuts: The garments with their layers.
        colliders: What they will lie on; None where only the skin matters.

    Returns:
        The garments in the same order, and what was changed, one sentence each.
    """
    fitted = list(cuts)
    notes = []
    order = sorted(range(len(cuts)), key=lambda k: cuts[k].garment.layer)
    for n, j in enumerate(order):
        for i in order[:n]:
            if fitted[i].garment.layer == fitted[j].garment.layer:
                continue
            before = fitted[i].garment.vertices, fitted[j].garment.vertices
            fitted[i] = _let_in(fitted[i], fitted[j], colliders)
            fitted[j] = _let_out(fitted[j], fitted[i])
            for k, x, way in ((i, before[0], "in under"), (j, before[1], "out over")):
                garment = fitted[k].garment
                moved = np.linalg.norm(garment.vertices - x, axis=1).max()
                if moved >= _WORTH_A_WORD:
                    other = fitted[i + j - k].garment.name
                    notes.append(
                        f"{garment.name}: was let {way} {other} by up to {1e3 * moved:.0f} mm"
                    )
    return fitted, notes


def _let_in(inner: Cut, outer: Cut, colliders: ColliderSet | None) -> Cut:
    """The inner garment under the outer one, as far as the body leaves room."""
    garment = inner.garment
    vertices = spread(garment.vertices, garment.triangles, _beyond(outer, inner, -1.0))
    if vertices is garment.vertices:
        return inner
    mesh = GarmentMesh(vertices=vertices, triangles=garment.triangles)
    mesh = over_the_body(mesh, inner.measures, colliders, garment)
    return replace(inner, garment=replace(garment, vertices=mesh.vertices))


def _let_out(outer: Cut, inner: Cut) -> Cut:
    """The outer garment over the inner one."""
    garment = outer.garment
    vertices = spread(garment.vertices, garment.triangles, _beyond(inner, outer, 1.0))
    outer = replace(outer, garment=replace(garment, vertices=vertices))
    # Its corners are over the inner one; vertices of that may still be through its triangles.
    vertices = _lifted(outer, inner)
    return replace(outer, garment=replace(garment, vertices=vertices))


def _lifted(outer: Cut, inner: Cut) -> FloatArray:
    """Vertices of the outer garment, its triangles lifted over what the inner one has through."""
    garment = outer.garment
    surface = _Surface(outer, inner)
    height, _, _, along, nearest = surface.beside(inner.garment.vertices)
    through = along & (height > 0.0)
    lift = np.zeros(len(garment.vertices))
    gap = 0.5 * (garment.material.thickness + inner.garment.material.thickness)
    for corner in garment.triangles[nearest[through]].T:
        np.maximum.at(lift, corner, height[through] + gap)
    normal = np.empty_like(garment.vertices)
    vertex_normals(garment.vertices, garment.triangles, normal)
    return garment.vertices + lift[:, None] * normal


def _beyond(cut: Cut, mine: Cut, side: float) -> Callable[[FloatArray], FloatArray]:
    """Moves my vertices to a side of another garment, their common thickness away from it."""
    surface = _Surface(cut, mine)
    gap = 0.5 * (cut.garment.material.thickness + mine.garment.material.thickness)

    def placed(x: FloatArray) -> FloatArray:
        height, closest, normal, along, _ = surface.beside(x)
        wrong = along & (side * height < gap)
        return np.where(wrong[:, None], closest + side * gap * normal, x)

    return placed


class _Surface:
    """A garment, carried like skin to the pose that another one is cut for.

    Args:
        cut: The garment.
        other: The other one.
    """

    def __init__(self, cut: Cut, other: Cut) -> None:
        garment, bones = cut.garment, other.garment.T_world_bone_rest
        pairs = zip(garment.frames, garment.T_world_frame_rest, strict=True)
        x = blend(garment, np.stack([bones.get(name, T) for name, T in pairs]))
        normal = area_vectors(x, garment.triangles)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        self._normal = normal / np.maximum(length, 1e-300)
        self._distance = MeshDistance(x, garment.triangles)

    def beside(
        self, x: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.integer[Any]]]:
        """Where points [n, 3] are beside it.

        Returns:
            Height over the nearest triangle [m], shape [n]; the point below, shape [n, 3]; the
            triangle's normal, shape [n, 3]; whether it is near and not past a border, shape [n];
            and that triangle, shape [n].
        """
        _, closest, nearest = self._distance.signed_distance(x)
        normal = self._normal[nearest]
        way = x - closest
        height = np.einsum("ni,ni->n", way, normal)
        far = np.linalg.norm(way, axis=1)
        along = (far < _REACH) & (np.abs(height) >= _STRAIGHT * far)
        return height, closest, normal, along, nearest


def _heights(cut: Cut, over: Cut) -> FloatArray:
    """How high a garment's vertices are over another one, those that lie along it [m]."""
    height, _, _, along, _ = _Surface(over, cut).beside(cut.garment.vertices)
    return height[along]
