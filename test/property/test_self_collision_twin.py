"""Self-collision's kernels against their naive twins."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_self_collision as naive
from scipy.spatial import Delaunay

from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import Material
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.self_collision.garment import SelfCollision
from garment_sim_ros.sim.self_collision.near_pairs import Pairs, find_pairs
from garment_sim_ros.sim.self_collision.self_contact import Lying, keep_apart
from garment_sim_ros.sim.self_collision.untangling import spread

SPACING = 0.02
DISTANCE = 0.002


@pytest.mark.parametrize("kind", ["points", "edges"])
def test_pairs_part_as_the_twin_has_it(kind):
    random = np.random.default_rng(4)
    pair = np.arange(4, dtype=np.int32)[None]
    contact = naive.point_contact if kind == "points" else naive.edge_contact
    met = through = 0
    for _ in range(700):
        before = random.uniform(-1.0, 1.0, (4, 3)).astype(np.float32)
        x = (before + 0.4 * random.normal(size=(4, 3))).astype(np.float32)
        v = random.normal(size=(4, 3)).astype(np.float32)
        mass = random.choice([0.0, 1.0, 2.0], 4).astype(np.float32)
        limit = 0.3
        exact = [a.astype(np.float64) for a in (before, x, v, mass)]
        split = 1 if kind == "points" else 2
        groups = (0, pair[0, 1:]) if split == 1 else (pair[0, :2], pair[0, 2:])
        found = contact(exact[0], exact[1], *groups, limit)
        naive.part(exact[1], exact[2], exact[3], pair[0], found, 0.4)
        pairs = Pairs.room_for(1, 0)
        pairs.points[:] = pairs.edges[:] = pair
        pairs.point_limit[:] = pairs.edge_limit[:] = limit
        pairs.counts[split - 1] = 1
        nowhere = Lying(mass, np.full(4, -1, np.int32), np.zeros((4, 3), np.float32))
        apart = np.zeros(4, np.bool_)
        touched, _ = keep_apart(before, x, v, nowhere, apart, pairs, np.float32(0.4), 1)
        moves = found is not None and (mass > 0.0).any()
        assert touched == moves
        met += touched
        through += bool(moves and found[3])
        np.testing.assert_allclose(x, exact[1], atol=2e-4)  # where a normal is nearly none
        np.testing.assert_allclose(v, exact[2], atol=2e-4)
    assert met > 30
    assert through > 8


def crumpled(cloth, seed):
    """A sheet folded up like a fan, that passes through itself in places."""
    random = np.random.default_rng(seed)
    rest, triangles = cloth.grid(13, 11, SPACING)
    angle, way = random.uniform(0.0, np.pi), random.uniform(3.0, 4.0) * SPACING
    along = rest @ [np.cos(angle), np.sin(angle), 0.0] + 0.3
    across = rest @ [-np.sin(angle), np.cos(angle), 0.0]
    x = np.stack([np.abs(along % (2 * way) - way), across, 0.0015 * along / way], axis=1)
    x += random.normal(0.0, 5e-4, x.shape)
    model = build_model("sheet", rest, triangles, Material())
    collision = SelfCollision(model, DISTANCE, Contacts.room_for(len(model), 0))
    collision._start[:] = x[model.vertex]
    collision._way[:] = 0.2 * SPACING * random.normal(size=(len(x), 3))
    return collision


def search(collision, margin):
    c = collision
    find_pairs(
        *(c._start, c._way, c._mesh, c._swept, c._grid),
        *(np.float32(DISTANCE), np.float32(margin), c._pairs),
    )
    points, edges, crossings = c._pairs.counts
    return c._pairs.points[:points], c._pairs.edges[:edges], c._pairs.crossings[:crossings]


def key(first, second):
    return frozenset([frozenset(map(int, first)), frozenset(map(int, second))])


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_all_that_comes_near_on_its_way_is_found(cloth, seed):
    collision = crumpled(cloth, seed)
    points, edges, found = search(collision, 0.0)
    pairs = {key(p[:1], p[1:]) for p in points} | {key(e[:2], e[2:]) for e in edges}
    start = collision._start.astype(np.float64)
    triangles = collision._mesh.triangles
    assert {(*sorted(c[:2]), *sorted(c[4:])) for c in found.tolist()} == {
        (*sorted(c[:2]), *sorted(c[2:])) for c in naive.crossings(start, triangles).tolist()
    }
    expected = set()
    ends = mesh_topology(triangles).edges
    for part in (0.0, 0.5, 1.0):
        x = start + part * collision._way
        low, high = x[triangles].min(axis=1) - DISTANCE, x[triangles].max(axis=1) + DISTANCE
        inside = ((x[:, None] > low) & (x[:, None] < high)).all(axis=2)
        for p, t in np.argwhere(inside):
            if p not in triangles[t] and naive.point_gap(x, p, triangles[t]) < 0.99 * DISTANCE:
                expected.add(key([p], triangles[t]))
        low, high = x[ends].min(axis=1) - DISTANCE / 2, x[ends].max(axis=1) + DISTANCE / 2
        inside = ((low[:, None] < high) & (low < high[:, None])).all(axis=2)
        for e, f in np.argwhere(np.triu(inside, 1)):
            ab, cd = ends[e], ends[f]
            if not set(ab) & set(cd) and naive.edge_gap(x, ab, cd) < 0.99 * DISTANCE:
                expected.add(key(ab, cd))
    assert len(expected) > 100
    assert len(expected - pairs) == 0


@pytest.mark.slow
def test_particles_may_stray_by_half_the_margin(cloth):
    """With a margin all is found that is near where particles are displaced by half of it."""
    collision = crumpled(cloth, 5)
    collision._way[:] = 0.0
    random = np.random.default_rng(1)
    margin = 0.3 * SPACING
    points, _, _ = search(collision, margin)
    pairs = {key(p[:1], p[1:]) for p in points}
    shift = random.normal(size=collision._start.shape)
    x = collision._start + 0.5 * margin * shift / np.linalg.norm(shift, axis=1, keepdims=True)
    triangles = collision._mesh.triangles
    missed = met = 0
    for p, t in itertools.product(range(len(x)), range(len(triangles))):
        corners = triangles[t]
        if p in corners or np.linalg.norm(x[corners].mean(axis=0) - x[p]) > 0.02:
            continue
        if naive.point_gap(x, p, corners) < DISTANCE:
            met += 1
            missed += key([p], corners) not in pairs
    assert met > 30
    assert missed == 0


@settings(derandomize=True, deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), rings=st.integers(0, 4))
def test_neighbours_of_a_knot(seed, rings):
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(40, 2))
    triangles = Delaunay(points).simplices.astype(np.int32)
    rng.shuffle(triangles)
    marked = np.zeros(40, np.bool_)
    marked[rng.integers(0, 40, rng.integers(0, 3))] = True
    expected = set(np.flatnonzero(marked).tolist())
    for _ in range(rings):
        expected |= {p for t in triangles.tolist() if expected & set(t) for p in t}
    spread(triangles, marked, rings, np.zeros(40, np.bool_))
    assert set(np.flatnonzero(marked).tolist()) == expected


def test_a_knot_that_stays_for_days_costs_no_more_than_the_garment_is_wide(cloth):
    _, triangles = cloth.grid(9, 7)
    marked = np.zeros(2 * 63, np.bool_)
    marked[5] = True
    spread(triangles.astype(np.int32), marked, 2**40, np.zeros_like(marked))
    assert marked[:63].all()
    assert not marked[63:].any()
