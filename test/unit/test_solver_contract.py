"""Solvers with physical stiffness behind the contract that all solvers share."""

import numpy as np
import pytest
from numba.core.runtime import _nrt_python

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.params import ImplicitSettings, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.warm_up import Scene, warm_up

SETTINGS = {"xpbd": XpbdSettings, "implicit": ImplicitSettings}
TOUCH = {"xpbd": 1e-6, "implicit": 1e-4}
"""How far contact gives way at rest [m]; of `implicit` it is a spring: 0.1 mm for 20 times a
particle's weight."""

both = pytest.mark.parametrize("solver", SETTINGS)


def on_a_ball(cloth, solver, side=12, solver_step=1 / 60, settings=None, **material):
    vertices, triangles = cloth.grid(side, side, 0.24 / side)
    garment = cloth.garment(
        vertices + np.array([0.0, 0.0, 0.103]), triangles, friction=0.4, damping=2.0, **material
    )
    ball = Collider(name="a", kind="sphere", bone="bone", geometry={"radius": 0.1})
    return Simulation(
        (garment,),
        cloth.colliders(ball),
        solver=solver,
        settings=settings,
        solver_step=solver_step,
    )


@pytest.mark.parametrize("solver", ["xpbd", pytest.param("implicit", marks=pytest.mark.slow)])
def test_warm_up_knows_it(solver):
    warm_up(Scene(kinds=frozenset({"sphere"})), solver)


@both
def test_settings_have_defaults(cloth, solver):
    assert on_a_ball(cloth, solver).parameters.settings == SETTINGS[solver]()


@both
def test_a_cloth_on_a_ball_rests_at_the_thickness_and_hardly_moves(cloth, solver):
    settings = ImplicitSettings(sub_step=1 / 240) if solver == "implicit" else None
    simulation = on_a_ball(cloth, solver, bending_stiffness=1e-5, settings=settings)
    still = ColliderPoses.identity(2)
    simulation.reset(still)
    for _ in range(120 if solver == "xpbd" else 180):
        simulation.advance(still, still, 1 / 60)
        distance = np.linalg.norm(simulation.positions("cloth"), axis=1)
        assert distance.min() >= 0.102 - TOUCH[solver]
    assert distance.min() < 0.1035
    assert simulation.health("cloth").contacts > 10
    assert simulation.health("cloth").rms_speed < 0.005


@pytest.mark.parametrize(
    ("solver", "settings", "step"),
    [
        ("xpbd", XpbdSettings(search_every=10), 1 / 60),
        ("implicit", ImplicitSettings(sub_step=1 / 240), 1 / 240),
        ("implicit", ImplicitSettings(sub_step=1 / 240), 1 / 15),
    ],
)
def test_cloth_rides_on_a_moving_collider(cloth, solver, settings, step):
    """Contacts move with the shape, also between searches and in every sub-step."""
    simulation = on_a_ball(cloth, solver, settings=settings, solver_step=step)
    start = ColliderPoses.identity(2)
    simulation.reset(start)
    for k in range(round(1 / step)):
        end = ColliderPoses.identity(2)
        end.position[:, 0] = 0.5 * ((k + 1) * step) ** 2
        simulation.advance(start, end, step)
        start = end
    x = simulation.positions("cloth")
    assert x[:, 0].mean() == pytest.approx(0.5, abs=0.05)
    # It is moved by the ball's acceleration, too.
    assert np.linalg.norm(x - end.position[1], axis=1).min() >= 0.102 - 2 * TOUCH[solver]


@both
@pytest.mark.parametrize("step", [1e-4, 1 / 180, 1 / 60, 1 / 3])
@pytest.mark.parametrize("stiffness", [0.0, 1.0, 1e9])
def test_any_step_and_stiffness_stays_finite(cloth, solver, step, stiffness):
    simulation = on_a_ball(
        cloth,
        solver,
        solver_step=step,
        settings=ImplicitSettings(sub_step=step) if solver == "implicit" else None,
        stretch_stiffness_warp=stiffness,
        stretch_stiffness_weft=stiffness,
        shear_stiffness=stiffness,
        bending_stiffness=min(stiffness, 1e3),
    )
    start = ColliderPoses.identity(2)
    for k in range(10):
        end = ColliderPoses.identity(2)
        end.position[1, 0] = 0.02 * (k % 3)
        simulation.advance(start, end, step)
        start = end
    assert simulation.health("cloth").resets == 0
    assert np.isfinite(simulation.positions("cloth")).all()


def test_a_body_that_is_put_elsewhere_leaves_no_contact_behind(cloth):
    """Contacts of `implicit` last from step to step."""
    simulation = on_a_ball(cloth, "implicit")
    here, there = ColliderPoses.identity(2), ColliderPoses.identity(2)
    there.position[1] = [0.0, 0.0, 50.0]
    simulation.reset(here)
    for _ in range(60):
        simulation.advance(there, there, 1 / 60)
    # One second of free fall, with damping.
    assert simulation.positions("cloth")[:, 2].max() < -1.0


@both
def test_degenerate_triangles_do_no_harm(cloth, solver):
    vertices, triangles = cloth.grid(5, 5)
    triangles = np.concatenate([triangles, [[0, 1, 1], [0, 1, 2], [3, 4, 9]], triangles[:2]])
    simulation = Simulation(
        (cloth.garment(vertices, triangles, pins=[0]),), cloth.colliders(), solver=solver
    )
    still = ColliderPoses.identity(1)
    for _ in range(30):
        simulation.advance(still, still, 1 / 60)
    x = simulation.positions("cloth")
    assert np.isfinite(x).all()
    assert np.ptp(x, axis=0).max() < 0.2


@both
def test_everything_may_be_pinned(cloth, solver):
    vertices, triangles = cloth.grid(3, 3)
    garment = cloth.garment(vertices, triangles, pins=range(9))
    simulation = Simulation((garment,), cloth.colliders(), solver=solver)
    still = ColliderPoses.identity(1)
    simulation.advance(still, still, 1 / 60)
    assert np.abs(simulation.positions("cloth") - vertices).max() < 1e-6


@both
def test_a_step_allocates_nothing(cloth, solver):
    """Neither the compiled loop nor what calls it, once it has run."""

    def allocations(side):
        simulation = on_a_ball(cloth, solver, side)
        still = ColliderPoses.identity(2)
        simulation.advance(still, still, 1 / 60)
        _nrt_python.memsys_enable_stats()
        before = _nrt_python.memsys_get_stats_alloc()
        simulation.advance(still, still, 1 / 60)
        return _nrt_python.memsys_get_stats_alloc() - before

    assert allocations(8) == allocations(24)


@both
def test_the_same_input_gives_the_same_bits(cloth, solver):
    ends = []
    for _ in range(2):
        simulation = on_a_ball(cloth, solver)
        still = ColliderPoses.identity(2)
        simulation.reset(still)
        for _ in range(5):
            simulation.advance(still, still, 1 / 60)
        ends.append(simulation.positions("cloth").tobytes())
    assert ends[0] == ends[1]
