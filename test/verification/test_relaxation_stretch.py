"""How `relaxation` stretches: it depends on step and sweeps as printed, in a known way."""

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.params import RelaxationSettings
from garment_sim_ros.sim.simulation import Simulation


def hanging(cloth, dt, sweeps, rows=12):
    """A strip two vertices wide that hangs at rest: its strain per row, from the top."""
    vertices, triangles = cloth.grid(rows, 2)
    strip = np.stack([vertices[:, 1] * 0.0, vertices[:, 1], -vertices[:, 0]], axis=1)
    garment = cloth.garment(strip, triangles, pins=[0, 1], damping=2.0)
    simulation = Simulation(
        (garment,),
        cloth.colliders(),
        settings=RelaxationSettings(sweeps=sweeps),
        solver_step=dt,
        solver="relaxation",
    )
    still = ColliderPoses.identity(1)
    simulation.reset(still)
    for _ in range(int(10.0 / dt)):
        simulation.advance(still, still, dt)
    x = simulation.positions("cloth").reshape(rows, 2, 3).mean(axis=1)
    return np.linalg.norm(np.diff(x, axis=0), axis=1) / 0.02 - 1.0


def test_a_hanging_strip_is_stretched_most_at_the_top(cloth):
    strain = hanging(cloth, 1 / 120, 3)
    thirds = strain[:3].mean(), strain[4:7].mean(), strain[-3:].mean()
    assert thirds[0] > 1.1 * thirds[1] > 1.1 * thirds[2] > 0.0


def test_strain_falls_with_the_square_of_the_step(cloth):
    """At rest each step's fall, h^2 g, is what the sweeps take back, and they are linear in it."""
    coarse, fine = hanging(cloth, 1 / 120, 3), hanging(cloth, 1 / 240, 3)
    assert coarse[0] / fine[0] == pytest.approx(4.0, rel=0.1)


def test_strain_falls_with_sweeps(cloth):
    strains = [hanging(cloth, 1 / 120, sweeps)[0] for sweeps in (1, 3, 10, 100)]
    assert strains == sorted(strains, reverse=True)
    assert strains[-1] < 1e-3


def test_one_spring_between_a_pin_and_a_particle_does_not_stretch(cloth):
    corners = np.array([[0.0, -0.1, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, -0.3]])
    simulation = Simulation(
        (cloth.garment(corners, [[0, 2, 1]], pins=[0, 1]),),
        cloth.colliders(),
        settings=RelaxationSettings(sweeps=30),
        solver="relaxation",
    )
    still = ColliderPoses.identity(1)
    for _ in range(20):
        simulation.advance(still, still)
    assert simulation.positions("cloth") == pytest.approx(corners, abs=1e-6)


def test_compression_is_corrected_too(cloth):
    """The first paper corrects over-compression, unlike its reference 13."""
    vertices, triangles = cloth.grid(5, 5)
    simulation = Simulation(
        (cloth.garment(vertices, triangles),), cloth.colliders(), solver="relaxation"
    )
    state = simulation.state("cloth")
    state.x *= np.float32(0.8)
    still = ColliderPoses.identity(1)
    for _ in range(5):
        simulation.advance(still, still)
    x = simulation.positions("cloth").reshape(5, 5, 3)
    assert np.linalg.norm(np.diff(x, axis=0), axis=2).mean() > 0.0195
