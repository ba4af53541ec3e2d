"""Points on edges and triangles: what pokes between particles takes the cloth along."""

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.params import ImplicitSettings, RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation

pytestmark = pytest.mark.slow

SETTINGS = {
    "relaxation": RelaxationSettings,
    "xpbd": XpbdSettings,
    "implicit": ImplicitSettings,
}
RADIUS, LENGTH, CELL = 0.01, 0.5, 0.06


def through(cloth, solver, points, where):
    """How far the tip of a rod that rises under a cloth hung by its rim is through it [m]."""
    vertices, triangles = cloth.grid(6, 6, CELL)
    rim = np.abs(vertices[:, :2]).max(axis=1) > 0.14
    garment = cloth.garment(
        vertices, triangles, pins=np.flatnonzero(rim), friction=0.5, damping=1.0
    )
    rod = Collider(
        name="rod",
        kind="capsule",
        bone="bone",
        geometry={"radius0": RADIUS, "radius1": RADIUS, "length": LENGTH},
    )
    simulation = Simulation(
        (garment,),
        cloth.colliders(rod),
        solver=solver,
        settings=SETTINGS[solver](contact_points=points),
        solver_step=1 / 60,
    )
    at = triangles[(vertices[triangles].mean(axis=1) ** 2).sum(axis=1).argmin()]
    weight = {"triangles": [1 / 3, 1 / 3, 1 / 3], "edges": [0.5, 0.5, 0.0]}[where]
    x, y, _ = weight @ vertices[at]

    def poses(k):
        """The rod's axis is z; its tip starts 3 cm under the cloth and ends 4 cm above."""
        result = ColliderPoses.identity(2)
        tip = -0.03 + 0.07 * min(k / 40, 1.0)
        result.position[1] = [x, y, tip - RADIUS - LENGTH]
        return result

    simulation.reset(poses(0))
    for k in range(70):
        simulation.advance(poses(k), poses(k + 1))
    assert simulation.health("cloth").resets == 0
    end = simulation.positions("cloth").astype(np.float64)
    return 0.04 - (weight @ end[at])[2]


@pytest.mark.parametrize("solver", SETTINGS)
@pytest.mark.parametrize("where", ["triangles", "edges"])
def test_a_rod_between_particles_takes_the_cloth_along(cloth, solver, where):
    assert through(cloth, solver, "particles", where) > 0.03
    # The thickness, and what contact gives way under the cloth's tension.
    assert through(cloth, solver, where, where) < 0.002
    assert through(cloth, solver, "both", where) < 0.002
