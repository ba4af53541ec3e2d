"""Energy of cloth: of its motion, in the field of gravity, and what it stores."""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.sim.elastic import with_bands
from garment_sim_ros.sim.elasticity import Hinges, edge_stiffness, hinges
from garment_sim_ros.sim.membrane import Law, Membrane, membrane, stored
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.rest_shape import edge_lengths
from garment_sim_ros.solver_params import TRIANGLES


class Elastic(NamedTuple):
    """What stores energy in a garment.

    Attributes:
        edges: Ends of the springs, shape [m, 2].
        length: Their rest lengths [m], shape [m].
        stiffness: Their stiffnesses, one over their compliances [N/m], shape [m].
        hinges: Pairs of triangles that resist bending; None: there are none.
        cloth: Triangles that act instead of the mesh's edges, with their law; None: springs do.
    """

    edges: IntArray
    length: FloatArray
    stiffness: FloatArray
    hinges: Hinges | None = None
    cloth: tuple[Membrane, Law] | None = None

    @classmethod
    def of(cls, model: ClothModel, kind: str) -> "Elastic":
        """That of a garment, from the functions that the solvers take it from.

        Where a solver takes a fabric as less stiff than it is (`GarmentView.limits`), this is the
        fabric's.

        Args:
            model: The garment.
            kind: Its membrane, springs or triangles.
        """
        triangles, corners = model.particle_triangles, model.corners
        edges = model.springs.particles.reshape(-1, 2)[model.springs.bending :].astype(np.int32)
        cloth = (membrane(model), Law.of(model.material)) if kind == TRIANGLES else None
        own = (
            edge_stiffness(model.rest, triangles, edges, model.material, corners)
            if cloth is None
            else np.zeros(len(edges))
        )
        stiffness, length = with_bands(
            model.bands, edges, own, edge_lengths(corners, triangles, edges)
        )
        bending = hinges(model.rest, triangles, model.material, corners)
        return cls(edges, length, stiffness, bending, cloth)

    def energy(self, x: FloatArray) -> float:
        """Energy stored where particles are at x [m], shape [n, 3]; [J]."""
        apart = x[self.edges[:, 1]] - x[self.edges[:, 0]]
        longer = np.linalg.norm(apart, axis=1) - self.length
        total = 0.5 * float(self.stiffness @ longer**2)
        if self.hinges is not None:
            curvature = np.einsum("hk,hkc->hc", self.hinges.weight, x[self.hinges.particles])
            total += 0.5 * float(self.hinges.stiffness @ (curvature**2).sum(axis=1))
        return total if self.cloth is None else total + stored(x, *self.cloth)


def energies(
    mass: FloatArray, gravity: FloatArray, elastic: Elastic, x: FloatArray, v: FloatArray
) -> FloatArray:
    """Kinetic, gravitational and elastic energy of one garment [J], shape [3].

    Args:
        mass: Of the particles [kg], shape [n].
        gravity: Gravity [m/s^2], shape [3].
        elastic: What stores energy.
        x: World positions [m], shape [n, 3].
        v: Velocities [m/s], shape [n, 3].
    """
    kinetic = 0.5 * mass @ (v**2).sum(axis=1)
    return np.array([kinetic, -mass @ (x @ gravity), elastic.energy(x)])
