"""Contact in whole simulations: rest, friction, crossing colliders, fast limbs, symmetry."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.geometry.transforms import matrix_from_quaternion, quaternion_multiply
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.state import State

THICKNESS = 0.002


def ball(name, radius):
    return Collider(name=name, kind="sphere", bone="bone", geometry={"radius": radius})


def capsule(name, radius0, radius1, length):
    geometry = {"radius0": radius0, "radius1": radius1, "length": length}
    return Collider(name=name, kind="capsule", bone="bone", geometry=geometry)


def poses_at(*positions):
    """Poses of the frame at the origin and of the shapes after it."""
    poses = ColliderPoses.identity(len(positions) + 1)
    poses.position[1:] = positions
    return poses


def test_cloth_on_a_ball_rests_at_exactly_the_thickness(cloth):
    vertices, triangles = cloth.grid(20, 20, 0.025)
    garment = cloth.garment(
        vertices + np.array([0.0, 0.0, 0.22]), triangles, friction=0.5, damping=1.0
    )
    simulation = Simulation((garment,), cloth.colliders(ball("a", 0.2)), solver="relaxation")
    still = poses_at([0.0, 0.0, 0.0])
    simulation.reset(still)
    for _ in range(60):
        simulation.advance(still, still, 1 / 60)
        distance = np.linalg.norm(simulation.positions("cloth"), axis=1) - 0.2
        assert distance.min() >= THICKNESS - 1e-6
    assert simulation.health("cloth").contacts > 40
    touching = distance < THICKNESS + 1e-6
    assert touching.sum() > 40


def test_crossing_colliders_hold_cloth_without_popping(cloth):
    """A cloth across two overlapping balls: nothing inside, nothing jumps."""
    vertices, triangles = cloth.grid(24, 16)
    garment = cloth.garment(vertices + np.array([0.0, 0.0, 0.14]), triangles, friction=0.3)
    simulation = Simulation(
        (garment,), cloth.colliders(ball("a", 0.12), ball("b", 0.12)), solver="relaxation"
    )
    still = poses_at([-0.09, 0.0, 0.0], [0.09, 0.0, 0.0])
    simulation.reset(still)
    before = simulation.positions("cloth").copy()
    largest = 0.0
    for _ in range(60):
        simulation.advance(still, still, 1 / 60)
        x = simulation.positions("cloth")
        largest = max(largest, float(np.linalg.norm(x - before, axis=1).max()))
        before = x.copy()
        for centre in still.position[1:]:
            assert np.linalg.norm(x - centre, axis=1).min() >= 0.12 + THICKNESS - 1e-6
    # Slow sliding is allowed: 5 cm/s is 0.8 mm a frame.
    assert largest < 0.002


def test_legs_that_close_on_a_cloth_hold_it_between_them(cloth):
    vertices, triangles = cloth.grid(16, 16)
    sheet = vertices[:, [0, 2, 1]] + np.array([0.0, 0.0, 0.2])
    simulation = Simulation(
        (cloth.garment(sheet, triangles, pins=range(16)),),
        cloth.colliders(capsule("l", 0.08, 0.05, 0.4), capsule("r", 0.08, 0.05, 0.4)),
        solver="relaxation",
    )
    start = poses_at([0.0, -0.12, 0.0], [0.0, 0.12, 0.0])
    for k in range(60):
        closing = 0.12 - 0.05 * min(k / 20, 1.0)
        end = poses_at([0.0, -closing, 0.0], [0.0, closing, 0.0])
        simulation.advance(start, end, 1 / 60)
        start = end
    x = simulation.positions("cloth")[16:]
    assert np.isfinite(x).all()
    assert simulation.health("cloth").resets == 0
    slack = []
    for side in (-1.0, 1.0):
        t = np.clip(x[:, 2], 0.0, 0.4)
        axis = np.stack([0.0 * t, side * 0.07 + 0.0 * t, t], axis=1)
        slack.append(np.linalg.norm(x - axis, axis=1) - (0.08 - 0.03 * t / 0.4))
    # The legs overlap by 2 cm: what they hold is at most half of that deep, in both of them.
    assert np.min(slack) > -0.011
    held = np.min(slack, axis=0) < THICKNESS - 1e-4
    assert np.abs(np.subtract(*slack))[held].max(initial=0.0) < 0.004


@pytest.mark.parametrize(("friction", "holds"), [(0.4, True), (0.2, False)])
def test_cloth_on_a_slope_stays_below_the_friction_angle(cloth, friction, holds):
    """A cloth on a ball so large that it is a plane; gravity leans by atan 0.3."""
    lean = np.arctan(0.3)
    gravity = (9.81 * np.sin(lean), 0.0, -9.81 * np.cos(lean))
    vertices, triangles = cloth.grid(6, 6)
    garment = cloth.garment(
        vertices + np.array([0.0, 0.0, THICKNESS]), triangles, friction=friction
    )
    simulation = Simulation(
        (garment,),
        cloth.colliders(ball("a", 50.0)),
        environment=Environment(gravity=gravity),
        solver="relaxation",
    )
    still = poses_at([0.0, 0.0, -50.0])
    seconds = 2.0
    for _ in range(int(seconds * 60)):
        simulation.advance(still, still, 1 / 60)
    slid = simulation.positions("cloth")[:, 0].mean()
    if holds:
        assert abs(slid) < 0.002
    else:
        expected = 0.5 * 9.81 * (np.sin(lean) - friction * np.cos(lean)) * seconds**2
        assert slid == pytest.approx(expected, rel=0.1)


def test_cloth_rides_on_a_moving_collider_by_friction(cloth):
    vertices, triangles = cloth.grid(12, 12)
    garment = cloth.garment(vertices + np.array([0.0, 0.0, 0.102]), triangles, friction=0.8)
    simulation = Simulation((garment,), cloth.colliders(ball("a", 0.1)), solver="relaxation")
    start = poses_at([0.0, 0.0, 0.0])
    simulation.reset(start)
    for k in range(60):
        end = poses_at([0.5 * ((k + 1) / 60) ** 2, 0.0, 0.0])
        simulation.advance(start, end, 1 / 60)
        start = end
    assert simulation.positions("cloth")[:, 0].mean() == pytest.approx(0.5, abs=0.03)


def test_being_pushed_out_of_a_collider_gives_no_kick(cloth):
    """A cloth that starts 5 cm deep: fully inelastic, so it comes out and stops."""
    vertices, triangles = cloth.grid(5, 5)
    garment = cloth.garment(vertices + np.array([0.0, 0.0, 0.95]), triangles)
    simulation = Simulation(
        (garment,),
        cloth.colliders(ball("a", 1.0)),
        environment=Environment(gravity=(0.0, 0.0, 0.0)),
        solver="relaxation",
    )
    still = poses_at([0.0, 0.0, 0.0])
    for _ in range(30):
        simulation.advance(still, still)
    z = simulation.positions("cloth")[:, 2]
    assert z == pytest.approx(1.0 + THICKNESS, abs=0.01)
    assert simulation.health("cloth").rms_speed < 0.1


def scene(cloth, q, shift, steps):
    """A cloth that falls on a ball and a capsule, everything turned by q and shifted.

    Returns:
        Its positions in file order, turned and shifted back, and its contacts.
    """
    R = matrix_from_quaternion(q)
    vertices, triangles = cloth.grid(9, 9)
    sheet = vertices + np.array([0.01, 0.02, 0.115])
    gravity = tuple(R @ [0.0, 0.0, -9.81])
    simulation = Simulation(
        (cloth.garment(sheet, triangles, friction=0.3),),
        cloth.colliders(ball("a", 0.08), capsule("b", 0.08, 0.05, 0.2)),
        environment=Environment(gravity=gravity),
        solver="relaxation",
    )
    start = ColliderPoses.identity(3)
    start.position[1:] = [[-0.05, 0.0, 0.0], [0.05, -0.1, 0.0]]
    start.orientation[2] = np.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    start.position[:] = start.position @ R.T + shift
    start.orientation[:] = [quaternion_multiply(*q, *own) for own in start.orientation]
    model, state = simulation.model("cloth"), simulation.state("cloth")
    state.assign(State.at(model, sheet @ R.T + shift, simulation.origin))
    for _ in range(steps):
        simulation.advance(start, start)
    x = np.empty_like(sheet)
    x[model.vertex] = (state.x + (simulation.origin - shift)) @ R
    return x, simulation.health("cloth").contacts


@given(
    st.tuples(*4 * [st.floats(-1.0, 1.0)]).filter(lambda q: np.linalg.norm(q) > 0.1),
    st.tuples(*3 * [st.floats(-3.0, 3.0)]),
)
@settings(derandomize=True, deadline=None, max_examples=12, phases=[Phase.generate])
def test_turned_and_shifted_worlds_behave_alike(cloth, q, shift):
    q = np.array(q) / np.linalg.norm(q)
    expected, _ = scene(cloth, np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), 30)
    found, contacts = scene(cloth, q, np.array(shift), 30)
    assert contacts > 5
    assert np.abs(found - expected).max() < 1e-4
