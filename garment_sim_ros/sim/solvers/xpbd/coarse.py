"""A coarse level of a garment: stretch along its threads, between cells of some ten particles.

In a sub-step of h everything falls by g h^2, and one pass over the edges brings it back if each
edge is too long by some n g h^2, with n more of them hanging on it: a strain that has nothing to
do with the fabric. Cells k edges wide, which move as one, make chains of n / k, with 1 / k^2 of
that strain (Mueller 2008, "Hierarchical position based dynamics", has the idea).

Neighbouring cells make triangles of their centres of mass. Two constraints keep each from being
stretched, along the warp and along the weft (those of Mueller et al. 2014, "Strain based
dynamics", without shear: a net of bars in all directions would hold the bias, too, along which
woven cloth gives a hundred times as much). Where the cloth is bent or folded centres are nearer
than they were cut, and nothing acts, but for what is shorter by less than 0.2 %: if triangles only
pulled they would draw cloth together sideways until it buckles.

Triangles have the fabric's stiffness, and act on a stretch as far as it is an error of the pass:
where sub-steps are so short that edges alone are right, they do nothing. Constraints of centres of
mass keep momentum and add no energy. Single particles for centres, which move what is around them
the less the farther it is, leave as little stretch, but they feel one thing and move another:
cloth under ten times its weight never came to rest.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IndexArray, IntArray, SingleArray
from garment_sim_ros.geometry.geodesics import mesh_graph
from garment_sim_ros.geometry.straight_lines import StraightLines
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.sim.elasticity import warp_directions
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.solvers.xpbd.order import inward_levels

_SPACING = 3.0
"""Least distance of cells' seeds, in mean edge lengths."""
_SLIMMEST = 0.2
"""Triangles whose height is a smaller part of their longest side are left out."""
_OF_EDGES = 0.8
"""Stiffness of the edges along a thread of a mesh of equilateral triangles, over the fabric's."""


class CoarseLevel(NamedTuple):
    """Cells of a garment, and triangles of neighbours.

    Attributes:
        cell: Cell of each particle, shape [n], or [0] without a coarse level.
        part: Its part of the cell's mass, shape [n].
        free: Number of free particles, the first ones: only they move.
        corners: Cells of the triangles, flat, in the order of a pass, shape [3 t].
        strains: For a sub-step, along warp and weft of each triangle: how a metre of cloth goes
            along the sides from its first corner to the second and third [1/m]; how far the three
            corners move for each metre of stretch, shape [t, 2, 5].
        sides: Of each triangle laid flat, one over their squared lengths [1/m^2], shape [t, 3].
        centre: Scratch: centres of mass of the cells [m], shape [c, 3].
        shift: Scratch: how far they are moved [m], shape [c, 3].
    """

    cell: IndexArray
    part: SingleArray
    free: int
    corners: IndexArray
    strains: SingleArray
    sides: SingleArray
    centre: SingleArray
    shift: SingleArray

    @classmethod
    def none(cls) -> "CoarseLevel":
        """No cells."""
        return cls(
            cell=np.zeros(0, np.uint32),
            part=np.zeros(0, np.float32),
            free=0,
            corners=np.zeros(0, np.uint32),
            strains=np.zeros((0, 2, 5), np.float32),
            sides=np.zeros((0, 3), np.float32),
            centre=np.zeros((0, 3), np.float32),
            shift=np.zeros((0, 3), np.float32),
        )


class Threads(NamedTuple):
    """What triangles of cells are made of, whatever the sub-step.

    Attributes:
        along: How a metre of warp and of weft goes along a triangle's sides from its first corner
            to the second and third [1/m], shape [t, 2, 2].
        area: Areas laid flat [m^2], shape [t].
        stiffness: Of warp and weft [N/m], shape [2].
        inverse_mass: Inverse masses of the corners [1/kg], shape [t, 3].
        particle: Inverse masses of a particle in them, in the mean [1/kg], shape [t].
    """

    along: FloatArray
    area: FloatArray
    stiffness: FloatArray
    inverse_mass: FloatArray
    particle: FloatArray


def coarse_level(model: ClothModel, edges: IntArray) -> tuple[CoarseLevel, Threads] | None:
    """Cells of a garment and triangles of them; None if it is too small or narrow for any.

    Args:
        model: The garment.
        edges: Its edges as particles, shape [e, 2].
    """
    if not len(edges):
        return None
    n, free, rest = len(model), model.free_count, model.rest
    triangles = model.particle_triangles
    spacing = _SPACING * float(np.linalg.norm(np.diff(rest[edges], axis=1), axis=2).mean())
    seed, cell, reached = _cells(model, triangles, spacing)
    count = len(seed)
    mass = np.bincount(cell, model.mass, count)
    part = model.mass / mass[cell]
    held = np.bincount(cell[:free], minlength=count) == 0
    inverse_mass = np.where(held, 0.0, 1.0 / mass)

    # Cells that meet in a triangle of the mesh are the corners of a coarse one.
    corners = cell[triangles]
    corners = corners[(np.diff(np.sort(corners, axis=1), axis=1) > 0).all(axis=1)]
    corners = corners[np.unique(np.sort(corners, axis=1), axis=0, return_index=True)[1]]
    sides = corners[:, [[0, 1], [0, 2], [1, 2]]]
    known = reached.holds(sides[..., 0], seed[sides[..., 1]]).all(axis=1)
    corners = corners[known & (inverse_mass[corners].sum(axis=1) > 0.0)]
    sides = corners[:, [[0, 1], [0, 2], [1, 2]]]
    way = reached.way(sides[..., 0], seed[sides[..., 1]])
    centre = np.stack([np.bincount(cell, part * x, count) for x in rest.T], axis=1)
    normal = np.zeros((n, 3), np.float32)
    vertex_normals(rest.astype(np.float32), triangles, normal)
    beside, normal = centre - rest[seed], normal[seed]
    beside -= (beside * normal).sum(axis=1, keepdims=True) * normal
    flat, threads = _laid_flat(rest[seed], beside, corners, way)
    e, f = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    doubled = np.abs(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0])
    squared = np.stack([(side**2).sum(axis=1) for side in (e, f, f - e)], axis=1)
    good = doubled > _SLIMMEST * squared.max(axis=1)
    if not good.any():
        return None
    corners, area = corners[good], 0.5 * doubled[good]
    along = np.linalg.solve(np.stack([e, f], axis=2)[good], threads[good]).transpose(0, 2, 1)

    order = np.argsort(inward_levels(triangles, free)[seed[corners]].sum(axis=1), kind="stable")
    corners, material = corners[order], model.material
    level = CoarseLevel(
        cell=cell.astype(np.uint32),
        part=part.astype(np.float32),
        free=free,
        corners=np.ascontiguousarray(corners.ravel(), np.uint32),
        strains=np.zeros((len(corners), 2, 5), np.float32),
        sides=(1.0 / squared[good][order]).astype(np.float32),
        centre=np.zeros((count, 3), np.float32),
        shift=np.zeros((count, 3), np.float32),
    )
    return level, Threads(
        along=along[order],
        area=area[order],
        stiffness=np.array([material.stretch_stiffness_warp, material.stretch_stiffness_weft]),
        inverse_mass=inverse_mass[corners],
        particle=(np.bincount(cell, minlength=count) / mass)[corners].mean(axis=1),
    )


def prepare_cells(level: CoarseLevel, threads: Threads, keep: float, dt: float) -> None:
    """What a sub-step needs of each triangle.

    Args:
        level: Cells and triangles; `strains` is filled.
        threads: What they are made of.
        keep: Part of velocity that damping leaves in a sub-step; of what forces add, too.
        dt: Sub-step [s].
    """
    u, v = threads.along[..., 0], threads.along[..., 1]
    gradient = np.stack([-u - v, u, v], axis=2)
    w = keep * threads.inverse_mass[:, None] * gradient
    pull = threads.area[:, None] * threads.stiffness * dt * dt
    # At rest an edge along the thread is too long by its compliance 1 / k h^2 and by about half of
    # what a pass over it alone moves: each pass meets what those before it moved. Triangles are
    # for the latter part, which falls with dt^2. Cubed, because they are not quite as the fabric
    # is: what they add to the error falls with dt^6, and is never most of it.
    rigid = keep * threads.particle[:, None] * _OF_EDGES * threads.stiffness * dt * dt
    share = (rigid / (rigid + 1.0)) ** 3 * pull / ((w * gradient).sum(axis=2) * pull + 1.0)
    level.strains[..., :2] = threads.along
    level.strains[..., 2:] = w * share[..., None]


def _laid_flat(
    seed: FloatArray, beside: FloatArray, corners: IntArray, way: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Triangles of cells laid in a plane, whose x axis leads from the first seed to the second.

    Args:
        seed: Places of all seeds [m], shape [c, 3].
        beside: Ways over the cloth from seeds to centres of mass [m], shape [c, 3].
        corners: Cells of the triangles, shape [t, 3].
        way: Ways over the cloth between seeds: of the first two, the outer two, the last two [m],
            shape [t, 3].

    Returns:
        Centres of mass [m], shape [t, 3, 2]; warp and weft as unit columns, shape [t, 2, 2].
    """
    a, b, c = (seed[corners[:, k]] for k in range(3))
    axis = (b - a) / np.maximum(np.linalg.norm(b - a, axis=1, keepdims=True), 1e-30)
    up = np.cross(np.cross(b - a, c - a), axis)
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-30)
    plane = np.stack([axis, up], axis=1)
    first, second, third = way.T
    flat = np.einsum("tkj,tdj->tkd", beside[corners], plane)
    x = (first**2 + second**2 - third**2) / (2.0 * np.maximum(first, 1e-30))
    flat[:, 1, 0] += first
    flat[:, 2, 0] += x
    flat[:, 2, 1] += np.sqrt(np.maximum(second**2 - x**2, 0.0))
    cos, sin = np.einsum("tdj,tj->dt", plane, warp_directions(seed, corners))
    threads = np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=2)
    return flat, threads


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
