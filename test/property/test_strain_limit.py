"""The limit of strain: against its twin, along surfaces, and where a ball stretches cloth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_xpbd

import garment_sim_ros as gs
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.sim.solvers.xpbd.edges import prepare_edges
from garment_sim_ros.sim.solvers.xpbd.given import Particles, Planes
from garment_sim_ros.sim.solvers.xpbd.prepared import Edges
from garment_sim_ros.sim.solvers.xpbd.strain_limit import (
    _CREEP,
    _EASES,
    _LONGEST,
    _UTMOST,
    limit_strain,
    shorten_longest,
)

LIMIT = 0.5
TIME = 1 / 180
SLOW = 3e-5
CARRY = np.zeros((3, 3, 4), np.float32)
"""Of shapes that rest, move too slowly and move."""
CARRY[1, 1, 3], CARRY[2, 2, 3] = 0.5 * SLOW, 2.0 * SLOW


def particles_at(x, x_before, moved):
    """What the limit needs of a garment's particles: `moved` is what contact does to them [m]."""
    others = dict.fromkeys(Particles._fields)
    return Particles(
        **others | {"x": x, "x_start": x, "x_search": x_before, "x_predicted": x - moved}
    )


def ready_edges(rng, edges, rest, weight):
    """Edges as the solver has them."""
    length = np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1)
    ready = np.zeros((4, len(edges)), np.float32)
    particles = edges.ravel().astype(np.uint32)
    stiffness = rng.uniform(1.0, 2000.0, len(edges))
    prepare_edges(particles, stiffness, weight, length**2, 1.0, 1e-3, ready)
    return Edges(particles, ready, 0, np.zeros(len(edges), np.float32)), length


def strained_cloth(cloth, seed, scale):
    """A crumpled sheet with three pins, of which shapes and the guard hold some particles.

    Returns:
        Positions, `Edges`, `Planes`, what the guard keeps, and the same as the twin has it.
    """
    rng = np.random.default_rng(seed)
    rest, triangles = cloth.grid(12, 12)
    x = (rest + rng.normal(0.0, scale, rest.shape)).astype(np.float32)
    weight = rng.uniform(500.0, 2000.0, len(rest)).astype(np.float32)
    free = len(rest) - 3
    weight[free:] = 0.0
    edges = rng.permutation(mesh_topology(triangles).edges)
    edges = edges[weight[edges].sum(axis=1) > 0.0]
    ready, length = ready_edges(rng, edges, rest, weight)
    normal = rng.normal(size=(free, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    shape = rng.choice([-1, 0, 1, 2], free).astype(np.int32)
    depth = rng.choice([0.001, np.inf], free, p=[0.8, 0.2]).astype(np.float32)
    kept = rng.choice([-1, -1, -1, 2], free).astype(np.int32)
    caught = (depth == np.inf) & (rng.random(free) < 0.5)
    empty = np.zeros((free, 3), np.float32)
    outward = np.full((len(rest), 3), np.nan)
    outward[:free][shape >= 0] = normal[shape >= 0]
    pins = [False] * 3
    strained = naive_xpbd.Strained(
        edges=edges,
        rest_length=length,
        inverse_mass=weight,
        normal=outward,
        pressed=np.append((shape >= 0) & (depth == np.inf), pins),
        caught=np.append((shape >= 0) & caught, pins),
        kept=np.append(kept >= 0, pins),
        free=free,
        longest=_LONGEST,
        utmost=_UTMOST,
    )
    planes = Planes(shape, normal.astype(np.float32), depth, caught, empty, empty)
    return x, ready, planes, kept, strained


# Edges are 2 cm long: with some 4 mm, few of them are too long.
SCALE = st.floats(0.0034, 0.0044) | st.floats(0.001, 0.05)


@given(st.integers(0, 10**6), SCALE)
@settings(derandomize=True, deadline=None, max_examples=30)
def test_limit(cloth, seed, scale):
    """As the twin; nothing goes into a surface that it touches, and what stays stays.

    Velocities stay, too: they are what contact moved.
    """
    x, ready, planes, kept, strained = strained_cloth(cloth, seed, scale)
    rng = np.random.default_rng(seed + 1)
    edges, free = strained.edges, strained.free
    touches = np.append(planes.shape >= 0, [False] * 3)
    moves = np.append(planes.shape == 2, [False] * 3)
    held = touches[edges].all(axis=1) | strained.pressed[edges].any(axis=1)
    eased = held & moves[edges].any(axis=1)
    x_before = (x + rng.normal(0.0, scale, x.shape)).astype(np.float32)
    own = particles_at(x, x_before, rng.normal(0.0, 1e-3, x.shape).astype(np.float32))
    by_contact = x - own.x_predicted
    grown = np.where(eased, -_EASES, _CREEP) * TIME
    expected = naive_xpbd.limit_strain(x, x_before, strained, LIMIT, grown)
    before = x.copy()
    limits = np.float32(LIMIT), np.float32(TIME), np.float32(SLOW)
    limit_strain(own, ready, planes, CARRY, kept, *limits)
    np.testing.assert_allclose(x, expected, atol=2e-5)
    np.testing.assert_allclose(x - own.x_predicted, by_contact, atol=1e-6)
    stays = strained.kept | (np.arange(len(x)) >= free)
    stays[:free] |= (planes.shape >= 0) & planes.caught
    assert (x[stays] == before[stays]).all()
    into = ((x - before)[:free] * planes.normal).sum(axis=1)
    assert into[touches[:free] & ~strained.pressed[:free]].min() > -1e-5


@given(st.integers(0, 10**6), SCALE)
@settings(derandomize=True, deadline=None, max_examples=30)
def test_longest_edges_after_a_step(cloth, seed, scale):
    """As the twin; pins stay, and where many edges are too long all does."""
    x, ready, planes, kept, strained = strained_cloth(cloth, seed, scale)
    before = x.copy()
    shorten_longest(x, ready, planes, kept, np.float32(LIMIT))
    np.testing.assert_allclose(x, naive_xpbd.shorten_longest(before, strained), atol=2e-5)
    assert (x[strained.free :] == before[strained.free :]).all()
    if not strained.are_single(before):
        assert (x == before).all()


@pytest.mark.parametrize("held", ["pressed", "caught", "kept"])
@pytest.mark.parametrize("far", [0.04, 0.1])
def test_a_single_edge_is_shortened_whatever_holds_its_ends(cloth, held, far):
    """Its neighbours take over what it gives up: none is left too long. What is caught stays."""
    rest, triangles = cloth.grid(20, 20)
    edges = mesh_topology(triangles).edges
    weight = np.ones(len(rest), np.float32)
    ready, length = ready_edges(np.random.default_rng(0), edges, rest, weight)
    x = rest.astype(np.float32)
    middle = int(np.argmin(np.linalg.norm(rest - rest.mean(axis=0), axis=1)))
    x[middle, 2] += far
    shape = np.full(len(rest), -1, np.int32)
    depth = np.zeros(len(rest), np.float32)
    kept = shape.copy()
    # The shape would have it there.
    shape[middle] = 0
    if held == "kept":
        kept[middle] = 0
    else:
        depth[middle] = np.inf
    caught = np.zeros(len(rest), np.bool_)
    caught[middle] = held == "caught"
    up = np.zeros((len(rest), 3), np.float32) + np.float32([0.0, 0.0, 1.0])
    planes = Planes(shape, up, depth, caught, up, up)
    strain = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1) / length - 1.0
    assert 0.0 < np.mean(strain > _LONGEST) <= 0.01
    shorten_longest(x, ready, planes, kept, np.float32(0.3))
    strain = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1) / length - 1.0
    assert strain.max() < _LONGEST + 0.05
    assert (held == "caught") == (x[middle, 2] == np.float32(far))


@pytest.mark.parametrize("are_caught", [False, True])
def test_an_edge_through_a_limb_is_shortened(cloth, are_caught):
    """Its ends touch a limb from two sides: no way along the surfaces leads together.

    Nor does any where both are caught between two limbs.
    """
    rest, triangles = cloth.grid(20, 20)
    edges = mesh_topology(triangles).edges
    weight = np.ones(len(rest), np.float32)
    ready, length = ready_edges(np.random.default_rng(0), edges, rest, weight)
    x = rest.astype(np.float32)
    middle = rest.mean(axis=0)
    e = int(np.argmin(np.linalg.norm(rest[edges].mean(axis=1) - middle, axis=1)))
    i, j = edges[e]
    apart = (x[i] - x[j]) / length[e]
    x[i] += 0.6 * length[e] * apart
    x[j] -= 0.6 * length[e] * apart
    shape = np.full(len(rest), -1, np.int32)
    shape[[i, j]] = 0
    normal = np.zeros((len(rest), 3), np.float32)
    normal[i], normal[j] = apart, -apart
    none = np.zeros((len(rest), 3), np.float32)
    nothing = np.zeros(len(rest), np.bool_)
    depth = np.where((shape >= 0) & are_caught, np.inf, 0.0).astype(np.float32)
    caught = depth == np.inf
    planes = Planes(shape, normal, depth, caught, none, none)
    strained = naive_xpbd.Strained(
        edges=edges,
        rest_length=length,
        inverse_mass=weight,
        normal=np.where((shape >= 0)[:, None], normal, np.nan),
        pressed=caught,
        caught=caught,
        kept=nothing,
        free=len(rest),
        longest=_LONGEST,
        utmost=_UTMOST,
    )
    expected = naive_xpbd.shorten_longest(x, strained)
    shorten_longest(x, ready, planes, np.full(len(rest), -1, np.int32), np.float32(0.3))
    np.testing.assert_allclose(x, expected, atol=2e-5)
    strain = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1) / length - 1.0
    assert strain.max() < _UTMOST + 0.02


def test_short_edges_are_left_alone(cloth):
    rng = np.random.default_rng(0)
    rest, triangles = cloth.grid(6, 7)
    x = (1.49 * rest).astype(np.float32)
    edges = mesh_topology(triangles).edges
    weight = np.ones(len(rest), np.float32)
    ready, _ = ready_edges(rng, edges, rest, weight)
    none = np.zeros((len(rest), 3), np.float32)
    shape, caught = np.full(len(rest), -1, np.int32), np.zeros(len(rest), np.bool_)
    planes = Planes(shape, none, none[:, 0], caught, none, none)
    before = x.copy()
    own = particles_at(x, before, np.zeros_like(x))
    kept = np.full(len(rest), -1, np.int32)
    limits = np.float32(LIMIT), np.float32(TIME), np.float32(SLOW)
    limit_strain(own, ready, planes, CARRY, kept, *limits)
    assert (x == before).all()


@pytest.mark.parametrize(
    "touching", ["all", "all, at rest", "one of two, pressed", "one of two", "none"]
)
def test_edges_that_shapes_hold_are_eased(touching):
    """A line of edges that was pulled to three times its length.

    Where shapes hold it, friction would keep it so for good. In the air, and where shapes rest,
    nothing is done: what pulls there would pull it back again and again.
    """
    rest = np.outer(np.arange(9), [0.02, 0.0, 0.0])
    edges = np.stack([np.arange(8), np.arange(1, 9)], axis=1)
    weight = np.ones(9, np.float32)
    ready, length = ready_edges(np.random.default_rng(0), edges, rest, weight)
    x = (3.0 * rest).astype(np.float32)
    shape, depth = np.full(9, -1, np.int32), np.zeros(9, np.float32)
    if touching.startswith("all"):
        shape[:] = 1 if "rest" in touching else 2
    elif touching != "none":
        shape[::2] = 2
    if touching == "one of two, pressed":
        depth[::2] = np.inf
    none = np.zeros((9, 3), np.float32)
    kept = np.full(9, -1, np.int32)
    caught = np.zeros(9, np.bool_)
    planes = Planes(shape, none + np.float32([0, 0, 1]), depth, caught, none, none)
    for _ in range(180):
        own = particles_at(x, x.copy(), np.zeros_like(x))
        limits = np.float32(LIMIT), np.float32(TIME), np.float32(SLOW)
        limit_strain(own, ready, planes, CARRY, kept, *limits)
    strain = np.linalg.norm(np.diff(x, axis=0), axis=1) / length - 1.0
    if touching in ("none", "one of two", "all, at rest"):
        np.testing.assert_allclose(strain, 2.0, atol=1e-4)
    else:
        np.testing.assert_allclose(strain, LIMIT, atol=0.02)
    np.testing.assert_allclose(x.mean(axis=0), 3.0 * rest.mean(axis=0), atol=1e-4)


def longest_edge(**settings):
    """Of a sheet on four pins that a ball is pushed through by a quarter of its width, at 3 m/s.

    Edges at the pins, which do not yield, are left out.
    """
    colliders = gs.ColliderSet.of(gs.sphere(0.05, bone="ball"))
    sheet = gs.Garment.sheet(
        0.4, 0.4, edge=0.02, upright=True, pins="corners", material="cotton_jersey"
    )
    simulation = gs.Simulation(sheet, colliders, **settings)
    edges = mesh_topology(sheet.triangles).edges
    edges = edges[~np.isin(edges, sheet.pins).any(axis=1)]
    rest = np.linalg.norm(np.diff(sheet.vertices[edges], axis=1)[:, 0], axis=1)
    longest = 0.0
    for y in np.append(np.linspace(-0.1, 0.1, 4), np.full(20, 0.1)):
        simulation.step(colliders.poses({"ball": np.array([0.0, y, 0.0])}))
        # Where particles are: creases are shown round, with shorter edges.
        x = simulation["sheet"].worn.seen(simulation.origin)
        longest = max(
            longest, (np.linalg.norm(np.diff(x[edges], axis=1)[:, 0], axis=1) / rest).max()
        )
    assert x[:, 1].max() > 0.14  # It is on the ball.
    return longest - 1.0


def test_cloth_that_is_hit_by_a_ball_is_stretched_by_the_limit():
    """Jersey gives: without a limit edges get more than twice as long."""
    assert longest_edge(strain_limit=0.0) > 1.2
    assert longest_edge(strain_limit=LIMIT) < 1.5 * LIMIT
