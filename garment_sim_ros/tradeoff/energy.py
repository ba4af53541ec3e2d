"""Energy of cloth that moves without losses, and the share of it that a solver loses or makes."""

from dataclasses import replace

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.sim.energy import Elastic, energies
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.tradeoff.playing import Player
from garment_sim_ros.tradeoff.points import Point
from garment_sim_ros.tradeoff.scenes import Staged

_NO_AIR = {"wind": (0.0, 0.0, 0.0), "wind_drag": 0.0, "wind_lift": 0.0, "gust": 0.0}
_LOSSES = {"damping": 0.0, "air_drag": 0.0, "friction": 0.0}
"""What fabrics lose energy by."""


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
