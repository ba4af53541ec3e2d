"""Energy of cloth that moves without losses, and the share of it that a solver loses or makes."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.sim.elastic import with_bands
from garment_sim_ros.sim.elasticity import Hinges, edge_stiffness, hinges
from garment_sim_ros.sim.membrane import Law, Membrane, membrane, stored
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.rest_shape import edge_lengths
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.solver_params import TRIANGLES
from garment_sim_ros.tradeoff.playing import Player
from garment_sim_ros.tradeoff.points import Point
from garment_sim_ros.tradeoff.scenes import Staged

_NO_AIR = {"wind": (0.0, 0.0, 0.0), "wind_drag": 0.0, "wind_lift": 0.0, "gust": 0.0}
_LOSSES = {"damping": 0.0, "air_drag": 0.0, "friction": 0.0}
"""What fabrics lose energy by."""


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


def drift(energy: FloatArray) -> float:
    """Change of the total energy over the energy exchanged: below 0 is lost, above 0 is made.

    Args:
        energy: Kinetic, gravitational and elastic energy in every frame [J], shape [f, 3].

    Returns:
        ``(E(end) - E(start)) / max_k (max_t E_k - min_t E_k)``, E_k the three kinds and E their
        sum; 0 where nothing changes.
    """
    total = energy.sum(axis=1)
    exchanged = float(np.ptp(energy, axis=0).max())
    return float(total[-1] - total[0]) / exchanged if exchanged != 0.0 else 0.0


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


def undamped(staged: Staged) -> Staged:
    """A scene without damping, air and friction."""
    scene = replace(staged.scene, environment={**staged.scene.environment, **_NO_AIR})
    garments = tuple(replace(g, material=replace(g.material, **_LOSSES)) for g in staged.garments)
    return replace(staged, scene=scene, garments=garments)


def energy_drift(staged: Staged, point: Point) -> float | None:
    """The drift of a setting in a scene without a body, from a run of the motion without losses.

    Args:
        staged: The scene.
        point: The setting.

    Returns:
        The drift; None on a body, which does work on the cloth, and of `relaxation`, whose
        springs have no stiffness. Not a number where the run is not finite.

    Raises:
        GarmentSimError: It cannot be simulated.
    """
    if staged.avatar is not None or point.solver == "relaxation":
        return None
    player = Player(undamped(staged), point.arguments(staged.scene.frame))
    player.put_on(settle=False)
    simulation = player.simulation
    kind = simulation.parameters.settings.membrane
    elastic = {view.name: Elastic.of(view.model, kind) for view in simulation}
    rows = [_of_all(simulation, elastic)]
    for n in range(staged.frames):
        player.play(n, n + 1)
        rows.append(_of_all(simulation, elastic))
    return drift(np.array(rows))


def _of_all(simulation: Simulation, elastic: dict[str, Elastic]) -> FloatArray:
    """The sum over all garments as they are now [J], shape [3]."""
    gravity = np.array(simulation.parameters.environment.gravity)
    total = np.zeros(3)
    for view in simulation:
        x = view.state.x.astype(np.float64) + simulation.origin
        mass, v = view.model.mass.astype(np.float64), view.state.v.astype(np.float64)
        total += energies(mass, gravity, elastic[view.name], x, v)
    return total
