"""A garment that does not pass through itself."""

import dataclasses

import numpy as np
import pytest
from naive.naive_self_collision import crossings, point_gap
from numba.core.runtime import _nrt_python
from scipy.spatial import cKDTree

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.simulation import Simulation

SPACING = 0.02
DISTANCE = 0.002
STEP = 1 / 180
BEND = 0.02
FLOOR = Collider(
    name="floor",
    kind="hull",
    bone="bone",
    geometry={
        "vertices": [
            [x, y, z] for z in (-1.0, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ],
        "faces": [
            *([0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]),
            *([1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]),
        ],
    },
)


def folded(cloth, distance, *shapes, tilt=0.0, columns=12, solver="relaxation", environment=None):
    """A sheet bent over by half, lying; `tilt` lowers the free end of its upper half."""
    flat, triangles = cloth.grid(21, columns, SPACING)
    garment = cloth.garment(flat, triangles, friction=0.3, damping=0.5, thickness=0.002)
    simulation = Simulation(
        (dataclasses.replace(garment, self_collision=distance),),
        cloth.colliders(*shapes),
        environment=environment,
        solver=solver,
        solver_step=STEP,
    )
    s = flat[:, 0] + np.pi * BEND / 2
    upper = s > np.pi * BEND
    x = flat.copy()
    turn = np.clip(s / BEND, 0.0, np.pi)
    x[:, 0] = BEND * np.sin(turn) + np.minimum(s, 0.0) - np.maximum(s - np.pi * BEND, 0.0)
    x[:, 2] = BEND * (1.0 - np.cos(turn)) + 0.003 - tilt * np.maximum(s - np.pi * BEND, 0.0)
    x[:, 1] += 0.3 * SPACING * upper
    return simulation, x, upper


def put(simulation, x, v):
    model, state = simulation.model("cloth"), simulation.state("cloth")
    state.x[:] = x[model.vertex] - simulation.origin
    state.v[:] = v[model.vertex]


def passing(simulation):
    triangles = simulation.model("cloth").triangles
    return len(crossings(simulation.positions("cloth"), triangles))


def advance(simulation, steps):
    still = ColliderPoses.identity(len(simulation.collider_set))
    for _ in range(steps):
        simulation.advance(still, still, STEP)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["relaxation", "xpbd"])
def test_a_sheet_thrown_on_itself_at_5_m_s_stays_apart_and_comes_to_rest(cloth, solver):
    simulation, x, upper = folded(cloth, DISTANCE, FLOOR, solver=solver)
    v = np.zeros_like(x)
    v[upper, 2] = -5.0
    put(simulation, x, v)
    for _ in range(30):
        advance(simulation, 2)
        assert passing(simulation) == 0
    advance(simulation, 300)
    assert passing(simulation) == 0
    x = simulation.positions("cloth").astype(np.float64)
    triangles = simulation.model("cloth").triangles
    lower = triangles[~upper[triangles].any(axis=1)]
    over = np.flatnonzero(upper & (x[:, 2] < 0.006))
    _, near = cKDTree(x[lower].mean(axis=1)).query(x[over], k=8)
    gaps = np.array([min(point_gap(x, p, lower[t]) for t in n) for p, n in zip(over, near)])
    gaps = gaps[gaps < 2 * DISTANCE]  # others lie beside it
    assert len(gaps) > 20
    # Weight presses on it between two steps: g h^2 is 0.3 mm.
    assert min(gaps) > DISTANCE - 6e-4
    assert simulation.health("cloth").rms_speed < 0.02


def test_without_it_the_sheet_passes_through(cloth):
    simulation, x, upper = folded(cloth, None, FLOOR)
    v = np.zeros_like(x)
    v[upper, 2] = -5.0
    put(simulation, x, v)
    advance(simulation, 10)
    assert passing(simulation) > 10
    assert simulation["cloth"].worn.constraints == ()


def test_what_starts_tangled_comes_free(cloth):
    weightless = Environment(gravity=(0.0, 0.0, 0.0))
    simulation, x, _ = folded(cloth, DISTANCE, tilt=0.5, environment=weightless)
    put(simulation, x, np.zeros_like(x))
    assert passing(simulation) > 10
    for _ in range(40):
        advance(simulation, 18)
        if passing(simulation) == 0:
            break
    assert passing(simulation) == 0
    assert simulation.health("cloth").max_speed < 2.0
    advance(simulation, 60)
    assert passing(simulation) == 0


def test_momentum_and_the_centre_of_mass_stay(cloth):
    simulation, x, upper = folded(cloth, DISTANCE)
    collision = simulation["cloth"].worn.constraints[0]
    model, state = simulation.model("cloth"), simulation.state("cloth")
    v = np.random.default_rng(3).normal(0.0, 0.3, x.shape)
    put(simulation, x, v)
    assert collision.hold(state, 0.0, STEP) == 0
    # The halves meet in one go.
    x[upper, 2] -= 2 * BEND + 0.002
    put(simulation, x, v)
    mass = model.mass.astype(np.float64)
    before = [mass @ a.astype(np.float64) for a in (state.x, state.v)]
    assert collision.hold(state, 0.0, STEP) > 100
    after = [mass @ a.astype(np.float64) for a in (state.x, state.v)]
    total = mass.sum()
    np.testing.assert_allclose(np.array(after) / total, np.array(before) / total, atol=1e-6)
    assert passing(simulation) == 0


def test_a_hanging_sheet_far_from_itself_is_not_touched(cloth):
    found = []
    for distance in (None, DISTANCE):
        flat, triangles = cloth.grid(12, 12, SPACING)
        garment = cloth.garment(flat, triangles, pins=range(12))
        garment = dataclasses.replace(garment, self_collision=distance)
        simulation = Simulation((garment,), cloth.colliders(), solver_step=STEP)
        advance(simulation, 60)
        found.append(simulation.positions("cloth").copy())
    np.testing.assert_array_equal(*found)


def test_a_step_allocates_nothing(cloth):
    def allocations(columns):
        simulation, x, upper = folded(cloth, DISTANCE, columns=columns)
        put(simulation, x, np.zeros_like(x))
        collision, state = simulation["cloth"].worn.constraints[0], simulation.state("cloth")
        collision.hold(state, 0.0, STEP)
        x[upper, 2] -= 2 * BEND
        put(simulation, x, np.zeros_like(x))
        assert collision.hold(state, 0.0, STEP) > 10
        _nrt_python.memsys_enable_stats()
        before = _nrt_python.memsys_get_stats_alloc()
        searches = collision.searches
        for _ in range(8):
            collision.hold(state, 0.0, STEP)
        return _nrt_python.memsys_get_stats_alloc() - before, collision.searches - searches

    assert allocations(6) == allocations(24)


def test_a_bad_state_is_left_alone(cloth):
    simulation, x, _ = folded(cloth, DISTANCE)
    put(simulation, x, np.zeros_like(x))
    advance(simulation, 8)
    collision, state = simulation["cloth"].worn.constraints[0], simulation.state("cloth")
    for value in (np.nan, np.inf):
        state.x[5] = value
        assert collision.hold(state, 0.0, STEP) == 0
