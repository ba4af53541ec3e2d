"""Kernels of `implicit` against naive float64 twins, and its matrix against its purpose."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_implicit

from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import Material
from garment_sim_ros.sim.elasticity import hinges
from garment_sim_ros.sim.solvers.implicit.cholesky import factorise, solve_factorised
from garment_sim_ros.sim.solvers.implicit.descent import keep_up
from garment_sim_ros.sim.solvers.implicit.dissection import dissect
from garment_sim_ros.sim.solvers.implicit.forces import edge_forces, hinge_forces, on_the_cone
from garment_sim_ros.sim.solvers.implicit.given import Past
from garment_sim_ros.sim.solvers.implicit.lbfgs import descend, remember
from garment_sim_ros.sim.solvers.implicit.workspace import bending_bound

SEEDS = st.integers(0, 10**6)


def strained(cloth, seed, scale, rows=6, columns=7):
    rng = np.random.default_rng(seed)
    rest, triangles = cloth.grid(rows, columns)
    rest = rest + rng.normal(0.0, 0.002, rest.shape)
    x = (rest + rng.normal(0.0, scale, rest.shape)).astype(np.float32)
    return rng, rest, triangles, x


def scattered(force, place, n):
    """A kernel's force, whose last column is that of pins, in the order of the particles."""
    return np.where(place[:, None] < n, force.T[np.minimum(place, n)], 0.0)


@given(SEEDS)
@settings(derandomize=True, deadline=None, max_examples=20)
def test_forces(cloth, seed):
    """To 2e-3 of the largest: strains of up to 10 %, where the quotient is 0.3 % off."""
    rng, rest, triangles, x = strained(cloth, seed, 0.0003)
    n = len(x)
    edges = mesh_topology(triangles).edges.astype(np.int32)
    length = np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1)
    stiffness = rng.uniform(1.0, 2000.0, len(edges))
    pairs = hinges(rest, triangles, Material(bending_stiffness=1e-2))
    # Two pins: their forces go to the last column, together.
    pinned = rng.choice(n, 2, replace=False)
    place = np.full(n, n - 2)
    place[np.setdiff1d(np.arange(n), pinned)] = rng.permutation(n - 2)
    force = np.full((3, n - 1), np.nan, np.float32)
    edge_forces(
        x.reshape(-1),
        edges.ravel().astype(np.uint32),
        place[edges].ravel().astype(np.uint32),
        (length**2).astype(np.float32),
        stiffness.astype(np.float32),
        force,
    )
    exact = naive_implicit.edge_forces(x.astype(np.float64), edges, length, stiffness)
    exact[pinned] = 0.0
    found = scattered(force, place, n - 2)
    assert np.abs(found - exact).max() < 2e-3 * np.abs(exact).max()
    force[:] = 0.0
    hinge_forces(
        x,
        pairs.particles,
        place[pairs.particles].astype(np.uint32),
        pairs.weight.astype(np.float32),
        pairs.stiffness.astype(np.float32),
        force,
    )
    exact = naive_implicit.hinge_forces(
        x.astype(np.float64), pairs.particles, pairs.weight, pairs.stiffness
    )
    exact[pinned] = 0.0
    found = scattered(force, place, n - 2)
    assert np.abs(found - exact).max() < 1e-4 * np.abs(exact).max()


@given(SEEDS, st.floats(0.0, 2.0))
@settings(derandomize=True, deadline=None, max_examples=50)
def test_contact_forces(seed, friction):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    apart, gap = rng.normal(size=3), rng.uniform(0.0, 2.0)
    expected = naive_implicit.contact_force(apart, normal, gap, friction)
    found = on_the_cone(*np.float32([*apart, *normal, gap, friction]))
    assert np.abs(np.array(found) - expected).max() < 1e-5


@given(SEEDS, st.integers(0, 5))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_directions(cloth, seed, count):
    """With three steps kept of up to five: the two loops are BFGS with the matrix at the start."""
    rng = np.random.default_rng(seed)
    rest, triangles = cloth.grid(4, 5)
    n = len(rest)
    edges = mesh_topology(triangles).edges.astype(np.int32)
    stiffness, mass = rng.uniform(0.5, 2.0, len(edges)), rng.uniform(0.5, 1.0, n)
    fronts = dissect(rest, edges)
    matrix = naive_implicit.laplacian(edges, stiffness, n) + np.diag(mass)
    diagonal = np.empty(n)
    diagonal[fronts.place] = np.diag(matrix)
    factor = np.zeros(fronts.factor_start[-1], np.float32)
    factorise(
        fronts,
        stiffness,
        diagonal,
        np.ones(len(fronts.parent), np.bool_),
        np.zeros(fronts.widest**2),
        np.zeros(fronts.update_start[-1]),
        factor,
    )
    past = Past.room_for(n, kept=3)
    steps = [rng.normal(size=(3, n)) for _ in range(count)]
    changes = [s @ matrix + 0.1 * rng.normal(size=(3, n)) for s in steps]
    kept = 0
    for s, y in zip(steps, changes):
        direction, after = np.zeros((2, 3, n + 1), np.float32)
        direction[:, fronts.place] = s
        after[:, fronts.place] = -y
        kept = remember(past, kept, direction, 1.0, np.zeros_like(after), after)
    assert kept == count
    force, direction = np.zeros((2, 3, n + 1), np.float32)
    right = rng.normal(size=(3, n))
    force[:, fronts.place] = right
    descend(force, fronts, factor, np.zeros(fronts.widest, np.float32), past, count, direction)
    expected = naive_implicit.quasi_newton_direction(right, matrix, steps[-3:], changes[-3:])
    found = direction[:, fronts.place]
    # Sums of float32 over a matrix whose condition is below 100.
    assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()


@given(SEEDS, st.integers(1, 14), st.integers(1, 14), st.floats(-4.0, 0.0))
@settings(derandomize=True, deadline=None, max_examples=15)
def test_solutions(cloth, seed, rows, columns, stiffer):
    """Of matrices of meshes, also after a change of some of the diagonal.

    float32 leaves 1e-7 times the condition number, up to 1e5 here, in an error of the matrix that
    is harmless: what is compared is the residual.
    """
    rng = np.random.default_rng(seed)
    rest, triangles = cloth.grid(rows + 1, columns + 1)
    n = len(rest)
    edges = mesh_topology(triangles).edges.astype(np.int32)
    stiffness = rng.uniform(0.1, 1.0, len(edges))
    mass = 10.0**stiffer * rng.uniform(0.5, 1.0, n)
    fronts = dissect(rest, edges)
    front, update = np.zeros(fronts.widest**2), np.zeros(fronts.update_start[-1])
    factor = np.full(fronts.factor_start[-1], np.nan, np.float32)
    changed = np.ones(len(fronts.parent), np.bool_)
    matrix = naive_implicit.laplacian(edges, stiffness, n)
    for _ in range(2):
        full = matrix + np.diag(mass)
        diagonal = np.empty(n)
        diagonal[fronts.place] = np.diag(full)
        factorise(fronts, stiffness, diagonal, changed, front, update, factor)
        assert not changed.any()
        right = rng.normal(size=(3, n))
        x = np.zeros((3, n + 1), np.float32)
        x[:, fronts.place] = right
        solve_factorised(fronts, factor, x, np.zeros(fronts.widest, np.float32))
        left = full @ x[:, fronts.place].T.astype(np.float64) - right.T
        size = np.abs(x).max() * np.diag(full).max()
        assert np.abs(left).max() < 1e-5 * size
        some = rng.choice(n, max(1, n // 10), replace=False)
        mass[some] += 5.0
        changed[fronts.owner[fronts.place[some]]] = True


@given(SEEDS)
@settings(derandomize=True, deadline=None, max_examples=10)
def test_the_matrix_bounds_bending(cloth, seed):
    """Else an explicit force of bending would not be stable."""
    _, rest, triangles, _ = strained(cloth, seed, 0.0)
    edges = mesh_topology(triangles).edges.astype(np.int32)
    pairs = hinges(rest, triangles, Material(bending_stiffness=1.0))
    bound = bending_bound(edges, pairs.particles, pairs.weight, pairs.stiffness)
    above = naive_implicit.laplacian(edges, bound, len(rest))
    for particles, w, k in zip(pairs.particles, pairs.weight, pairs.stiffness):
        above[np.ix_(particles, particles)] -= k * np.outer(w, w)
    lowest = np.linalg.eigvalsh(above)[0]
    assert lowest > -1e-9 * bound.max()


def test_where_particles_lag_from_stays_when_they_are_put_elsewhere():
    rng = np.random.default_rng(0)
    before, x, behind = rng.normal(size=(3, 20, 3)).astype(np.float32)
    expected = before.astype(np.float64) + behind - x
    keep_up(x, before, behind)
    np.testing.assert_allclose(behind, expected, atol=1e-6)
