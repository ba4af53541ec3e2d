"""Bad particles are mended where they are; the rest of the garment does not notice."""

import dataclasses
import math

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.sim.sanity import keep_good
from garment_sim_ros.sim.simulation import Simulation

BALL = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": 0.1})
STEP = 1 / 180
SOLVERS = ("relaxation", "xpbd", "implicit")


def at(x):
    poses = ColliderPoses.identity(2)
    poses.position[:, 0] = x
    return poses


def swinging(cloth, solver):
    """A curtain on a rail that has begun to move, and the poses of the next steps."""
    vertices, triangles = cloth.grid(12, 12)
    garment = cloth.garment(
        vertices[:, [2, 1, 0]] + [0.12, 0, 0], triangles, range(132, 144), damping=0.5
    )
    simulation = Simulation((garment,), cloth.colliders(BALL), solver=solver, solver_step=STEP)
    path = [at(0.05 * math.sin(4.0 * STEP * k)) for k in range(200)]
    simulation.reset(path[0])
    for k in range(60):
        simulation.advance(path[k], path[k + 1])
    return simulation, path


def damage(state, kind):
    if kind == "one":
        state.x[70] = np.nan
    elif kind == "patch":
        state.x[60:68, 1] = np.inf
        state.v[60:68] = np.nan
    elif kind == "far":
        state.x[70, 2] += 1e4
    elif kind == "fast":
        state.v[70] = 1e12
    elif kind == "pin":
        state.x[-3] = np.nan
        state.v[-3] = np.nan


@pytest.mark.parametrize("solver", SOLVERS)
def test_damage_stays_where_it_was(cloth, solver):
    simulation, path = swinging(cloth, solver)
    state, health = simulation.state("cloth"), simulation.health("cloth")
    begin = state.copy()
    simulation.advance(path[60], path[61])
    expected = state.copy()
    way = np.linalg.norm(expected.x - begin.x, axis=1)
    assert way.max() > 5e-4  # It does move.
    rest = simulation.model("cloth").rest
    for kind, count in (("one", 1), ("patch", 8), ("far", 1), ("fast", 1), ("pin", 1)):
        recovered = health.recovered
        state.assign(begin)
        simulation.advance(path[60], path[61])
        # One step hardly depends on what was before: `implicit` remembers a little.
        assert np.abs(state.x - expected.x).max() < 1e-5
        state.assign(begin)
        damage(state, kind)
        bad = np.isnan(state.x).any(axis=1) | (state.x != begin.x).any(axis=1)
        bad |= (state.v != begin.v).any(axis=1)
        simulation.advance(path[60], path[61])
        assert np.isfinite(state.x).all()
        assert np.isfinite(state.v).all()
        assert (health.recovered - recovered, health.resets) == (count, 0)
        off = np.linalg.norm(state.x - expected.x, axis=1)
        # Within a small part of an edge where it was, and hardly anything further away.
        to_bad = np.linalg.norm(rest[:, None] - rest[bad][None], axis=2).min(axis=1)
        assert off.max() < 2e-3
        assert off[to_bad > 0.081].max() < 2e-5


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_garment_with_many_goes_back_to_where_it_was_with_its_pins(cloth, solver):
    simulation, path = swinging(cloth, solver)
    state, health = simulation.state("cloth"), simulation.health("cloth")
    simulation.advance(path[60], path[61])
    good = state.copy()
    state.x[:50] = np.nan
    simulation.advance(path[61], path[62])
    assert (health.resets, health.recovered) == (1, 0)
    # It has lost the way of one step and stands, at 0.5 m/s and falling.
    assert np.abs(state.x - good.x).max() < 6e-3
    assert health.max_speed < 1.0
    # It is cloth as any other: where the rail has stopped it comes to the same rest.
    for _ in range(400):
        simulation.advance(path[62], path[62])
    assert np.isfinite(state.x).all()
    assert health.resets == 1


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_second_of_forces_that_are_not_numbers_leaves_a_good_cloth(cloth, solver):
    simulation, path = swinging(cloth, solver)
    before = simulation.positions("cloth").copy()
    good = simulation.parameters
    gravity = (float("nan"), 0.0, -9.81)
    environment = dataclasses.replace(good.environment, gravity=gravity)
    simulation.parameters = dataclasses.replace(good, environment=environment)
    for _ in range(180):
        simulation.advance(path[60], path[60])
        assert np.isfinite(simulation.state("cloth").x).all()
        assert np.isfinite(simulation.state("cloth").v).all()
    assert simulation.health("cloth").resets == 180
    assert simulation.positions("cloth") == pytest.approx(before, abs=2e-6)
    simulation.parameters = good
    simulation.advance(path[60], path[61])
    assert simulation.health("cloth").resets == 180
    assert simulation.positions("cloth") == pytest.approx(before, abs=5e-3)


def test_a_garment_torn_apart_is_put_on_again(cloth):
    simulation, path = swinging(cloth, "relaxation")
    state = simulation.state("cloth")
    good = simulation.positions("cloth").copy()
    # A row that flies off: too slowly to be absurd in any one step, and soon 100 garments away.
    for _ in range(60):
        state.v[:] = 0.0
        state.v[: len(state.v) // 2, 0] = 0.9 * 100.0 * 0.3 * 180.0
        simulation.advance(path[60], path[60])
    state.v[:] = 0.0
    simulation.advance(path[60], path[60])
    assert simulation.health("cloth").resets > 0
    assert np.ptp(simulation.positions("cloth"), axis=0).max() < 10.0 * np.ptp(good, axis=0).max()


def test_keeping_a_state_agrees_with_its_twin():
    random = np.random.default_rng(3)
    x = random.normal(size=(20, 3)).astype(np.float32)
    v = random.normal(size=(20, 3)).astype(np.float32)
    for where, value in ((None, 0.0), ("x", np.nan), ("v", -np.inf), ("x", 9.0), ("v", -9.0)):
        a, b = x.copy(), v.copy()
        if where is not None:
            (a if where == "x" else b)[7, 1] = value
        good = np.zeros_like(x), np.ones_like(x)
        before = [array.copy() for array in good]
        fine = (np.abs(a) <= 8.0).all() and (np.abs(b) <= 8.0).all()
        assert fine == (where is None)
        flat = [array.reshape(-1) for array in (a, b, *good)]
        assert keep_good(*flat, np.float32(8.0), np.float32(8.0)) == fine
        for kept, new, old in zip(good, (a, b), before):
            assert (kept == (new if fine else old)).all()
