"""How much of the body's own motion the cloth feels, against closed forms."""

from itertools import pairwise

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.world.root_motion import TakenOut, take_along

STEP = 1 / 180
GRAVITY = 9.81


def body_at(position, turn=0.0):
    """One bone, turned about z [rad]."""
    poses = ColliderPoses.identity(1)
    poses.position[0] = position
    poses.orientation[0, 2:] = np.sin(turn / 2), np.cos(turn / 2)
    return poses


def strip(cloth, offset=0.0, **material):
    """A strip that hangs from one of its ends, 0.3 m long, beside the bone's z axis."""
    vertices, triangles = cloth.grid(16, 3)
    hanging = vertices[:, [2, 1, 0]] + [offset, 0.0, -0.15]
    return cloth.garment(hanging, triangles, range(45, 48), **material)


def flag(cloth, solver="relaxation", linear=1.0, angular=1.0, **options):
    """A simulation of `strip`."""
    return Simulation(
        (strip(cloth, **options),),
        cloth.colliders(),
        environment=Environment(root_linear_inertia=linear, root_angular_inertia=angular),
        solver=solver,
        solver_step=STEP,
    )


def drive(simulation, path):
    """Positions in the body's frame after each step of a path."""
    simulation.reset(path[0])
    found = []
    for start, end in pairwise(path):
        simulation.advance(start, end)
        R = matrix_from_quaternion(end.orientation[0])
        found.append((simulation.positions("cloth").astype(float) - end.position[0]) @ R)
    return np.array(found)


def shaken(n):
    """A body that jerks to and fro and turns, farther than the local origin stays."""
    t = n * STEP
    return body_at(
        [2.0 * np.sin(5.0 * t), 1.5 * t * t, 0.2 * np.sin(9.0 * t)], 3.0 * np.sin(4 * t)
    )


@pytest.mark.parametrize("solver", ["relaxation", "xpbd"])
def test_cloth_that_feels_nothing_hangs_as_if_the_body_stood_still(cloth, solver):
    path = [shaken(n) for n in range(181)]
    still = drive(flag(cloth, solver, damping=2.0), [path[0]] * 181)
    found = drive(flag(cloth, solver, linear=0.0, angular=0.0, damping=2.0), path)
    # Nothing but rounding of float32 coordinates; a limp strip makes some more of it.
    assert np.sqrt(np.square(found - still).sum(axis=-1).mean()) < 1e-3
    assert np.abs(found - still).max() < 5e-3
    assert np.abs(drive(flag(cloth, solver, damping=2.0), path) - still).max() > 0.1


@pytest.mark.parametrize("fraction", [0.0, 0.5, 1.0])
def test_a_strip_leans_by_the_fraction_of_the_acceleration(cloth, fraction):
    """In a body that accelerates by a it comes to rest at the angle whose tangent is f a / g."""
    acceleration = 6.0
    path = [body_at([0.5 * acceleration * (n * STEP) ** 2, 0, 0]) for n in range(720)]
    simulation = flag(cloth, "xpbd", linear=fraction, damping=6.0)
    # Damping acts on velocity in the world, which grows; taken out with the motion, it does not.
    x = drive(simulation, path)[-1]
    down = x[:3].mean(axis=0) - x[45:].mean(axis=0)
    tangent = -down[0] / -down[2]
    time = 719 * STEP
    # Speed in the world, less what is taken out, against which the damping acts: v' = f a - c v.
    felt = fraction * acceleration * (1.0 + 6.0 * time)
    assert tangent == pytest.approx(felt / GRAVITY, rel=0.05, abs=0.01)


@pytest.mark.parametrize("fraction", [0.0, 1.0])
def test_a_strip_on_a_spinning_body_leans_outwards_if_it_feels_it(cloth, fraction):
    """A conical pendulum: the tangent is w^2 r / g, r from where it hangs to where it ends."""
    radius, spin = 0.4, 3.0
    path = [body_at([0.0, 0.0, 0.0], spin * n * STEP) for n in range(900)]
    simulation = flag(cloth, "xpbd", angular=fraction, offset=radius, damping=1.0)
    x = drive(simulation, path)[-1]
    out = x[:3].mean(axis=0) - x[45:].mean(axis=0)
    least = fraction * spin**2 * radius / GRAVITY
    most = fraction * spin**2 * (radius + out[0]) / GRAVITY
    assert least - 0.01 < out[0] / -out[2] < most + 0.01


def test_taking_along_is_the_rigid_motion_it_says():
    random = np.random.default_rng(4)
    start, end = ColliderPoses.identity(3), ColliderPoses.identity(3)
    for poses in (start, end):
        poses.position[:] = random.normal(size=(3, 3))
        poses.orientation[:] = random.normal(size=(3, 4))
        poses.orientation[:] /= np.linalg.norm(poses.orientation, axis=1, keepdims=True)
    R0, R1 = (matrix_from_quaternion(p.orientation[0]) for p in (start, end))
    p0, p1, others = start.position[0].copy(), end.position[0], start.position.copy()
    x = random.normal(size=(50, 3)).astype(np.float32)
    v = random.normal(size=(50, 3)).astype(np.float32)
    origin = np.array([0.5, -0.25, 1.0])
    expected_x = (x + origin - p0) @ (R1 @ R0.T).T + p0 + 0.75 * (p1 - p0) - origin
    expected_v = v @ (R1 @ R0.T).T

    taken = TakenOut(0.25, 0.0)
    assert taken.begin_step(start, end, 1.0)
    take_along(x, v, origin, taken.pivot, taken.turn, taken.way)
    np.testing.assert_allclose(x, expected_x, atol=2e-6)
    np.testing.assert_allclose(v, expected_v, atol=2e-6)
    expected = (others - p0) @ (R1 @ R0.T).T + p0 + 0.75 * (p1 - p0)
    np.testing.assert_allclose(start.position, expected, atol=1e-12)
    np.testing.assert_allclose(matrix_from_quaternion(start.orientation[0]), R1, atol=1e-12)


def test_fractions_of_one_change_nothing(cloth):
    path = [shaken(n) for n in range(60)]
    plain = Simulation((strip(cloth),), cloth.colliders(), solver="relaxation", solver_step=STEP)
    assert (drive(plain, path) == drive(flag(cloth), path)).all()


def test_of_a_jump_cloth_feels_what_it_can_hand_on(cloth):
    """100 m in one frame: 100 m/s are felt; the strip swings, and does not stay behind."""
    simulation = flag(cloth, "xpbd")
    here, there = body_at([0.0, 0.0, 0.0]), body_at([60.0, 80.0, 0.0])
    simulation.reset(here)
    simulation.advance(here, there, 3 * STEP)
    assert simulation.outran == 3
    away = np.abs(simulation.positions("cloth") - there.position[0]).max()
    for _ in range(60):
        simulation.advance(there, there, STEP)
        away = max(away, np.abs(simulation.positions("cloth") - there.position[0]).max())
    # It is 0.3 m long; each of 15 rows lags by what the body goes in a sub-step, 7 cm.
    assert 0.31 < away < 1.5
    assert simulation.outran == 3
