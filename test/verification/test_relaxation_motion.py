"""Motion of the `relaxation` solver against solutions in closed form."""

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.params import Environment, RelaxationSettings
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers.relaxation.springs import correct_springs

G = 9.81
WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))


def advance(simulation, steps, dt):
    still = ColliderPoses.identity(1)
    for _ in range(steps):
        simulation.advance(still, still, dt)


def momentum(simulation):
    """Linear and angular momentum about the local origin, in float64."""
    mass = simulation.model("cloth").mass.astype(np.float64)[:, None]
    state = simulation.state("cloth")
    x, v = state.x.astype(np.float64), state.v.astype(np.float64)
    return (mass * v).sum(axis=0), (mass * np.cross(x, v)).sum(axis=0)


@pytest.mark.parametrize(("dt", "steps"), [(1e-4, 2000), (1 / 240, 100), (1 / 30, 20), (1 / 3, 5)])
@pytest.mark.parametrize("away", [0.0, 2.0, 100.0])
def test_free_fall_is_verlets_discrete_solution(cloth, dt, steps, away):
    """x_n = x_0 - g h^2 n (n + 1) / 2, also for steps that Verlet in float32 would lose."""
    vertices, triangles = cloth.grid(6, 6)
    vertices = vertices + away
    simulation = Simulation(
        (cloth.garment(vertices, triangles),),
        cloth.colliders(),
        solver_step=dt,
        solver="relaxation",
    )
    still = ColliderPoses.identity(1)
    still.position[:] = away
    for _ in range(steps):
        simulation.advance(still, still, dt)
    fallen = G * dt**2 * steps * (steps + 1) / 2
    x = simulation.state("cloth").x + simulation.origin
    expected = vertices[simulation.model("cloth").vertex] - [0.0, 0.0, fallen]
    off = np.abs(x - expected)
    assert off[:, 2].max() < 1e-5 * fallen + 4e-6
    # Spring corrections round to float32 positions: some nm, which is a speed over a tiny step.
    assert off.max() < (1e-3 if dt < 1e-3 else 1e-5)
    v = simulation.state("cloth").v
    assert v[:, 2].mean() == pytest.approx(-G * dt * steps, rel=1e-4)


def test_terminal_speed_under_drag_and_damping(cloth):
    """m g = drag area v + damping m v, with wind from below carried along."""
    garment = cloth.garment(*cloth.grid(4, 4), areal_density=0.1, air_drag=0.2, damping=0.5)
    wind = Environment(wind=(1.0, 0.0, 2.0))
    simulation = Simulation((garment,), cloth.colliders(), environment=wind, solver="relaxation")
    advance(simulation, 600, 1 / 60)
    drag = 0.2 / 0.1
    expected = (np.array([0.0, 0.0, -G]) + drag * np.array([1.0, 0.0, 2.0])) / (drag + 0.5)
    assert simulation.state("cloth").v.mean(axis=0) == pytest.approx(expected, rel=1e-3, abs=1e-4)


@pytest.mark.parametrize(("dt", "sweeps"), [(1 / 480, 50), (1 / 1920, 5), (1 / 1920, 200)])
def test_pendulum_period(cloth, dt, sweeps):
    """A rigid triangle that hangs by one corner: two masses at the distance of its height."""
    height, angle = 0.5, 0.3
    corners = np.array([[0.0, 0.0, 0.0], [0.0, -0.05, -height], [0.0, 0.05, -height]])
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    garment = cloth.garment(corners @ turn.T, [[0, 1, 2]], pins=[0])
    simulation = Simulation(
        (garment,),
        cloth.colliders(),
        settings=RelaxationSettings(sweeps=sweeps),
        solver_step=dt,
        solver="relaxation",
    )
    side = []
    for _ in range(int(4.0 / dt)):
        advance(simulation, 1, dt)
        side.append(simulation.positions("cloth")[1, 0])
    side = np.array(side)
    crossed = np.flatnonzero(np.sign(side[:-1]) != np.sign(side[1:]))
    times = (crossed + side[crossed] / (side[crossed] - side[crossed + 1])) * dt
    period = 2 * np.diff(times).mean()
    expected = 2 * np.pi * np.sqrt(height / G) * (1 + angle**2 / 16)
    assert period == pytest.approx(expected, rel=3e-3)
    swing = np.abs(side).reshape(2, -1).max(axis=1)
    assert (np.diff(swing) < 1e-4).all()


def test_spring_correction_conserves_linear_and_angular_momentum(cloth):
    """Per colour, where all corrections act along springs in their original place."""
    vertices, triangles = cloth.grid(20, 20)
    simulation = Simulation(
        (cloth.garment(vertices, triangles),), cloth.colliders(), solver="relaxation"
    )
    model = simulation.model("cloth")
    springs = model.springs
    mass = model.mass.astype(np.float64)[:, None]
    x = simulation.state("cloth").x.copy()
    x += np.random.default_rng(0).normal(0.0, 0.004, x.shape).astype(np.float32)
    for begin, end in zip(springs.colour_start[:-1], springs.colour_start[1:], strict=True):
        before = x.astype(np.float64)
        correct_springs(
            x.reshape(-1),
            np.zeros(4 * len(x), np.float32),
            springs.particles[2 * begin : 2 * end],
            springs.rest_length[begin:end],
            springs.share[begin:end],
            np.array([0, end - begin], np.int32),
            1,
        )
        moved = mass * (x - before)
        size = np.abs(moved).sum()
        assert np.abs(moved.sum(axis=0)).max() < 1e-5 * size
        assert np.abs(np.cross(before, moved).sum(axis=0)).max() < 1e-5 * size


def test_momentum_without_outer_forces(cloth):
    """A cloth that flies, turns and shakes: linear momentum stays; turning decays slowly."""
    vertices, triangles = cloth.grid(12, 12)
    simulation = Simulation(
        (cloth.garment(vertices, triangles),),
        cloth.colliders(),
        environment=WEIGHTLESS,
        solver="relaxation",
    )
    state = simulation.state("cloth")
    rng = np.random.default_rng(1)
    spin = np.array([0.5, 1.0, 3.0])
    state.v[:] = np.cross(spin, state.x) + rng.normal([0.4, -0.3, 0.2], 0.05, state.v.shape)
    linear, angular = momentum(simulation)
    advance(simulation, 60, 1 / 60)
    later, _ = momentum(simulation)
    assert later == pytest.approx(linear, rel=1e-4)
    centre = (simulation.model("cloth").mass[:, None] * state.x).sum(axis=0)
    centre /= simulation.model("cloth").mass.sum()
    assert centre == pytest.approx([0.4, -0.3, 0.2], rel=0.1)
    turning = momentum(simulation)[1] - np.cross(centre, later)
    assert np.linalg.norm(turning) == pytest.approx(np.linalg.norm(angular), rel=0.1)


def test_energy_does_not_grow(cloth):
    """A shaken cloth pinned at a corner, without damping: kinetic and potential energy."""
    vertices, triangles = cloth.grid(8, 8)
    simulation = Simulation(
        (cloth.garment(vertices, triangles, pins=[0]),), cloth.colliders(), solver="relaxation"
    )
    model, state = simulation.model("cloth"), simulation.state("cloth")

    def energy():
        mass = model.mass.astype(np.float64)
        kinetic = 0.5 * (mass[:, None] * state.v.astype(np.float64) ** 2).sum()
        return kinetic + G * (mass * state.x[:, 2]).sum()

    start = energy()
    highest = []
    for _ in range(20):
        advance(simulation, 10, 1 / 60)
        highest.append(energy())
    scale = G * model.mass.sum() * 0.2
    assert max(highest) < start + 0.01 * scale
