"""What resists strain in the plane, whatever the sub-step: springs along edges, or triangles."""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.sim.elastic import with_bands
from garment_sim_ros.sim.elasticity import edge_stiffness
from garment_sim_ros.sim.membrane import Law, membrane
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.rest_shape import edge_lengths
from garment_sim_ros.sim.solvers.xpbd.edges import prepare_edges
from garment_sim_ros.sim.solvers.xpbd.order import in_fours, inward_order
from garment_sim_ros.sim.solvers.xpbd.prepared import Edges, Triangles
from garment_sim_ros.sim.solvers.xpbd.triangles import NUMBERS, prepare_triangles


class Springs(NamedTuple):
    """Edges as springs, in the order of a pass.

    Attributes:
        stiffness: Stiffnesses [N/m], shape [m].
        rest_squared: Squared rest lengths [m^2], shape [m].
        ready: What sub-steps need of them.
    """

    stiffness: FloatArray
    rest_squared: FloatArray
    ready: Edges

    @classmethod
    def of(cls, edges: IntArray, stiffness: FloatArray, length: FloatArray) -> "Springs":
        """Some edges [m, 2], put into fours."""
        order, fours = in_fours(edges)
        return cls(
            stiffness=stiffness[order],
            rest_squared=length[order] ** 2,
            ready=Edges(
                particles=np.ascontiguousarray(edges[order].ravel(), np.uint32),
                numbers=np.zeros((4, len(edges)), np.float32),
                fours=fours,
                pull=np.zeros(len(edges), np.float32),
            ),
        )

    def prepare(self, inverse_mass: SingleArray, keep: float, dt: float) -> None:
        """Fills `ready` for sub-steps of dt [s] in which damping leaves a part of velocity."""
        ready = self.ready
        prepare_edges(
            *(ready.particles, self.stiffness, inverse_mass, self.rest_squared),
            *(keep, dt, ready.numbers),
        )


def _edges_of(model: ClothModel) -> tuple[IntArray, FloatArray]:
    """Edges of a garment in the order of a pass, shape [m, 2], and their rest lengths [m]."""
    triangles, springs = model.particle_triangles, model.springs
    edges = springs.particles.reshape(-1, 2)[springs.bending :].astype(np.int32)
    edges = edges[inward_order(edges, triangles, model.free_count)]
    return edges, edge_lengths(model.corners, triangles, edges)


def springs_of(model: ClothModel) -> Springs:
    """All edges of a garment, with the bands along them."""
    edges, length = _edges_of(model)
    triangles = model.particle_triangles
    stiffness = edge_stiffness(model.rest, triangles, edges, model.material, model.corners)
    return Springs.of(edges, *with_bands(model.bands, edges, stiffness, length))


def bands_of(model: ClothModel) -> Springs:
    """The edges that bands run along, with nothing but these."""
    edges, length = _edges_of(model)
    stiffness, length = with_bands(model.bands, edges, np.zeros(len(edges)), length)
    banded = stiffness > 0.0
    return Springs.of(edges[banded], stiffness[banded], length[banded])


class Shapes(NamedTuple):
    """Triangles in the order of a pass, in fours; what is in none is there four times.

    Attributes:
        along: See `Membrane`, shape [t, 2, 2].
        area: Areas [m^2], shape [t].
        warp: Stiffness along the warp [N/m].
        ready: What sub-steps need of them.
    """

    along: FloatArray
    area: FloatArray
    warp: float
    ready: Triangles

    def prepare(self, inverse_mass: SingleArray, keep: float, dt: float) -> None:
        """As `Springs.prepare`."""
        ready = self.ready
        prepare_triangles(
            *(ready.particles, self.along, self.area, self.warp, inverse_mass),
            *(keep, dt, ready.numbers),
        )


def triangles_of(model: ClothModel) -> Shapes:
    """All triangles of a garment that have a free corner."""
    cloth, law = membrane(model), Law.of(model.material)
    order = inward_order(cloth.particles, model.particle_triangles, model.free_count)
    fours, full = in_fours(cloth.particles[order])
    order = order[np.concatenate([fours[:full], np.repeat(fours[full:], 4)])]
    return Shapes(
        along=np.ascontiguousarray(cloth.along[order]),
        area=cloth.area[order],
        warp=law.warp,
        ready=Triangles(
            particles=np.ascontiguousarray(cloth.particles[order].ravel(), np.uint32),
            numbers=np.zeros(NUMBERS * len(order), np.float32),
            law=law.in_shares,
            stress=np.zeros(3 * len(order), np.float32),
        ),
    )
