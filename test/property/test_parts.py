"""Parts of a large garment: what threads share gives the bits of one thread."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from naive import naive

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.geometry import locality
from garment_sim_ros.geometry.locality import (
    BLOCK,
    PARTS,
    SPLIT_FROM,
    order_by_part,
    part_starts,
    spatial_order,
)
from garment_sim_ros.jit import use_threads
from garment_sim_ros.params import Material
from garment_sim_ros.sim.account import account
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS, in_parts
from garment_sim_ros.sim.solvers.relaxation.springs import correct_springs
from garment_sim_ros.sim.solvers.xpbd.edges import solve_edges, solve_edges_apart
from garment_sim_ros.sim.solvers.xpbd.hinges import bend

PINS = np.arange(0, 30, 2)


@pytest.fixture
def small_parts(monkeypatch):
    """Parts from a tenth of the size on."""
    monkeypatch.setattr(locality, "SPLIT_FROM", SPLIT_FROM // 10)


@pytest.fixture
def model(cloth, small_parts):
    """A cloth of 900 vertices, 15 of them pinned, in parts."""
    vertices, triangles = cloth.grid(30, 30)
    places = vertices[PINS]
    return build_model(
        *("c", vertices, triangles, Material()),
        pins=PINS,
        pin_collider=np.zeros(len(PINS), int),
        pin_position=places,
    )


def shaken(model, seed=1):
    """Positions with every particle off by some 2 mm, shape [n, 3]."""
    rng = np.random.default_rng(seed)
    return (model.rest + rng.normal(0.0, 0.002, model.rest.shape)).astype(np.float32)


def test_few_points_are_one_part():
    assert part_starts(SPLIT_FROM - 1).tolist() == [0, SPLIT_FROM - 1]
    assert part_starts(0).tolist() == [0, 0]


def test_parts_are_whole_blocks_of_nearly_the_same_size_and_compact(cloth):
    vertices, _ = cloth.grid(80, 100)
    starts = part_starts(len(vertices))
    assert len(starts) == PARTS + 1
    assert (starts[:-1] % BLOCK == 0).all()
    assert np.ptp(np.diff(starts)) <= 2 * BLOCK
    placed = vertices[spatial_order(vertices)]
    areas = [np.ptp(placed[a:b], axis=0)[:2].prod() for a, b in pairwise(starts)]
    assert sum(areas) < 1.1 * np.ptp(vertices, axis=0)[:2].prod()


def test_groups_are_in_the_part_of_their_moving_points():
    starts = np.array([0, 4, 8])
    groups = np.array([[5, 6], [3, 4], [1, 9], [0, 3], [9, 8], [7, 8]])
    order, start = order_by_part(groups, starts)
    assert order.tolist() == [2, 3, 0, 5, 1, 4]
    assert start.tolist() == [0, 2, 4, 6]


def test_parts_of_springs_share_no_particle_that_moves(model):
    springs = model.springs
    pairs = springs.particles.reshape(-1, 2)
    moves = model.inverse_mass > 0.0
    assert model.parts == PARTS
    assert springs.part_start[0, 0] == 0
    assert springs.part_start[0, -1] == springs.part_start[1, 0] == springs.bending
    assert springs.part_start[1, -1] == len(springs) == springs.colour_start[-1]
    owner = np.searchsorted(part_starts(model.free_count), np.arange(len(model)), side="right")
    for start in springs.part_start:
        for p, (a, b) in enumerate(pairwise(start[:-1])):
            inside = pairs[a:b]
            assert (owner[inside[moves[inside]]] == p + 1).all()
        between = pairs[start[-2] : start[-1]]
        assert moves[between].all()
        assert (owner[between[:, 0]] != owner[between[:, 1]]).all()
    for a, b in pairwise(springs.colour_start):
        assert len(np.unique(pairs[a:b])) == 2 * (b - a)
    assert set(springs.part_start.ravel()) <= set(springs.colour_start)


def test_a_small_garment_has_the_order_that_it_has_without_parts(cloth, monkeypatch):
    vertices, triangles = cloth.grid(9, 9)
    springs = build_model("c", vertices, triangles, Material()).springs
    monkeypatch.setattr(locality, "PARTS", 1)
    again = build_model("c", vertices, triangles, Material()).springs
    assert springs.part_start.shape == (2, 3)
    assert springs.particles.tolist() == again.particles.tolist()


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_springs_in_parts(model, threads):
    springs = model.springs
    arrays = (springs.particles, springs.rest_length, springs.share)
    x = shaken(model)
    alone, shared = x.copy(), x.copy()
    correct_springs(alone.reshape(-1), *arrays, 2)
    use_threads(threads)
    in_parts.correct_springs_in_parts(shared.reshape(-1), *arrays, springs.part_start, 2)
    assert shared.tobytes() == alone.tobytes()
    expected = naive.correct_springs(
        x, springs.particles.reshape(-1, 2), springs.rest_length, model.inverse_mass, 2
    )
    # Two ends of a spring 20 mm long, each rounded to 0.02 micrometres in every correction.
    assert np.abs(shared - expected).max() < 1e-6
    assert (shared[model.free_count :] == x[model.free_count :]).all()


def test_edges_and_hinges_in_parts(model):
    workspace = SOLVERS["xpbd"].workspace(model, 0)
    workspace.prepare(model, 1e-3, 0.5, 4)
    ready, parts = workspace.prepared, workspace.parts
    x, v = shaken(model), shaken(model, 2)
    h = np.float32(4e-3)
    use_threads(2)

    edges = (ready.edge_particles, ready.edges)
    alone, shared = x.copy(), x.copy()
    solve_edges(alone.reshape(-1), *edges)
    in_parts.solve_edges_in_parts(shared.reshape(-1), *edges, parts.edges)
    assert shared.tobytes() == alone.tobytes() != x.tobytes()

    moved = np.zeros((2, x.size), np.float32)
    pull = np.zeros((2, len(ready.edges)), np.float32)
    for _ in range(2):
        solve_edges_apart(x.reshape(-1), moved[0], *edges, pull[0], False)
        in_parts.solve_edges_apart_in_parts(
            x.reshape(-1), moved[1], *edges, pull[1], False, parts.edges
        )
    assert moved[0].any()
    assert moved[0].tobytes() == moved[1].tobytes()
    assert pull[0].tobytes() == pull[1].tobytes()

    bent = np.stack([v, v])
    hinges = (ready.hinge_particles, ready.hinges)
    bend(x, bent[0], *hinges, h)
    in_parts.bend_in_parts(x, bent[1], *hinges, h, parts.hinges)
    assert bent[0].tobytes() == bent[1].tobytes() != v.tobytes()


def falling(cloth, solver, threads):
    """A cloth in parts that has fallen on a ball, and what is said of it."""
    vertices, triangles = cloth.grid(30, 30)
    ball = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": 0.1})
    settings = SOLVERS[solver].settings(threads=threads)
    simulation = Simulation(
        (
            cloth.garment(
                vertices + np.array([0.0, 0.0, 0.11]), triangles, pins=PINS, friction=0.3
            ),
        ),
        cloth.colliders(ball),
        solver=solver,
        settings=settings,
    )
    still = ColliderPoses.identity(2)
    for _ in range(20):
        simulation.advance(still, still, 1 / 60)
    return simulation


@pytest.mark.parametrize("solver", ["relaxation", pytest.param("xpbd", marks=pytest.mark.slow)])
def test_any_number_of_threads_gives_the_same_bits(cloth, small_parts, solver):
    alone, shared = (falling(cloth, solver, threads) for threads in (1, 2))
    assert alone.health("cloth").contacts > 0
    for name in ("x", "v"):
        a, b = (getattr(s.state("cloth"), name) for s in (alone, shared))
        assert a.tobytes() == b.tobytes()


def test_it_is_told_who_shares_sweeps(cloth, small_parts, monkeypatch):
    monkeypatch.setattr("garment_sim_ros.sim.account.usable_threads", lambda n: min(n, 4))
    simulation = Simulation((cloth.garment(*cloth.grid(30, 30)),), cloth.colliders())
    told = [text for text in account(simulation)["leaves_out"] if "threads" in text]
    assert told == ["sweeps on several threads (threads is 1, usable are 4)"]
    parameters = simulation.parameters
    simulation.parameters = dataclasses.replace(
        parameters, settings=dataclasses.replace(parameters.settings, threads=8)
    )
    assert "sweeps on several threads (4 for cloth)" in account(simulation)["models"]
