"""Garments over garments: each keeps to its side of those it touches.

The layer order is known (a shirt over a skirt), so a particle belongs to one side of the other
garment, whatever happened: what starts tangled, or was torn through, comes free again. Particles
meet triangles both ways, so that neither garment shows through between the other's vertices.

Only what is under the other garment at rest, or a little beyond its border, belongs there: the
hem of a skirt that flies up over a shirt is not drawn under it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import boundary_loops, mesh_topology, triangles_across
from garment_sim_ros.jit import compiled
from garment_sim_ros.sim.layers.kernels import SEPARATING_SPEED, find_close, separate
from garment_sim_ros.sim.layers.nearest import find_triangles, take_from_neighbours
from garment_sim_ros.sim.layers.untangled import Untangled
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.piece import Piece
from garment_sim_ros.sim.state import State

_REACH = 2.0
"""Particles look for triangles this far, in mean edge lengths of the coarser garment."""
_SEARCH_EVERY = 60
_SPREAD_EVERY = 4
"""Steps between searches among all triangles, which find where garments begin to touch, and
between looks at what neighbours have, which is how touching spreads."""
_BEYOND = 0.06
"""Particles of the inner garment that lie farther beyond the outer one's border at rest [m] have
nothing to do with it."""


class Meeting(NamedTuple):
    """The particles of one garment and the triangles of another that they meet.

    Attributes:
        x: Positions of the particles [m], shape [n, 3].
        v: Their velocities [m/s], shape [n, 3].
        inverse_mass: Their inverse masses [1/kg], shape [n].
        own: A triangle of their own at each, counter-clockwise from outside, shape [n, 3].
        other_x: Positions of the other garment's particles [m], shape [m, 3].
        other_v: Their velocities [m/s], shape [m, 3].
        other_inverse_mass: Their inverse masses [1/kg], shape [m].
        triangles: The other garment's triangles as its particles, counter-clockwise from outside,
            shape [t, 3].
        neighbour: Triangles across their edges ab, bc, ca, -1 at a border, shape [t, 3].
        near: Triangle that each particle is near to, -1 for none, shape [n].
        close: Particles that may touch until the next look, the first `found[0]`, shape [n].
        plane: Normal of the triangle near to each of those, to its side, the weights of the last
            two corners at the closest point, and the distance within which they are parted
            firmly [m], shape [n, 6].
        found: How many are close, how many of them touched, and how many particles stay through
            the other garment, as separating did not help, shape [3].
        side: 1 where the particles belong outside the other garment, -1 where inside.
        thickness: Distance to keep [m].
        friction: Coulomb coefficient.
        reach: Particles farther away lose their triangle [m].
        way: The farthest that they move apart at once [m], shape [1].
        pushed: How far each particle was pushed without coming back to its side [m], shape [n].
    """

    x: SingleArray
    v: SingleArray
    inverse_mass: SingleArray
    own: IntArray
    other_x: SingleArray
    other_v: SingleArray
    other_inverse_mass: SingleArray
    triangles: IntArray
    neighbour: IntArray
    near: IntArray
    close: IntArray
    plane: SingleArray
    found: IntArray
    side: np.float32
    thickness: np.float32
    friction: np.float32
    reach: np.float32
    way: SingleArray
    pushed: SingleArray


@dataclass(kw_only=True)
class _Search:
    """What finding the triangles of a `Meeting` needs.

    Attributes:
        edges: Edges of the particles' own mesh, shape [e, 2].
        apart: Particles that have nothing to do with the other garment.
        start: Scratch.
        entry: Scratch.
    """

    edges: IntArray
    apart: IntArray
    start: IntArray
    entry: IntArray


class LayerPair:
    """An inner garment and one that is worn over it.

    Args:
        inner: The one under the other; its state and workspace stay in the same arrays.
        outer: The one over it; likewise.
    """

    def __init__(self, inner: Piece, outer: Piece) -> None:
        under = _is_under(inner.model, outer.model)
        everything = np.ones(len(outer.model), np.bool_)
        mine, other = (inner.model, inner.state), (outer.model, outer.state)
        self._both_ways = (
            _meeting(other, mine, 1.0, everything, under),
            _meeting(mine, other, -1.0, under, everything),
        )
        self._meetings = (self._both_ways[0][0], self._both_ways[1][0])
        self._code: tuple[Callable[..., None], Callable[..., None]] | None = None
        self._still = np.zeros_like(inner.model.inverse_mass)
        self._still.flags.writeable = False  # as masses are: for kernels it is another type
        self._steps = 0
        self._untangled = Untangled(inner, outer)

    def forget(self) -> None:
        """Look for all triangles anew: the garments were put elsewhere."""
        for meeting, _ in self._both_ways:
            meeting.near[:] = -1
            meeting.pushed[:] = 0.0
        self._steps = 0
        self._untangled.forget()

    @property
    def tangled(self) -> tuple[int, int]:
        """How many particles of the outer and the inner one stay through the other."""
        of_outer, of_inner = self._meetings
        return int(of_outer.found[2]), int(of_inner.found[2])

    @property
    def crossings(self) -> int:
        """Edges of either that ran through the other at the last look."""
        return self._untangled.crossings

    def crossings_at(self, inner: SingleArray, outer: SingleArray) -> int:
        """The same with the vertices of the inner and of the outer one there [m], shape [v, 3]."""
        return self._untangled.crossings_at(inner, outer)

    @property
    def touch(self) -> bool:
        """Whether particles of the one touched the other when they were separated last."""
        return any(meeting.found[1] > 0 for meeting in self._meetings)

    def look(self) -> None:
        """Finds which triangles particles are near to; once in a step."""
        for meeting, search in self._both_ways:
            if self._steps % _SEARCH_EVERY == 0:
                find_triangles(
                    meeting.x,
                    meeting.other_x,
                    meeting.triangles,
                    meeting.reach,
                    search.start,
                    search.entry,
                    meeting.near,
                )
            elif self._steps % _SPREAD_EVERY == 0:
                take_from_neighbours(search.edges, meeting.near)
            meeting.near[search.apart] = -1
        self._steps += 1

    def find_close(self, dt: float) -> None:
        """Finds what `separate` shall look at until the next time, in sub-steps of dt [s]."""
        for meeting in self._meetings:
            meeting.way[0] = SEPARATING_SPEED * dt
        if self._code is None:
            self._code = (
                compiled(find_close, *self._meetings),
                compiled(separate, *self._meetings),
            )
        self._code[0](*self._meetings)

    def separate(self) -> None:
        """Moves both apart where they touch or cross, in a sub-step."""
        assert self._code is not None
        self._code[1](*self._meetings)

    def untangle(self, dt: float, rests: bool) -> None:
        """Frees what runs through the other garment, after a step of dt [s].

        Args:
            dt: The step [s].
            rests: Whether neither body nor air moved in it.
        """
        of_outer, of_inner = self._meetings
        self._untangled.part(dt, rests, (of_inner, of_outer))

    def keep_inner_still(self, still: bool) -> None:
        """Whether only the outer garment gives way.

        The inner one must stay where it takes no steps of its own: nothing would then pull back
        what many pushes add up to.
        """
        self._untangled.keep_first_still(still)
        of_outer, of_inner = (meeting for meeting, _ in self._both_ways)
        if still:
            of_outer = of_outer._replace(other_inverse_mass=self._still)
            of_inner = of_inner._replace(inverse_mass=self._still)
        self._meetings = of_outer, of_inner


def _meeting(
    mine: tuple[ClothModel, State],
    other: tuple[ClothModel, State],
    side: float,
    meets: NDArray[np.bool_],
    is_met: NDArray[np.bool_],
) -> tuple[Meeting, _Search]:
    """Those of my particles that `meets`, and the other's triangles whose corners all `is_met`."""
    (me, state), (it, other_state) = mine, other
    triangles = it.particle_triangles
    triangles = np.ascontiguousarray(triangles[is_met[triangles].all(axis=1)])
    cells = 1 << int(np.ceil(np.log2(max(len(triangles), 2))))
    mean_friction = np.sqrt(me.material.friction * it.material.friction)
    meeting = Meeting(
        x=state.x,
        v=state.v,
        inverse_mass=me.inverse_mass,
        own=_one_at_each(me),
        other_x=other_state.x,
        other_v=other_state.v,
        other_inverse_mass=it.inverse_mass,
        triangles=triangles,
        neighbour=triangles_across(triangles),
        near=np.full(len(me), -1, np.int32),
        close=np.zeros(len(me), np.int32),
        plane=np.zeros((len(me), 6), np.float32),
        found=np.zeros(3, np.int32),
        side=np.float32(side),
        thickness=np.float32(0.5 * (me.material.thickness + it.material.thickness)),
        friction=np.float32(mean_friction),
        reach=np.float32(_REACH * max(_edge_length(me), _edge_length(it))),
        way=np.zeros(1, np.float32),
        pushed=np.zeros(len(me), np.float32),
    )
    search = _Search(
        edges=_edges(me),
        apart=np.flatnonzero(~meets).astype(np.int32),
        start=np.zeros(cells + 1, np.int32),
        entry=np.zeros(len(triangles), np.int32),
    )
    return meeting, search


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


def _one_at_each(model: ClothModel) -> IntArray:
    """A triangle at each particle, as particles, shape [n, 3]."""
    triangles = model.particle_triangles
    own = np.zeros((len(model), 3), np.int32)
    own[triangles.ravel()] = np.repeat(triangles, 3, axis=0)
    return own


def _edges(model: ClothModel) -> IntArray:
    """Pairs of particles, shape [e, 2]."""
    return model.particle[mesh_topology(model.triangles).edges]


def _edge_length(model: ClothModel) -> float:
    edges = _edges(model)
    return float(np.linalg.norm(model.rest[edges[:, 0]] - model.rest[edges[:, 1]], axis=1).mean())
