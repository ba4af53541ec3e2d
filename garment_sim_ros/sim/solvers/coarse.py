"""A coarse level of a garment's edges: links between the middles of cells of some ten particles.

In a sub-step of h everything falls by g h^2, and one pass over the edges brings it back if each
edge is too long by some n g h^2, with n more of them hanging on it: a strain that has nothing to
do with the fabric. Cells k edges wide, which move as one, make chains of n / k links, with 1 / k^2
of that strain (Mueller 2008, "Hierarchical position based dynamics", has the idea).

A link joins the centres of mass of two cells, which are as far apart as when the cloth lies flat,
or nearer where it is bent or folded: a link pulls, and pushes back by no more than 0.2 % of its
length. (If it only pulled, a net of links would draw cloth together sideways until it buckles.)
Links have the fabric's stiffness, and leave to edges the part of a stretch for which these have
the force: where sub-steps are so short that edges alone are right, links do nothing.

Constraints of centres of mass keep momentum and add no energy. Single particles for centres, which
move what is around them the less the farther it is, leave as little stretch, but they feel one
thing and move another: cloth under ten times its weight never came to rest.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, diags_array

from garment_sim_ros.geometry.geodesics import mesh_edges, mesh_graph
from garment_sim_ros.geometry.straight_lines import StraightLines
from garment_sim_ros.sim.elasticity import edge_stiffness
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.solvers.sweep_order import inward_order

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
IntArray = NDArray[np.int32]
IndexArray = NDArray[np.uint32]

_SPACING = 3.0
"""Least distance of cells' seeds, in mean edge lengths."""
_FIRMNESS = 0.8
"""Stiffness of links as a part of the fabric's: they do not contract sideways as it does."""


class CoarseLevel(NamedTuple):
    """Cells of a garment, and links between neighbours.

    Attributes:
        cell: Cell of each particle, shape [n], or [0] without a coarse level.
        part: Its part of the cell's mass, shape [n].
        free: Number of free particles, the first ones: only they move.
        ends: Cells that the links join, flat, in the order of a pass, shape [2 m].
        links: For a sub-step: rest length [m], and how far each end moves for each metre of
            stretch, shape [m, 3].
        centre: Scratch: centres of mass of the cells [m], shape [c, 3].
        shift: Scratch: how far links move them [m], shape [c, 3].
    """

    cell: IndexArray
    part: SingleArray
    free: int
    ends: IndexArray
    links: SingleArray
    centre: SingleArray
    shift: SingleArray

    @classmethod
    def none(cls) -> "CoarseLevel":
        """No cells."""
        return cls(
            cell=np.zeros(0, np.uint32),
            part=np.zeros(0, np.float32),
            free=0,
            ends=np.zeros(0, np.uint32),
            links=np.zeros((0, 3), np.float32),
            centre=np.zeros((0, 3), np.float32),
            shift=np.zeros((0, 3), np.float32),
        )


class LinkMaterial(NamedTuple):
    """What links are made of, whatever the sub-step.

    Attributes:
        length: Rest lengths [m], shape [m].
        stiffness: Stiffnesses [N/m], shape [m].
        inverse_mass: Inverse masses of the cells that they join [1/kg], shape [m, 2].
        near: Shares of the edges around each link, by their stiffness, sparse, shape [m, edges].
    """

    length: FloatArray
    stiffness: FloatArray
    inverse_mass: FloatArray
    near: Any


def coarse_level(
    model: ClothModel, edges: IntArray, stiffness: FloatArray
) -> tuple[CoarseLevel, LinkMaterial] | None:
    """Cells of a garment and links between them; None if it is too small or narrow for any.

    Args:
        model: The garment.
        edges: Its edges as particles, shape [e, 2].
        stiffness: Their stiffnesses [N/m], shape [e].
    """
    if not len(edges):
        return None
    n, free, rest = len(model), model.free_count, model.rest
    particle = np.empty(n, np.int32)
    particle[model.vertex] = np.arange(n, dtype=np.int32)
    triangles = particle[model.triangles]
    spacing = _SPACING * float(np.linalg.norm(np.diff(rest[edges], axis=1), axis=2).mean())
    seed, cell, reached = _cells(model, triangles, spacing)
    count = len(seed)
    mass = np.bincount(cell, model.mass, count)
    part = model.mass / mass[cell]
    held = np.bincount(cell[:free], minlength=count) == 0
    inverse_mass = np.where(held, 0.0, 1.0 / mass)

    # Cells that meet in a triangle are corners of one of the coarse level; its edges are links.
    corners = np.sort(cell[triangles], axis=1)
    corners = np.unique(corners[(np.diff(corners, axis=1) > 0).all(axis=1)], axis=0)
    ends = mesh_edges(corners)
    ends = ends[
        (inverse_mass[ends].sum(axis=1) > 0.0) & reached.holds(ends[:, 0], seed[ends[:, 1]])
    ]
    if not len(ends):
        return None
    ends = ends[inward_order(seed[ends], triangles, free)]
    way = reached.way(ends[:, 0], seed[ends[:, 1]])
    firmness = _FIRMNESS * edge_stiffness(rest[seed], corners, ends, model.material)

    # From seed to seed straight over the cloth; from there to the centres as cut.
    centre = np.stack([np.bincount(cell, part * x, count) for x in rest.T], axis=1)
    apart = rest[seed[ends[:, 1]]] - rest[seed[ends[:, 0]]]
    apart *= (way / np.maximum(np.linalg.norm(apart, axis=1), 1e-30))[:, None]
    beside = (centre - rest[seed])[ends]
    length = np.linalg.norm(apart + beside[:, 1] - beside[:, 0], axis=1)

    e = np.tile(np.arange(len(edges)), 2)
    around = coo_matrix(
        (np.tile(stiffness, 2), (cell[edges].T.ravel(), e)), shape=(count, len(edges))
    ).tocsr()
    near = around[ends[:, 0]] + around[ends[:, 1]]
    near = diags_array(1.0 / np.maximum(np.asarray(near.sum(axis=1)).ravel(), 1e-30)) @ near

    level = CoarseLevel(
        cell=cell.astype(np.uint32),
        part=part.astype(np.float32),
        free=free,
        ends=np.ascontiguousarray(ends.ravel(), np.uint32),
        links=np.zeros((len(ends), 3), np.float32),
        centre=np.zeros((count, 3), np.float32),
        shift=np.zeros((count, 3), np.float32),
    )
    return level, LinkMaterial(length, firmness, inverse_mass[ends], near)


def prepare_links(
    level: CoarseLevel, material: LinkMaterial, left: SingleArray, keep: float, dt: float
) -> None:
    """What a sub-step needs of each link.

    Args:
        level: Cells and links; `links` is filled.
        material: What they are made of.
        left: Part of its stretch that a pass leaves in each edge for its compliance, shape [e].
        keep: Part of velocity that damping leaves in a sub-step; of what forces add, too.
        dt: Sub-step [s].
    """
    w = keep * material.inverse_mass
    pull = material.stiffness * dt * dt
    # At rest an edge is too long by its compliance and by about half of what a pass over that edge
    # alone moves: each pass meets what those before it moved. Links take the part of the latter.
    compliant = material.near @ left.astype(np.float64)
    share = (1.0 - compliant) / (1.0 + compliant) * pull / (w.sum(axis=1) * pull + 1.0)
    level.links[:, 0] = material.length
    level.links[:, 1:] = w * share[:, None]


class _Reached:
    """Ways over the cloth from seeds to the particles around them."""

    def __init__(self, members: list[IntArray], ways: list[FloatArray], n: int) -> None:
        """From each seed in turn: particles, ascending, and how far they are [m]; of n in all."""
        self._n = n
        seed = np.repeat(np.arange(len(members)), [len(m) for m in members])
        self._key = seed * n + np.concatenate(members)
        self._way = np.concatenate(ways)

    def _at(self, seed: IntArray, particle: IntArray) -> tuple[Any, Any]:
        wanted = seed.astype(np.int64) * self._n + particle
        at = np.minimum(np.searchsorted(self._key, wanted), len(self._key) - 1)
        return at, wanted

    def holds(self, seed: IntArray, particle: IntArray) -> NDArray[np.bool_]:
        """Whether particles are around seeds, given by number."""
        at, wanted = self._at(seed, particle)
        there: NDArray[np.bool_] = self._key[at] == wanted
        return there

    def way(self, seed: IntArray, particle: IntArray) -> FloatArray:
        """How far they are [m]."""
        way: FloatArray = self._way[self._at(seed, particle)[0]]
        return way


def _cells(
    model: ClothModel, triangles: IntArray, spacing: float
) -> tuple[IntArray, IntArray, _Reached]:
    """Seeds, none nearer to another than `spacing`; the nearest one of each particle; ways.

    The next seed is the particle nearest to pins, or to any one particle, which is not covered
    yet: so they come in rows. Of those as near, the file's order decides.
    """
    n = len(model)
    graph = mesh_graph(model.rest, triangles)
    straight = StraightLines(model.rest, triangles)
    pins = np.arange(model.free_count, n, dtype=np.int32)
    first, _ = graph.distances(pins if len(pins) else int(np.argmin(model.vertex)))
    to_nearest, cell = np.full(n, np.inf), np.zeros(n, np.int32)
    seeds: list[int] = []
    members, ways = [], []
    rank = np.round(np.nan_to_num(first, posinf=1e30) / spacing, 4)
    for p in np.lexsort((model.vertex, rank)):
        if to_nearest[p] < spacing:
            continue
        way, _ = graph.distances(int(p), limit=2.0 * spacing)
        straight.shorten(int(p), 2.0 * spacing, way)
        near = np.flatnonzero(way <= 2.0 * spacing).astype(np.int32)
        nearer = near[way[near] < to_nearest[near]]
        to_nearest[nearer] = way[nearer]
        cell[nearer] = len(seeds)
        seeds.append(int(p))
        members.append(near)
        ways.append(way[near])
    return np.array(seeds, np.int32), cell, _Reached(members, ways, n)
