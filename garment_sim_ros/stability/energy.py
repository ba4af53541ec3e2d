"""Kinetic and potential energy of all garments of a simulation."""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.sim.elasticity import edge_stiffness
from garment_sim_ros.sim.membrane import Law, membrane, stored
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.rest_shape import edge_lengths
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.solver_params import SPRINGS, TRIANGLES


class Energy:
    """Kinetic and potential energy of all garments."""

    def __init__(self, simulation: Simulation, gravity: tuple[float, ...]) -> None:
        self._simulation = simulation
        self._gravity = np.array(gravity)
        self._springs = {n: _stretch(simulation.model(n)) for n in simulation.names}
        settings = simulation.parameters.settings
        self._has_triangles = getattr(settings, "membrane", SPRINGS) == TRIANGLES

    def outer(self) -> float:
        """Kinetic energy and that in the field of gravity [J]."""
        total = 0.0
        for name in self._simulation.names:
            model, state = self._simulation.model(name), self._simulation.state(name)
            free = model.free_count
            mass = model.mass[:free].astype(np.float64)
            v = state.v[:free].astype(np.float64)
            x = state.x[:free].astype(np.float64) + self._simulation.origin
            total += float(mass @ (0.5 * (v**2).sum(axis=1) - x @ self._gravity))
        return total

    def kinetic(self) -> float:
        """Kinetic energy [J]."""
        total = 0.0
        for name in self._simulation.names:
            model, state = self._simulation.model(name), self._simulation.state(name)
            v = state.v[: model.free_count].astype(np.float64)
            total += float(0.5 * model.mass[: model.free_count] @ (v**2).sum(axis=1))
        return total

    def stored(self) -> float:
        """What stretched cloth holds by the material's stiffness [J]."""
        total = 0.0
        if self._has_triangles:
            for name in self._simulation.names:
                model, x = self._simulation.model(name), self._simulation.state(name).x
                total += stored(x.astype(np.float64), membrane(model), Law.of(model.material))
            return total
        for name, (edges, rest, stiffness) in self._springs.items():
            x = self._simulation.state(name).x.astype(np.float64)
            excess = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1) - rest
            total += float(0.5 * stiffness @ excess**2)
        return total


def _stretch(model: ClothModel) -> tuple[NDArray[np.int32], FloatArray, FloatArray]:
    """Edges, their rest lengths [m] and stiffnesses [N/m]."""
    springs = model.springs
    edges = springs.particles.reshape(-1, 2)[springs.bending :].astype(np.int32)
    triangles = model.particle_triangles
    return (
        edges,
        edge_lengths(model.corners, triangles, edges),
        edge_stiffness(model.rest, triangles, edges, model.material, model.corners),
    )
