"""One garment of a simulation, as its user sees it."""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.sim.health import Health
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.placement import GarmentLike
from garment_sim_ros.sim.state import State
from garment_sim_ros.sim.worn import Worn


class GarmentView:
    """One garment of a simulation; always shows the present.

    Vertices are in the order of the garment's file, whatever order the solver uses. Arrays of
    vertices are new ones in every call.

    Args:
        worn: The garment with all that belongs to it.
        origin: World position that its state is relative to [m], shape [3]; read in every call.

    Attributes:
        worn: As given: scratch arrays and constraints, for those who measure the solver.
    """

    def __init__(self, worn: Worn, origin: FloatArray) -> None:
        self.worn = worn
        self._origin = origin

    @property
    def name(self) -> str:
        """Its name."""
        return self.worn.garment.name

    @property
    def garment(self) -> GarmentLike:
        """Mesh, fabric, frames and pins, as given."""
        return self.worn.given

    @property
    def triangles(self) -> IntArray:
        """Vertex indices, shape [t, 3]."""
        return self.worn.triangles

    @property
    def positions(self) -> SingleArray:
        """World positions of the vertices as they are shown [m], shape [v, 3]."""
        return self.worn.shown(self._origin)

    @property
    def simulated(self) -> SingleArray:
        """The same where the solver has them [m], shape [v, 3].

        They are shown up to some millimetres farther out, where triangles between them cut into
        the body: what judges or goes on with the simulation takes these.
        """
        return self.worn.simulated(self._origin)

    @property
    def velocities(self) -> SingleArray:
        """World velocities of the vertices [m/s], shape [v, 3]."""
        return self.worn.velocities()

    @property
    def normals(self) -> SingleArray:
        """Unit normals of the vertices, shape [v, 3]."""
        normal = np.empty((len(self.worn.x_world), 3), np.float32)
        vertex_normals(self.positions, self.worn.triangles, normal)
        return normal

    @property
    def model(self) -> ClothModel:
        """Its particles and springs, in the solver's order; fewer than vertices with `detail`."""
        return self.worn.model

    @property
    def state(self) -> State:
        """Its motion, in the order of `model` and relative to the simulation's `origin`."""
        return self.worn.state

    @property
    def health(self) -> Health:
        """Counts and readings."""
        return self.worn.health

    @property
    def limits(self) -> tuple[str, ...]:
        """What the solver does not take as the material has it, in words."""
        return self.worn.workspace.limits
