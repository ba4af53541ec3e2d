"""Kernels of `xpbd` against naive float64 twins, and stiffness of meshes against plain strains."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_xpbd

from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import Material
from garment_sim_ros.sim.elasticity import edge_stiffness, hinges
from garment_sim_ros.sim.solvers.xpbd.edges import prepare_edges, solve_edges, solve_edges_apart
from garment_sim_ros.sim.solvers.xpbd.hinges import bend, prepare_hinges
from garment_sim_ros.sim.solvers.xpbd.motion import arrive, coast
from garment_sim_ros.sim.solvers.xpbd.order import in_fours

SEEDS = st.integers(0, 10**6)


def strained(cloth, seed, scale):
    rng = np.random.default_rng(seed)
    rest, triangles = cloth.grid(6, 7)
    rest = rest + rng.normal(0.0, 0.002, rest.shape)
    x = (rest + rng.normal(0.0, scale, rest.shape)).astype(np.float32)
    weight = rng.uniform(500.0, 2000.0, len(rest))
    weight[rng.choice(len(rest), 3, replace=False)] = 0.0
    return rng, rest, triangles, x, weight.astype(np.float32)


def as_fours(x):
    return np.pad(x, ((0, 0), (0, 1)))


@given(SEEDS, st.integers(1, 4), st.floats(1e-4, 0.02))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_edges(cloth, seed, iterations, dt):
    """The kernel's quotient stands for 1 - l/d: equal to 1e-5 m at strains of a few percent."""
    rng, rest, triangles, x, weight = strained(cloth, seed, 0.0003)
    edges = mesh_topology(triangles).edges
    edges = rng.permutation(edges[weight[edges].sum(axis=1) > 0.0])
    order, fours = in_fours(edges)
    assert 0 < fours < len(edges)
    edges = edges[order]
    length = np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1)
    stiffness = rng.uniform(1.0, 2000.0, len(edges))
    expected = naive_xpbd.solve_edges(x, edges, length, stiffness, weight, dt, iterations)
    particles = edges.ravel().astype(np.uint32)
    ready = np.zeros((4, len(edges)), np.float32)
    prepare_edges(particles, stiffness, weight, length**2, 1.0, dt, ready)
    once = as_fours(x)
    if iterations == 1:
        solve_edges(once.reshape(-1), particles, ready, fours)
        assert np.abs(once[:, :3] - expected).max() < 1e-5
    pull = np.zeros(len(edges), np.float32)
    moved = np.zeros_like(x)
    for _ in range(iterations):
        solve_edges_apart(
            x.reshape(-1), moved.reshape(-1), particles, ready, pull, iterations == 1
        )
    assert np.abs(x + moved - expected).max() < 1e-5


@given(SEEDS, st.floats(1e-4, 0.05), st.floats(1e-6, 1.0))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_bending(cloth, seed, dt, stiffness):
    rng, rest, triangles, x, weight = strained(cloth, seed, 0.005)
    v = rng.normal(size=x.shape).astype(np.float32)
    pairs = hinges(rest, triangles, Material(bending_stiffness=stiffness))
    expected = naive_xpbd.bend(
        x.astype(np.float64), v, pairs.particles, pairs.weight, pairs.stiffness, weight, dt
    )
    ready = np.zeros((len(pairs.particles), 8), np.float32)
    prepare_hinges(pairs.particles, pairs.weight, pairs.stiffness, weight, 1.0, dt, ready)
    bent = as_fours(v)
    bend(as_fours(x).reshape(-1), bent.reshape(-1), pairs.particles, ready, np.float32(dt))
    assert np.abs(bent[:, :3] - expected).max() < 1e-4 * max(1.0, float(np.abs(expected).max()))


def test_ways_shorter_than_rounding_add_up():
    """At half a metre coordinates are multiples of 6e-8 m; 500 sub-steps of 1e-9 m go 5e-7 m."""
    rng = np.random.default_rng(3)
    n, dt, count = 300, np.float32(1e-4), 500
    x = rng.uniform(0.5, 1.0, n).astype(np.float32)
    v = rng.uniform(-1e-5, 1e-5, n).astype(np.float32)
    pushed = rng.uniform(-1e-8, 1e-8, n).astype(np.float32)
    start, speed = x.astype(np.float64), v.astype(np.float64)
    x_start, moved, low = np.zeros((3, n), np.float32)
    for _ in range(count):
        coast(x, v, x_start, moved, low, pushed, np.float32(1.0), dt)
        arrive(x, v, moved, low, dt, np.float32(1.0) / dt)
    rounds = np.arange(1, count + 1)
    way = dt * (speed * count + pushed.astype(np.float64) * rounds.sum())
    np.testing.assert_allclose(x.astype(np.float64) + low - start, way, atol=1e-10)
    assert np.abs(low).max() <= np.spacing(np.float32(0.99)) / 2
    np.testing.assert_allclose(v, speed + count * pushed.astype(np.float64), atol=1e-9)


@given(
    st.floats(10.0, 5000.0), st.floats(10.0, 5000.0), st.floats(0.0, 1.0), st.floats(0.01, 0.05)
)
@settings(derandomize=True, deadline=None, max_examples=20)
def test_a_grid_has_the_stiffness_of_its_fabric(cloth, warp, weft, share, spacing):
    """Energy of plain strains along the warp (x, in a flat mesh), the weft, and in shear."""
    shear = share * min(warp, weft)
    rest, triangles = cloth.grid(12, 9, spacing)
    edges = mesh_topology(triangles).edges
    material = Material(
        stretch_stiffness_warp=warp, stretch_stiffness_weft=weft, shear_stiffness=shear
    )
    k = edge_stiffness(rest, triangles, edges, material)
    apart = (rest[edges[:, 0]] - rest[edges[:, 1]])[:, :2]
    area = 11 * 8 * spacing**2
    for strain, expected in (
        ([[1.0, 0.0], [0.0, 0.0]], warp),
        ([[0.0, 0.0], [0.0, 1.0]], weft),
        ([[0.0, 0.5], [0.5, 0.0]], shear),
    ):
        change = np.einsum("mi,ij,mj->m", apart, strain, apart) / np.linalg.norm(apart, axis=1)
        assert abs((k * change**2).sum() / area - expected) < 0.02 * max(expected, 0.02 * warp)


def test_a_mesh_bent_to_a_cylinder_stores_half_its_stiffness_times_curvature_squared(cloth):
    rest, triangles = cloth.grid(41, 41)
    pairs = hinges(rest, triangles, Material(bending_stiffness=1e-3))
    for along, across in ((0, 1), (1, 0)):
        bent = np.zeros_like(rest)
        bent[:, along] = 3.0 * np.sin(rest[:, along] / 3.0)
        bent[:, across] = rest[:, across]
        bent[:, 2] = 3.0 * np.cos(rest[:, along] / 3.0)
        curvature = np.einsum("hk,hkd->hd", pairs.weight, bent[pairs.particles])
        energy = 0.5 * (pairs.stiffness * (curvature**2).sum(axis=1)).sum()
        # Edges of the boundary have no hinge.
        assert abs(energy / (0.5 * 1e-3 / 3.0**2 * 0.8**2) - 1.0) < 0.04
