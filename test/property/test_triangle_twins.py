"""Triangles of constant strain against their float64 twin, wherever their corners are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_triangles

from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.jit import kernel
from garment_sim_ros.params import Material
from garment_sim_ros.sim.membrane import Law, membrane, stored
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.solvers.implicit.triangles import (
    Triangles,
    triangle_bound,
    triangle_forces,
)
from garment_sim_ros.sim.solvers.xpbd.stretch import triangles_of
from garment_sim_ros.sim.solvers.xpbd.triangles import solve_triangles, solve_triangles_apart

SEEDS = st.integers(0, 10**6)


@kernel()
def forces(x, triangles, force):
    triangle_forces(x, triangles, force)


def made(cloth, seed, pins=3):
    """An uneven mesh of a fabric drawn at random."""
    rng = np.random.default_rng(seed)
    rest, triangles = cloth.grid(6, 7)
    rest = rest + rng.normal(0.0, 0.002, rest.shape)
    material = Material(
        stretch_stiffness_warp=10.0 ** rng.uniform(1.0, 4.0),
        stretch_stiffness_weft=10.0 ** rng.uniform(1.0, 4.0),
        shear_stiffness=10.0 ** rng.uniform(0.0, 3.0),
        poisson_ratio=rng.uniform(0.0, 0.9),
    )
    pinned = rng.choice(len(rest), pins, replace=False)
    return rng, build_model("cloth", rest, triangles, material, pins=pinned)


def once(shapes):
    """Triangles in the order of a pass, each once."""
    _, first = np.unique(shapes.ready.particles.reshape(-1, 3), axis=0, return_index=True)
    return np.sort(first)


@given(SEEDS, st.integers(1, 4), st.floats(1e-4, 0.02), st.floats(1e-4, 3e-3))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_xpbd(cloth, seed, iterations, dt, scale):
    rng, model = made(cloth, seed)
    shapes = triangles_of(model)
    ready, first = shapes.ready, once(shapes)
    assert len(first) > 50
    x = (model.rest + rng.normal(0.0, scale, model.rest.shape)).astype(np.float32)
    corners = ready.particles.reshape(-1, 3).astype(np.int32)[first]
    twin = naive_triangles.Triangles(
        corners, shapes.along[first], shapes.area[first], Law.of(model.material)
    )
    expected = naive_triangles.solve_triangles(x, twin, model.inverse_mass, dt, iterations)
    shapes.prepare(model.inverse_mass, 1.0, dt)
    limit = 1e-6 + 1e-3 * float(np.abs(expected - x).max())
    if iterations == 1:
        wide = np.pad(x, ((0, 0), (0, 1))).reshape(-1)
        solve_triangles(wide, ready.particles, ready.numbers, ready.law)
        assert np.abs(wide.reshape(-1, 4)[:, :3] - expected).max() < limit
    moved = np.zeros(x.size, np.float32)
    for _ in range(iterations):
        solve_triangles_apart(
            *(x.reshape(-1), moved, ready.particles, ready.numbers, ready.law, ready.stress),
            iterations == 1,
        )
    assert np.abs(x + moved.reshape(-1, 3) - expected).max() < limit


@given(SEEDS, st.floats(1e-4, 0.02))
@settings(derandomize=True, deadline=None, max_examples=10)
def test_implicit_forces(cloth, seed, scale):
    """They are less the gradient of the energy, as differences of the twin's have it."""
    rng, model = made(cloth, seed)
    cloth_, law, n = membrane(model), Law.of(model.material), len(model)
    x = (model.rest + rng.normal(0.0, scale, model.rest.shape)).astype(np.float32)
    force = np.zeros((3, n + 1), np.float32)
    forces(x, Triangles.of(cloth_, law, np.arange(n, dtype=np.uint32)), force)
    twin = naive_triangles.Triangles(cloth_.particles, cloth_.along, cloth_.area, law)
    expected = naive_triangles.forces(x.astype(np.float64), twin)
    assert np.abs(force[:, :n].T - expected).max() < 1e-4 * np.abs(expected).max()
    way, h = rng.normal(size=x.shape), 1e-7
    ahead, behind = x + h * way, x - h * way
    slope = sum(
        naive_triangles.energy(ahead[p], a, area, law)
        - naive_triangles.energy(behind[p], a, area, law)
        for p, a, area in zip(cloth_.particles, cloth_.along, cloth_.area)
    ) / (2.0 * h)
    energy = sum(
        naive_triangles.energy(x[p].astype(np.float64), a, area, law)
        for p, a, area in zip(cloth_.particles, cloth_.along, cloth_.area)
    )
    assert stored(x.astype(np.float64), cloth_, law) == pytest.approx(energy, rel=1e-9)
    size = np.abs(force).sum() * np.abs(way).mean()
    assert float((force[:, :n].T * way).sum()) == pytest.approx(-slope, abs=1e-4 * size)


@given(SEEDS, st.floats(1e-3, 0.1), st.floats(1e-4, 0.1))
@settings(derandomize=True, deadline=None, max_examples=30)
def test_the_bound_of_implicit_is_one(cloth, seed, scale, further):
    """From any state to any other the energy is at most what force and matrix say.

    With no coupling of the threads, which the matrix bounds at small strain only.
    """
    rng, model = made(cloth, seed, pins=0)
    cloth_, n = membrane(model), len(model)
    law = Law.of(model.material)._replace(poisson=0.0)
    edges = mesh_topology(cloth_.particles).edges
    k = triangle_bound(edges, cloth_, law)
    x = (model.rest + rng.normal(0.0, scale, model.rest.shape)).astype(np.float32)
    way = rng.normal(0.0, further, x.shape)
    force = np.zeros((3, n + 1), np.float32)
    forces(x, Triangles.of(cloth_, law, np.arange(n, dtype=np.uint32)), force)
    before, after = (
        sum(
            naive_triangles.energy(y[p], a, area, law)
            for p, a, area in zip(cloth_.particles, cloth_.along, cloth_.area)
        )
        for y in (x.astype(np.float64), x + way)
    )
    spread = (k * ((way[edges[:, 0]] - way[edges[:, 1]]) ** 2).sum(axis=1)).sum()
    most = before - float((force[:, :n].T * way).sum()) + 0.5 * spread
    assert after <= most + 1e-5 * (before + after)


def single(x, dt=1e-3, poisson=0.2):
    """One triangle of the default fabric after a pass from corners at x, in 3 ways."""
    rest = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.004, 0.018, 0.0]])
    model = build_model(
        "one", rest, np.array([[0, 1, 2]]), Material(poisson_ratio=poisson), pins=None
    )
    shapes = triangles_of(model)
    shapes.prepare(model.inverse_mass, 1.0, dt)
    ready = shapes.ready
    x = np.asarray(x, np.float32)[model.vertex]
    wide = np.pad(x, ((0, 0), (0, 1))).reshape(-1)
    solve_triangles(wide, ready.particles, ready.numbers, ready.law)
    force = np.zeros((3, 4), np.float32)
    cloth_ = membrane(model)
    forces(x, Triangles.of(cloth_, Law.of(model.material), np.arange(3, dtype=np.uint32)), force)
    return model, x, wide.reshape(-1, 4)[:, :3], force[:, :3].T


@pytest.mark.parametrize(
    "x",
    [
        np.zeros((3, 3)),
        np.full((3, 3), 0.7),
        [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.004, 0.0, 0.0]],
        [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.02, 0.0, 0.0]],
        [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.004, 1e-9, 0.0]],
        [[0.5, 0.5, 0.5], [0.5, 0.5, 0.5], [0.508, 0.5, 0.5]],
        [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.4, 1.8, 0.0]],
        [[0.0, 0.0, 0.0], [-0.02, 1e-4, 0.0], [0.004, -0.018, 1e-5]],
    ],
    ids=["a point", "elsewhere", "a line", "an edge", "nearly", "far away", "large", "crossed"],
)
def test_triangles_without_shape(x):
    """Finite; corners go no farther than a correction of the worst strain; momentum stays."""
    model, x, solved, force = single(x)
    assert np.isfinite(solved).all()
    assert np.isfinite(force).all()
    size = max(0.03, float(np.abs(x - x[0]).max()))
    assert np.abs(solved - x).max() < 2.0 * size
    moved = model.mass[:, None] * (solved - x).astype(np.float64)
    assert np.abs(moved.sum(axis=0)).max() < 1e-4 * model.mass.sum() * size
    assert np.abs(force.sum(axis=0)).max() <= 1e-4 * max(1.0, float(np.abs(force).max()))


def test_a_triangle_turned_over_is_at_rest():
    """A membrane has no sides: so is one turned by any angle."""
    rest = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.004, 0.018, 0.0]])
    for axis in ([1.0, 0.0, 0.0], [0.3, -0.8, 0.5]):
        for angle in (np.pi, 1.0):
            k = np.asarray(axis) / np.linalg.norm(axis)
            K = np.cross(np.eye(3), k)
            turned = rest @ (np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K)
            _, x, solved, force = single(turned)
            assert np.abs(solved - x).max() < 1e-7
            assert np.abs(force).max() < 1e-2 * 0.02  # Of 2 N per metre of strain.


def test_what_is_not_a_number_stays_so():
    """It is for `sanity` to see; nothing else becomes a number by accident."""
    _, _, solved, _ = single([[np.nan, 0.0, 0.0], [0.02, 0.0, 0.0], [0.004, 0.018, 0.0]])
    assert np.isnan(solved).any()
