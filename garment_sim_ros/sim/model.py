"""What stays constant while a garment is simulated."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IndexArray, IntArray, SingleArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.colouring import order_by_colour
from garment_sim_ros.geometry.locality import spatial_order
from garment_sim_ros.geometry.topology import hinge_vertices, mesh_topology
from garment_sim_ros.geometry.triangles import triangle_areas
from garment_sim_ros.params import Environment, Material
from garment_sim_ros.sim.elastic import ElasticEdges, with_bands
from garment_sim_ros.sim.elasticity import edge_stiffness
from garment_sim_ros.sim.rest_shape import edge_lengths, unfolded, upright

_LIGHTEST = 0.01
"""Lowest mass of a particle as a share of the mean: slivers would leave some without any."""


@dataclass(frozen=True, kw_only=True)
class Springs:
    """Springs in the order in which they are corrected; each has at least one free end.

    Attributes:
        particles: Their ends as particles, flat, shape [2 m]. Unsigned: compiled code then need
            not look for negative indices.
        rest_length: Lengths at which they are at rest [m], shape [m].
        drawn_length: The same with elastic bands along them [m], shape [m].
        share: Part of a correction that the first end takes, w0 / (w0 + w1), shape [m].
        colour_start: Where each colour starts, shape [colours + 1].
        bending: The first so many springs resist bending, the others stretch and shear.
    """

    particles: IndexArray
    rest_length: SingleArray
    drawn_length: SingleArray
    share: SingleArray
    colour_start: IntArray
    bending: int

    def __len__(self) -> int:
        return len(self.rest_length)


@dataclass(frozen=True, kw_only=True)
class ClothModel:
    """One garment as particles and springs.

    Particles are the mesh's vertices in an order of their own: free ones first, compact blocks in
    space; then those with zero inverse mass. Every array is read-only.

    Attributes:
        name: The garment's name.
        vertex: The vertex that each particle is, shape [n].
        triangles: Vertex indices of the mesh, shape [t, 3].
        rest: Rest positions of the particles [m], shape [n, 3].
        free_count: Number of free particles.
        mass: Masses [kg], of pinned ones too, shape [n].
        inverse_mass: Inverse masses [1/kg], 0 for pinned ones, shape [n].
        springs: Its springs.
        pin_collider: Collider of the set that each pinned particle follows, shape [n - free].
        pin_position: Their positions in that collider's frame [m], shape [n - free, 3].
        material: Its fabric.
        corners: Rest positions of each triangle's corners [m], shape [t, 3, 3]. Of cloth that was
            cut flat, where they lie in its panel, upright, warp up; else those of its particles.
        bands: Elastic bands along its edges, as particles.
    """

    name: str
    vertex: IntArray
    triangles: IntArray
    rest: FloatArray
    free_count: int
    mass: SingleArray
    inverse_mass: SingleArray
    springs: Springs
    pin_collider: IntArray
    pin_position: FloatArray
    material: Material
    corners: FloatArray
    bands: ElasticEdges

    def __len__(self) -> int:
        return len(self.vertex)

    @property
    def particle(self) -> IntArray:
        """The particle that each vertex is, shape [n]."""
        particle = np.empty(len(self), np.int32)
        particle[self.vertex] = np.arange(len(self), dtype=np.int32)
        return particle

    @property
    def particle_triangles(self) -> IntArray:
        """The mesh's triangles as particles, shape [t, 3]."""
        return self.particle[self.triangles]


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """What a solver's step needs beside the model; may change from step to step.

    Attributes:
        environment: Outer forces.
        settings: Numerical parameters of the solver, of the group that it names.
    """

    environment: Environment
    settings: Any

    def in_environment(self, environment: Environment) -> "Parameters":
        """The same with other outer forces."""
        same = environment is self.environment
        return self if same else Parameters(environment=environment, settings=self.settings)


def _frozen(array: NDArray[Any], dtype: type) -> NDArray[Any]:
    array = np.ascontiguousarray(array, dtype=dtype)
    array.setflags(write=False)
    return array


def vertex_masses(
    vertices: FloatArray,
    triangles: IntArray,
    areal_density: float,
    corners: FloatArray | None = None,
) -> FloatArray:
    """A third of each triangle's mass for each of its vertices [kg], shape [v].

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        areal_density: Mass per area [kg/m^2].
        corners: Where triangles have their areas, as `ClothModel.corners`; None: in `vertices`.
    """
    if corners is None:
        corners = np.asarray(vertices, dtype=np.float64)[triangles]
    area = triangle_areas(
        corners.reshape(-1, 3), np.arange(len(corners) * 3, dtype=np.int32).reshape(-1, 3)
    )
    share = np.repeat(areal_density * area / 3, 3)
    mass = np.zeros(len(vertices))
    np.add.at(mass, triangles.ravel(), share)
    return mass


def _springs(
    vertices: FloatArray,
    triangles: IntArray,
    weight: FloatArray,
    corners: FloatArray | None,
    material: Material,
    bands: ElasticEdges,
) -> Springs:
    """Springs of a mesh whose vertices are already in the order of the particles.

    Bending springs come first in a sweep: the correction done last holds best, and stretch shows
    more than bending.
    """
    topology = mesh_topology(triangles)
    pairs, lengths, colour_start = [], [], [0]
    for kind in (topology.opposite, topology.edges):
        if corners is None:
            rest = np.linalg.norm(vertices[kind[:, 0]] - vertices[kind[:, 1]], axis=1)
        elif kind is topology.edges:
            rest = edge_lengths(corners, triangles, kind)
        else:
            rest = _across(corners, triangles, kind)
        movable = weight[kind].sum(axis=1) > 0.0
        order, colours = order_by_colour(kind[movable])
        pairs.append(kind[movable][order])
        lengths.append(rest[movable][order])
        colour_start += (colours[1:] + colour_start[-1]).tolist()
    springs = np.concatenate(pairs)
    w = weight[springs]
    drawn = lengths[1]
    if len(bands.edges):
        stiffness = edge_stiffness(vertices, triangles, pairs[1], material, corners)
        _, drawn = with_bands(bands, pairs[1], stiffness, drawn)
    return Springs(
        particles=_frozen(springs.ravel(), np.uint32),
        rest_length=_frozen(np.concatenate(lengths), np.float32),
        drawn_length=_frozen(np.concatenate([lengths[0], drawn]), np.float32),
        share=_frozen(w[:, 0] / w.sum(axis=1), np.float32),
        colour_start=_frozen(np.array(colour_start), np.int32),
        bending=len(pairs[0]),
    )


def _across(corners: FloatArray, triangles: IntArray, opposite: IntArray) -> FloatArray:
    """Rest lengths of springs across the edges of cloth that was cut flat [m], shape [b]."""
    hinges = hinge_vertices(triangles)
    length = unfolded(corners, triangles, hinges)
    _, index = np.unique(np.sort(hinges[:, 2:], axis=1), axis=0, return_inverse=True)
    mean: FloatArray = np.bincount(index.ravel(), length) / np.bincount(index.ravel())
    return mean


def _check(name: str, vertices: FloatArray, triangles: IntArray) -> None:
    """See that a mesh can be cloth; see `build_model` for what is raised."""
    v = len(vertices)
    if vertices.shape != (v, 3) or not np.isfinite(vertices).all():
        raise GeometryError(f"garment {name!r}: vertices must be finite, shape [v, 3]")
    if not triangles.size or triangles.shape[1:] != (3,):
        raise GeometryError(f"garment {name!r}: needs triangles, shape [t, 3]")
    if triangles.min() < 0 or triangles.max() >= v:
        raise GeometryError(f"garment {name!r}: triangle indices must lie in 0..{v - 1}")
    loose = np.setdiff1d(np.arange(v), triangles)
    if len(loose):
        raise GeometryError(
            f"garment {name!r}: {len(loose)} vertices belong to no triangle, the first is "
            f"{loose[0]}; every vertex must"
        )


def build_model(
    name: str,
    vertices: FloatArray,
    triangles: IntArray,
    material: Material,
    *,
    pins: IntArray | None = None,
    pin_collider: IntArray | None = None,
    pin_position: FloatArray | None = None,
    flat: FloatArray | None = None,
    elastic: ElasticEdges | None = None,
) -> ClothModel:
    """Builds the particles and springs of one garment.

    Every mesh edge is a stretch-shear spring; for every pair of adjacent triangles, the two
    vertices that they do not share are joined by a bending spring (Sun et al. 2007, section 1.1).

    Args:
        name: The garment's name.
        vertices: Rest positions, in which no spring is strained [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        material: Its fabric; masses come from its areal density.
        pins: Vertices with zero inverse mass, shape [p]; those named twice count once.
        pin_collider: Collider of the set that each pin follows, shape [p].
        pin_position: Position of each pin in that collider's frame [m], shape [p, 3].
        flat: Where each triangle's corners lie in the panel that it was cut from, weft and warp
            [m], shape [t, 3, 2]: no spring is strained there. None: in `vertices`.
        elastic: Elastic bands along its edges; None: there are none.

    Raises:
        GeometryError: No triangles, an index or a coordinate that is not usable, a vertex that
            belongs to no triangle, or a mesh without area.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    triangles = np.ascontiguousarray(triangles, dtype=np.int32)
    _check(name, vertices, triangles)
    v = len(vertices)
    corners = vertices[triangles] if flat is None else upright(flat, len(triangles), name)
    mass = vertex_masses(vertices, triangles, material.areal_density, corners)
    if not mass.mean() > 0.0:
        raise GeometryError(f"garment {name!r}: its triangles have no area")
    mass = np.maximum(mass, _LIGHTEST * mass.mean())

    pinned, first = np.unique(np.zeros(0, np.int32) if pins is None else pins, return_index=True)
    free = np.setdiff1d(np.arange(v, dtype=np.int32), pinned)
    vertex = np.concatenate([free[spatial_order(vertices[free])], pinned.astype(np.int32)])
    particle = np.empty(v, np.int32)
    particle[vertex] = np.arange(v, dtype=np.int32)
    inverse_mass = 1.0 / mass[vertex]
    inverse_mass[len(free) :] = 0.0
    bands = (elastic or ElasticEdges.none()).renamed(particle)
    return ClothModel(
        name=name,
        vertex=_frozen(vertex, np.int32),
        triangles=_frozen(triangles, np.int32),
        rest=_frozen(vertices[vertex], np.float64),
        free_count=len(free),
        mass=_frozen(mass[vertex], np.float32),
        inverse_mass=_frozen(inverse_mass, np.float32),
        springs=_springs(
            vertices[vertex],
            particle[triangles],
            inverse_mass,
            None if flat is None else corners,
            material,
            bands,
        ),
        pin_collider=_frozen(
            np.zeros(0) if pin_collider is None else np.asarray(pin_collider)[first], np.int32
        ),
        pin_position=_frozen(
            np.zeros((0, 3)) if pin_position is None else np.asarray(pin_position)[first],
            np.float64,
        ),
        material=material,
        corners=_frozen(corners, np.float64),
        bands=bands,
    )
