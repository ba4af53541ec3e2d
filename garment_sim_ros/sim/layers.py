"""Garments over garments: each keeps to its side of those it touches.

The layer order is known (a shirt over a skirt), so a particle belongs to one side of the other
garment, whatever happened: what starts tangled, or was torn through, comes free again. Particles
meet triangles both ways, so that neither garment shows through between the other's vertices.

Only what is under the other garment at rest, or a little beyond its border, belongs there: the
hem of a skirt that flies up over a shirt is not drawn under it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import boundary_loops, mesh_topology
from garment_sim_ros.sim.kernels.layers import find_triangles, separate, take_from_neighbours
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.state import State

IntArray = NDArray[np.int32]

_REACH = 2.0
"""Particles look for triangles this far, in mean edge lengths of the coarser garment."""
_SEARCH_EVERY = 60
_SPREAD_EVERY = 4
"""Steps between searches among all triangles, which find where garments begin to touch, and
between looks at what neighbours have, which is how touching spreads."""

_BEYOND = 0.06
"""Particles of the inner garment that lie farther beyond the outer one's border at rest [m] have
nothing to do with it."""


@dataclass(kw_only=True)
class _Side:
    """The particles of one garment and the triangles of the other that they meet.

    Attributes:
        edges: Edges of the particles' own mesh, shape [e, 2].
        triangles: The other garment's triangles as its particles, shape [t, 3].
        neighbour: Triangles across their edges, -1 at a border, shape [t, 3].
        near: Triangle that each particle is near to, -1 for none, shape [n].
        apart: Particles that have nothing to do with the other garment.
        start: Scratch of the search.
        entry: Scratch of the search.
    """

    edges: IntArray
    triangles: IntArray
    neighbour: IntArray
    near: IntArray
    apart: IntArray
    start: IntArray
    entry: IntArray


class LayerPair:
    """An inner garment and one that is worn over it.

    Args:
        inner: The one under the other.
        outer: The one over it.
    """

    def __init__(self, inner: ClothModel, outer: ClothModel) -> None:
        self._models = (inner, outer)
        under = _is_under(inner, outer)
        everything = np.ones(len(outer), np.bool_)
        self._of_inner = _side(inner, outer, under, everything)
        self._of_outer = _side(outer, inner, everything, under)
        self._reach = np.float32(_REACH * max(_edge_length(inner), _edge_length(outer)))
        self._thickness = np.float32(0.5 * (inner.material.thickness + outer.material.thickness))
        self._friction = np.float32(np.sqrt(inner.material.friction * outer.material.friction))
        self._steps = 0

    def forget(self) -> None:
        """Look for all triangles anew: the garments were put elsewhere."""
        self._of_inner.near[:] = -1
        self._of_outer.near[:] = -1
        self._steps = 0

    def separate(self, inner: State, outer: State, *, held: bool = False) -> int:
        """Moves both apart where they touch or cross, after a step.

        Args:
            inner: The one under the other.
            outer: The one over it.
            held: Whether the inner one stays where it is. It must where it takes no steps of its
                own: nothing would then pull back what many pushes add up to.

        Returns:
            In how many places they touched.
        """
        touching = 0
        mass = [model.inverse_mass for model in self._models]
        if held:
            mass[0] = np.zeros_like(mass[0])
        for mine, (me, other), (my_mass, other_mass), side in (
            (self._of_outer, (outer, inner), mass[::-1], 1.0),
            (self._of_inner, (inner, outer), mass, -1.0),
        ):
            if self._steps % _SEARCH_EVERY == 0:
                find_triangles(
                    me.x, other.x, mine.triangles, self._reach, mine.start, mine.entry, mine.near
                )
            elif self._steps % _SPREAD_EVERY == 0:
                take_from_neighbours(mine.edges, mine.near)
            mine.near[mine.apart] = -1
            touching += separate(
                me.x,
                me.v,
                my_mass,
                other.x,
                other.v,
                other_mass,
                mine.triangles,
                mine.neighbour,
                mine.near,
                np.float32(side),
                self._thickness,
                self._friction,
                self._reach,
            )
        self._steps += 1
        return touching


def _side(
    mine: ClothModel, other: ClothModel, meets: NDArray[np.bool_], is_met: NDArray[np.bool_]
) -> _Side:
    """Those of my particles that `meets`, and the other's triangles whose corners all `is_met`."""
    particle = np.empty(len(other), np.int32)
    particle[other.vertex] = np.arange(len(other), dtype=np.int32)
    triangles = particle[other.triangles]
    triangles = np.ascontiguousarray(triangles[is_met[triangles].all(axis=1)])
    cells = 1 << int(np.ceil(np.log2(max(len(triangles), 2))))
    return _Side(
        edges=_edges(mine),
        triangles=triangles,
        neighbour=neighbours(triangles),
        near=np.full(len(mine), -1, np.int32),
        apart=np.flatnonzero(~meets).astype(np.int32),
        start=np.zeros(cells + 1, np.int32),
        entry=np.zeros(len(triangles), np.int32),
    )


def _is_under(inner: ClothModel, outer: ClothModel) -> NDArray[np.bool_]:
    """Which of the inner garment's particles are under the outer one at rest, shape [n]."""
    x = np.empty((len(outer), 3))
    x[outer.vertex] = outer.rest
    loops = boundary_loops(outer.triangles)
    if not loops:
        return np.ones(len(inner), np.bool_)
    gap, closest, _ = MeshDistance(x, outer.triangles).signed_distance(inner.rest)
    to_border, _ = cKDTree(x[np.concatenate(loops)]).query(closest)
    return (np.abs(gap) < _BEYOND) | (to_border > _edge_length(outer))


def neighbours(triangles: IntArray) -> IntArray:
    """The triangle across each edge ab, bc, ca; -1 at a border or where more than two meet."""
    if not len(triangles):
        return np.zeros((0, 3), np.int32)
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    _, edge, count = np.unique(
        np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    order = np.argsort(edge.ravel(), kind="stable")
    twin = np.full(len(ends), -1, np.int32)
    first = np.concatenate([[0], np.cumsum(count)[:-1]])[count == 2]
    a, b = order[first], order[first + 1]
    twin[a], twin[b] = b // 3, a // 3
    return twin.reshape(-1, 3)


def _edges(model: ClothModel) -> IntArray:
    """Pairs of particles, shape [e, 2]."""
    particle = np.empty(len(model), np.int32)
    particle[model.vertex] = np.arange(len(model), dtype=np.int32)
    return particle[mesh_topology(model.triangles).edges]


def _edge_length(model: ClothModel) -> float:
    edges = _edges(model)
    return float(np.linalg.norm(model.rest[edges[:, 0]] - model.rest[edges[:, 1]], axis=1).mean())
