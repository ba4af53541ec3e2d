"""What a garment's edges and particles say about it, without a body."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.colliders.report.fatness import Union
from garment_sim_ros.contact.crossings import find_hits
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.geometry.transforms import invert_transform, transform_points
from garment_sim_ros.sim.placement import find_frames
from garment_sim_ros.sim.rest_shape import edge_lengths, rest_corners

_SHORTEST = 0.1
"""Edges count as at least so long, in mean edge lengths: the needles of a bad mesh are too short
for their stretch to be seen."""
_END = 1e-4
"""Share of an edge next to its ends where it meets the triangles that it is an edge of."""


class Strain(NamedTuple):
    """How edges are stretched, as a share of their length at rest.

    Attributes:
        crushed: By how much 5 % of them are too short, at least; positive.
        most: 95 % of them are stretched less.
        largest: The largest.
    """

    crushed: float
    most: float
    largest: float


class Edges:
    """The edges of some garments.

    Args:
        garments: The garments.
    """

    def __init__(self, garments: tuple[Garment, ...]) -> None:
        self._edges = {g.name: mesh_topology(g.triangles).edges for g in garments}
        self._rest = {
            g.name: edge_lengths(rest_corners(g), g.triangles, self._edges[g.name])
            for g in garments
        }
        self._own = {g.name: g.triangles for g in garments if g.self_collision}

    def strain(self, x: dict[str, FloatArray]) -> Strain:
        """Of all garments, from their vertices [m]; infinite where something is not finite."""
        strain = []
        for name, rest in self._rest.items():
            excess = _lengths(x[name], self._edges[name]) - rest
            strain.append(excess / np.maximum(rest, _SHORTEST * rest.mean()))
        every = np.concatenate(strain)
        if not np.isfinite(every).all():
            return Strain(np.inf, np.inf, np.inf)
        low, high = np.percentile(every, (5.0, 95.0))
        return Strain(float(max(-low, 0.0)), float(high), float(every.max()))

    def crossed(self, x: dict[str, FloatArray]) -> float:
        """Largest share of the edges, of garments that collide with themselves, through others."""
        share = 0.0
        for name, triangles in self._own.items():
            edges = self._edges[name]
            edge, at = np.empty(64 * len(edges), np.int32), np.empty(64 * len(edges))
            count = min(find_hits(x[name][edges], x[name], triangles, edge, at), len(edge))
            through = np.abs(at[:count] - 0.5) < 0.5 - _END
            share = max(share, len(np.unique(edge[:count][through])) / len(edges))
        return share


def unpinned(garment: Garment) -> NDArray[np.bool_]:
    """Which vertices are free, shape [v]."""
    free = np.ones(len(garment.vertices), bool)
    free[garment.pins] = False
    return free


def off_pins(
    garment: Garment, x: FloatArray, colliders: ColliderSet, poses: ColliderPoses
) -> float:
    """How far a pin is from where its frame has it [m], at most; 0 without pins."""
    if not len(garment.pins):
        return 0.0
    T_world = find_frames(garment.name, garment.frames, colliders).world(poses)
    T_rest = garment.T_world_frame_rest
    far = 0.0
    for frame in np.unique(garment.pin_frame):
        pins = garment.pins[garment.pin_frame == frame]
        place = transform_points(
            T_world[frame] @ invert_transform(T_rest[frame]), garment.vertices[pins]
        )
        far = max(far, float(np.linalg.norm(x[pins] - place, axis=1).max()))
    return far


def buried(
    garment: Garment, x: FloatArray, colliders: ColliderSet, poses: ColliderPoses, deep: float
) -> float:
    """Share of the free vertices that are deeper than so far [m] in the shapes."""
    here, origin = poses.copy(), poses.position[0].copy()
    here.position = here.position - origin
    free = unpinned(garment)
    if not free.any():
        return 0.0
    return float((Union(colliders, here).distance(x[free] - origin) < -deep).mean())


def _lengths(x: FloatArray, edges: NDArray[np.int32]) -> FloatArray:
    return np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)
