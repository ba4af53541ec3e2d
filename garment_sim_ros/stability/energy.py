"""Kinetic and potential energy of all garments of a simulation."""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.sim.energy import Elastic, energies
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.solver_params import SPRINGS


class Energy:
    """Kinetic and potential energy of all garments."""

    def __init__(self, simulation: Simulation, gravity: tuple[float, ...]) -> None:
        self._simulation = simulation
        self._gravity = np.array(gravity)
        kind = getattr(simulation.parameters.settings, "membrane", SPRINGS)
        self._elastic = {view.name: Elastic.of(view.model, kind) for view in simulation}

    def now(self) -> FloatArray:
        """Kinetic, gravitational and elastic energy [J], shape [3].

        Elastic is what cloth holds by the fabric's stiffness; only free particles count for the
        other two.
        """
        total = np.zeros(3)
        for view in self._simulation:
            free = view.model.free_count
            mass = view.model.mass.astype(np.float64)
            mass[free:] = 0.0
            x = view.state.x.astype(np.float64) + self._simulation.origin
            v = view.state.v.astype(np.float64)
            total += energies(mass, self._gravity, self._elastic[view.name], x, v)
        return total
