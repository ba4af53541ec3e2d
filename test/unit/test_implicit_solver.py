"""The `implicit` solver behind the contract of all solvers."""

import numpy as np
import pytest
from numba.core.runtime import _nrt_python

from garment_sim_ros.geometry.dissection import dissect
from garment_sim_ros.geometry.shapes import Collider, ColliderPoses
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import ImplicitSettings
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.warm_up import warm_up


def on_a_ball(cloth, side=12, settings=None, solver_step=1 / 60, **material):
    vertices, triangles = cloth.grid(side, side, 0.24 / side)
    garment = cloth.garment(
        vertices + np.array([0.0, 0.0, 0.103]),
        triangles,
        **{"friction": 0.4, "damping": 2.0, **material},
    )
    ball = Collider(name="a", kind="sphere", bone="bone", geometry={"radius": 0.1})
    return Simulation(
        (garment,),
        cloth.colliders(ball),
        solver="implicit",
        settings=settings,
        solver_step=solver_step,
    )


@pytest.mark.slow
def test_warm_up_knows_it():
    warm_up("implicit")


def test_settings_have_defaults(cloth):
    assert on_a_ball(cloth).parameters.settings == ImplicitSettings()


def test_a_cloth_on_a_ball_rests_outside_and_hardly_moves(cloth):
    simulation = on_a_ball(
        cloth, bending_stiffness=1e-5, settings=ImplicitSettings(sub_step=1 / 240)
    )
    still = ColliderPoses.identity(2)
    simulation.reset(still)
    for _ in range(180):
        simulation.advance(still, still, 1 / 60)
        distance = np.linalg.norm(simulation.positions("cloth"), axis=1)
        # A contact is a spring: 20 times its weight presses a particle in by 0.1 mm.
        assert distance.min() >= 0.102 - 1e-4
    assert distance.min() < 0.1035
    assert simulation.health("cloth").rms_speed < 0.005


@pytest.mark.parametrize(("step", "sub_step"), [(1 / 240, 1 / 240), (1 / 15, 1 / 240)])
def test_cloth_rides_on_a_moving_collider(cloth, step, sub_step):
    """Contacts move with the shape, in every sub-step."""
    settings = ImplicitSettings(sub_step=sub_step)
    simulation = on_a_ball(cloth, settings=settings, solver_step=step)
    start = ColliderPoses.identity(2)
    simulation.reset(start)
    for k in range(round(1 / step)):
        end = ColliderPoses.identity(2)
        end.position[:, 0] = 0.5 * ((k + 1) * step) ** 2
        simulation.advance(start, end, step)
        start = end
    x = simulation.positions("cloth")
    assert x[:, 0].mean() == pytest.approx(0.5, abs=0.05)
    assert np.linalg.norm(x - end.position[1], axis=1).min() >= 0.102 - 2e-4


@pytest.mark.parametrize("step", [1e-4, 1 / 180, 1 / 60, 1 / 3])
@pytest.mark.parametrize("stiffness", [0.0, 1.0, 1e9])
def test_any_step_and_stiffness_stays_finite(cloth, step, stiffness):
    simulation = on_a_ball(
        cloth,
        solver_step=step,
        settings=ImplicitSettings(sub_step=step),
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
    simulation = on_a_ball(cloth)
    here, there = ColliderPoses.identity(2), ColliderPoses.identity(2)
    there.position[1] = [0.0, 0.0, 50.0]
    simulation.reset(here)
    for _ in range(60):
        simulation.advance(there, there, 1 / 60)
    # One second of free fall, with damping.
    assert simulation.positions("cloth")[:, 2].max() < -1.0


def test_degenerate_triangles_do_no_harm(cloth):
    vertices, triangles = cloth.grid(5, 5)
    triangles = np.concatenate([triangles, [[0, 1, 1], [0, 1, 2], [3, 4, 9]], triangles[:2]])
    simulation = Simulation(
        (cloth.garment(vertices, triangles, pins=[0]),), cloth.colliders(), solver="implicit"
    )
    still = ColliderPoses.identity(1)
    for _ in range(30):
        simulation.advance(still, still, 1 / 60)
    x = simulation.positions("cloth")
    assert np.isfinite(x).all()
    assert np.ptp(x, axis=0).max() < 0.2


def test_everything_may_be_pinned(cloth):
    vertices, triangles = cloth.grid(3, 3)
    garment = cloth.garment(vertices, triangles, pins=range(9))
    simulation = Simulation((garment,), cloth.colliders(), solver="implicit")
    still = ColliderPoses.identity(1)
    simulation.advance(still, still, 1 / 60)
    assert np.abs(simulation.positions("cloth") - vertices).max() < 1e-6


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


@pytest.mark.parametrize("side", [2, 9, 40])
def test_fronts_hold_every_entry_and_all_fill(cloth, side):
    """Each edge lies in the front of its earlier end, and a front's rows in its parent."""
    rest, triangles = cloth.grid(side, side)
    edges = mesh_topology(triangles).edges
    fronts = dissect(rest, edges)
    assert sorted(fronts.place) == list(range(side * side))
    ends = np.sort(fronts.place[edges], axis=1)

    def columns(s):
        rows = fronts.rows[fronts.row_start[s] : fronts.row_start[s + 1]]
        return np.concatenate([np.arange(fronts.first[s], fronts.first[s + 1]), rows])

    for low, high in ends:
        assert {low, high} <= set(columns(fronts.owner[low]))
    for s, parent in enumerate(fronts.parent):
        rows = columns(s)[fronts.first[s + 1] - fronts.first[s] :]
        assert len(rows) == 0 or set(rows) <= set(columns(parent))
    # A separator of a square has some side vertices: the factor grows like n log n.
    assert fronts.factor_start[-1] < 40 * side**2 * max(1.0, np.log2(side)) + 32**2
