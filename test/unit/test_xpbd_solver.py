"""The `xpbd` solver behind the contract of all solvers."""

import numpy as np
import pytest
from numba.core.runtime import _nrt_python

from garment_sim_ros.geometry.shapes import Collider, ColliderPoses
from garment_sim_ros.params import XpbdSettings
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers.sweep_order import inward_order
from garment_sim_ros.sim.warm_up import warm_up


def on_a_ball(cloth, side=12, settings=None, solver_step=1 / 60, **material):
    vertices, triangles = cloth.grid(side, side, 0.24 / side)
    garment = cloth.garment(
        vertices + np.array([0.0, 0.0, 0.103]), triangles, friction=0.4, damping=2.0, **material
    )
    ball = Collider(name="a", kind="sphere", bone="bone", geometry={"radius": 0.1})
    return Simulation(
        (garment,),
        cloth.colliders(ball),
        solver="xpbd",
        settings=settings,
        solver_step=solver_step,
    )


def test_warm_up_knows_it():
    warm_up("xpbd")


def test_settings_have_defaults(cloth):
    assert on_a_ball(cloth).parameters.settings == XpbdSettings()


def test_a_cloth_on_a_ball_rests_at_the_thickness_and_hardly_moves(cloth):
    simulation = on_a_ball(cloth, bending_stiffness=1e-5)
    still = ColliderPoses.identity(2)
    simulation.reset(still)
    for _ in range(120):
        simulation.advance(still, still, 1 / 60)
        distance = np.linalg.norm(simulation.positions("cloth"), axis=1)
        assert distance.min() >= 0.102 - 1e-6
    assert simulation.health("cloth").contacts > 10
    assert simulation.health("cloth").rms_speed < 0.005


def test_cloth_rides_on_a_moving_collider(cloth):
    """Tangent planes move with the shape between searches."""
    simulation = on_a_ball(cloth, settings=XpbdSettings(bending_every=10))
    start = ColliderPoses.identity(2)
    simulation.reset(start)
    for k in range(60):
        end = ColliderPoses.identity(2)
        end.position[:, 0] = 0.5 * ((k + 1) / 60) ** 2
        simulation.advance(start, end, 1 / 60)
        start = end
    x = simulation.positions("cloth")
    assert x[:, 0].mean() == pytest.approx(0.5, abs=0.05)
    assert np.linalg.norm(x - end.position[1], axis=1).min() >= 0.102 - 1e-6


@pytest.mark.parametrize("step", [1e-4, 1 / 180, 1 / 60, 1 / 3])
@pytest.mark.parametrize("stiffness", [0.0, 1.0, 1e9])
def test_any_step_and_stiffness_stays_finite(cloth, step, stiffness):
    simulation = on_a_ball(
        cloth,
        solver_step=step,
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


def test_degenerate_triangles_do_no_harm(cloth):
    vertices, triangles = cloth.grid(5, 5)
    triangles = np.concatenate([triangles, [[0, 1, 1], [0, 1, 2], [3, 4, 9]], triangles[:2]])
    simulation = Simulation(
        (cloth.garment(vertices, triangles, pins=[0]),), cloth.colliders(), solver="xpbd"
    )
    still = ColliderPoses.identity(1)
    for _ in range(30):
        simulation.advance(still, still, 1 / 60)
    x = simulation.positions("cloth")
    assert np.isfinite(x).all()
    assert np.ptp(x, axis=0).max() < 0.2


def test_a_step_allocates_nothing(cloth):
    """Neither the compiled loop nor what calls it, once it has run."""

    def allocations(side):
        simulation = on_a_ball(cloth, side)
        still = ColliderPoses.identity(2)
        simulation.advance(still, still, 1 / 60)
        _nrt_python.memsys_enable_stats()
        before = _nrt_python.memsys_get_stats_alloc()
        simulation.advance(still, still, 1 / 60)
        return _nrt_python.memsys_get_stats_alloc() - before

    assert allocations(8) == allocations(24)


def test_the_same_input_gives_the_same_bits(cloth):
    ends = []
    for _ in range(2):
        simulation = on_a_ball(cloth)
        still = ColliderPoses.identity(2)
        simulation.reset(still)
        for _ in range(5):
            simulation.advance(still, still, 1 / 60)
        ends.append(simulation.positions("cloth").tobytes())
    assert ends[0] == ends[1]


def test_edges_are_solved_towards_the_pins_or_from_the_boundary_inwards(cloth):
    _, triangles = cloth.grid(5, 5)
    column = np.array([[k, k + 5] for k in range(0, 20, 5)], dtype=np.int32)
    # The last five particles, one side of the grid, are pinned: towards them.
    assert inward_order(column, triangles, 20).tolist() == [0, 1, 2, 3]
    # Nothing is pinned: rim, then middle.
    middle = np.array([[12, 7], [2, 7], [2, 1]], dtype=np.int32)
    assert inward_order(middle, triangles, 25).tolist() == [2, 1, 0]
