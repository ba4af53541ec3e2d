import tracemalloc
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numba.core.runtime import _nrt_python

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.errors import GeometryError, MessageError, ParameterError
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.simulation import Simulation

BALL = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": 0.1})
WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))


def posed(position, turn=0.0, count=1):
    """All colliders at one place, turned about z [rad]."""
    poses = ColliderPoses.identity(count)
    poses.position[:] = position
    poses.orientation[:, 2:] = np.sin(turn / 2), np.cos(turn / 2)
    return poses


@pytest.fixture
def flag(cloth):
    """A cloth pinned along one side: vertices, and a simulation with a ball."""
    vertices, triangles = cloth.grid(8, 9)
    garment = cloth.garment(vertices, triangles, pins=range(9))
    return vertices, Simulation((garment,), cloth.colliders(BALL))


def test_positions_are_in_file_order_before_any_step(flag):
    vertices, simulation = flag
    assert simulation.positions("cloth").dtype == np.float32
    assert simulation.positions("cloth") == pytest.approx(vertices, abs=1e-7)


def test_positions_and_normals_fill_an_array_that_is_given(flag):
    vertices, simulation = flag
    out = np.zeros((len(vertices), 3), np.float32)
    assert simulation.positions("cloth", out) is out
    assert simulation.normals("cloth", out) is out
    assert out[:, 2] == pytest.approx(1.0, abs=1e-6)


def test_pins_are_exactly_where_their_frame_is(flag):
    vertices, simulation = flag
    poses = [posed([0.1 * k, 7.0, 0.02 * k * k], 0.3 * k, 2) for k in range(12)]
    simulation.reset(poses[0])
    for a, b in pairwise(poses):
        simulation.advance(a, b, 1 / 60)
        R = matrix_from_quaternion(b.orientation[0])
        expected = (vertices[:9] @ R.T + b.position[0]).astype(np.float32)
        # One rounding to the local origin and one back to the world.
        assert np.abs(simulation.positions("cloth")[:9] - expected).max() <= 1e-6


def test_reset_places_by_frames_and_leaves_no_velocity(flag):
    _, simulation = flag
    simulation.reset(posed([3.0, 2.0, 1.0], 1.0, 2))
    assert (simulation.state("cloth").v == 0.0).all()
    assert simulation.positions("cloth").mean(axis=0) == pytest.approx([3.0, 2.0, 1.0], abs=0.3)


def test_a_settled_garment_stays_where_it_is(cloth):
    """A cap over a ball and a curtain: no free fall and no kick after `reset`."""
    vertices, triangles = cloth.grid(16, 16)
    curtain = cloth.garment(
        vertices[:, [2, 1, 0]] - [0.3, 0.0, 0.0], triangles, range(240, 256), name="curtain"
    )
    cap = cloth.garment(vertices + np.array([0.0, 0.0, 0.11]), triangles, name="cap", friction=0.4)
    simulation = Simulation((curtain, cap), cloth.colliders(BALL))
    still = posed([0.0, 0.0, 0.0], 0.0, 2)
    simulation.reset(still)
    start = {n: simulation.positions(n).copy() for n in simulation.names}
    for _ in range(30):
        simulation.advance(still, still, 1 / 60)
    for name, x in start.items():
        assert np.abs(simulation.positions(name) - x).max() < 0.004
        assert simulation.health(name).rms_speed < 0.01
        assert simulation.health(name).settling_steps < 900


def test_a_bone_is_found_by_its_frame_or_any_collider_and_a_collider_by_name(cloth):
    vertices, triangles = cloth.grid(4, 4)
    limb = Collider(
        name="limb",
        kind="sphere",
        bone="arm",
        geometry={"radius": 0.01},
        position=np.array([0.0, 0.0, 0.5]),
    )
    for frame, offset in (("bone", 0.0), ("arm", -0.5), ("limb", 0.0)):
        garment = cloth.garment(vertices, triangles, range(16), frame=frame)
        simulation = Simulation((garment,), cloth.colliders(limb))
        simulation.reset(posed([0.0, 0.0, 1.0], 0.0, 2))
        assert simulation.positions("cloth")[:, 2] == pytest.approx(1.0 + offset, abs=1e-6)


def test_missing_frames_are_all_listed(cloth):
    vertices, triangles = cloth.grid(3, 3)
    garment = cloth.garment(vertices, triangles, frame="hips")
    with pytest.raises(
        GeometryError, match=r"'cloth' is attached to 'hips'.*bones: bone.*frame_bone"
    ):
        Simulation((garment,), cloth.colliders(BALL))


def test_names_must_differ_and_options_must_be_known(cloth):
    garment = cloth.garment(*cloth.grid(3, 3))
    with pytest.raises(GeometryError, match="unique"):
        Simulation((garment, garment), cloth.colliders())
    with pytest.raises(ParameterError, match="relaxation"):
        Simulation((garment,), cloth.colliders(), solver="magic")
    with pytest.raises(ParameterError, match="solver_step"):
        Simulation((garment,), cloth.colliders(), solver_step=0.0)


def broken(what):
    poses = posed([0.0, 0.0, 0.0], 0.0, 2)
    if what == "count":
        return posed([0.0, 0.0, 0.0], 0.0, 3)
    if what == "nan":
        poses.position[1, 2] = np.nan
    if what == "inf":
        poses.orientation[0, 0] = np.inf
    if what == "opposite infinities":
        poses.position[0, 0], poses.position[1, 0] = np.inf, -np.inf
    if what == "far":
        poses.position[1, 1] = -1e30
    if what == "zero":
        poses.orientation[1] = 0.0
    return poses


@pytest.mark.parametrize(
    ("what", "reason"),
    [
        ("count", "pose_count"),
        ("nan", "poses_not_finite"),
        ("inf", "poses_not_finite"),
        ("opposite infinities", "poses_not_finite"),
        ("far", "pose_too_far"),
        ("zero", "orientation_not_unit"),
    ],
)
def test_unusable_poses_are_rejected_and_nothing_changes(flag, what, reason):
    _, simulation = flag
    good = posed([0.0, 0.0, 0.0], 0.0, 2)
    simulation.advance(good, good)
    before = simulation.positions("cloth").copy()
    for call in (
        lambda: simulation.advance(good, broken(what)),
        lambda: simulation.advance(broken(what), good),
        lambda: simulation.reset(broken(what)),
    ):
        with pytest.raises(MessageError) as caught:
            call()
        assert caught.value.reason == reason
    assert (simulation.positions("cloth") == before).all()


@pytest.mark.parametrize("dt", [0.0, -1.0, np.nan, np.inf])
def test_time_must_be_positive(flag, dt):
    _, simulation = flag
    good = posed([0.0, 0.0, 0.0], 0.0, 2)
    with pytest.raises(MessageError, match="step_not_positive"):
        simulation.advance(good, good, dt)


def test_time_is_divided_into_steps_and_poses_are_interpolated(cloth):
    garment = cloth.garment(*cloth.grid(3, 3), pins=range(9))
    simulation = Simulation((garment,), cloth.colliders(), solver_step=0.01)
    simulation.advance(posed([0.0] * 3), posed([0.3, 0.0, 0.0], 0.2), 0.03)
    assert simulation.health("cloth").steps == 3
    # Velocity of the last third of the way, not of all of it in one step.
    assert simulation.state("cloth").v[:, 0].mean() == pytest.approx(10.0, rel=1e-3)
    simulation.advance(posed([0.3, 0.0, 0.0], 0.2), posed([0.3, 0.0, 0.0], 0.2))
    assert simulation.health("cloth").steps == 4


def test_local_origin_follows_the_body_without_a_trace(cloth):
    """The same fall 0 m and 1,000 m away along the same way of the body."""
    vertices, triangles = cloth.grid(6, 6)
    results = []
    for far in (0.0, 1000.0):
        offset = np.array([far, 0.0, 0.0])
        simulation = Simulation((cloth.garment(vertices, triangles, range(6)),), cloth.colliders())
        simulation.reset(posed(offset))
        a = posed(offset)
        for k in range(60):
            b = posed(offset + np.array([0.05 * k, 0.0, 0.0]))
            simulation.advance(a, b, 1 / 60)
            a = b
        assert np.abs(simulation.origin - a.position[0]).max() <= 1.2
        results.append(simulation.state("cloth").x + (simulation.origin - offset))
    assert results[0] == pytest.approx(results[1], abs=2e-5)


def test_a_step_allocates_nothing_that_grows_with_the_garment(cloth):
    def allocations(side):
        vertices, triangles = cloth.grid(side, side, 0.3 / side)
        garment = cloth.garment(
            vertices + np.array([0.0, 0.0, 0.1]), triangles, range(side), friction=0.3
        )
        simulation = Simulation((garment,), cloth.colliders(BALL))
        still = posed([0.0, 0.0, 0.0], 0.0, 2)
        for _ in range(3):
            simulation.advance(still, still, 1 / 60)
        _nrt_python.memsys_enable_stats()
        tracemalloc.start()
        compiled = _nrt_python.memsys_get_stats_alloc()
        simulation.advance(still, still, 1 / 60)
        compiled = _nrt_python.memsys_get_stats_alloc() - compiled
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return compiled, peak

    allocations(20)
    small, large = allocations(20), allocations(60)
    assert small[0] == large[0]
    # One float32 array of the large garment's positions has 43,200 bytes.
    assert small[1] < 10_000
    assert large[1] < 10_000


def test_a_step_begins_with_the_contacts_of_the_one_before_unless_the_body_jumps(cloth):
    """Poses are the same where one step ends and the next one begins, to the last digit."""
    colliders = cloth.colliders(*(replace(BALL, name=f"ball_{n}") for n in range(30)))
    simulation = Simulation((cloth.garment(*cloth.grid(8, 9), pins=range(9)),), colliders)
    rng, way = np.random.default_rng(1), [ColliderPoses.identity(31)]
    for _ in range(30):
        poses = way[-1].copy()
        poses.position += rng.normal(scale=0.02, size=(31, 3))
        poses.orientation += rng.normal(scale=0.02, size=(31, 4))
        poses.orientation /= np.linalg.norm(poses.orientation, axis=1, keepdims=True)
        way.append(poses)
    simulation.reset(way[0])
    for start, end in pairwise(way):
        simulation.advance(start, end, 1 / 60)
        assert simulation.collider_state.goes_on
    simulation.advance(way[3], way[4], 1 / 60)
    assert not simulation.collider_state.goes_on
