"""Particles against another garment's triangles: the kernels against their naive twin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_layers, naive_self_collision

from garment_sim_ros.geometry.topology import mesh_topology, triangles_across
from garment_sim_ros.sim.layers.crossings import Boxes, find_crossings, leave_out
from garment_sim_ros.sim.layers.kernels import (
    find_close_one_way,
    keep_to_side,
    separate_one_way,
)
from garment_sim_ros.sim.layers.nearest import find_triangles, take_from_neighbours
from garment_sim_ros.sim.layers.pair import Meeting
from garment_sim_ros.sim.self_collision.patches import Mesh

SPACING = 0.02
REACH = 2.0 * SPACING
THICKNESS = 0.002


def sheets(cloth, seed, bump=0.004):
    """Two uneven sheets of different meshes, crossing each other."""
    rng = np.random.default_rng(seed)
    under, triangles = cloth.grid(7, 6, SPACING)
    over, _ = cloth.grid(8, 9, 0.8 * SPACING)
    under[:, 2] = rng.uniform(-bump, bump, len(under))
    over = over + rng.normal(0.0, 0.1 * SPACING, over.shape)
    over[:, 2] = rng.uniform(-2 * bump, 2 * bump, len(over))
    return [
        (
            x.astype(np.float32),
            rng.normal(0.0, 0.3, x.shape).astype(np.float32),
            rng.choice([0.0, 500.0, 2000.0], len(x)).astype(np.float32),
        )
        for x in (over, under)
    ], triangles


def found(x, y, triangles):
    near = np.full(len(x), -1, np.int32)
    start, entry = np.zeros(65, np.int32), np.zeros(len(triangles), np.int32)
    find_triangles(x, y, triangles, np.float32(REACH), start, entry, near)
    assert sorted(entry.tolist()) == list(range(len(triangles)))
    return near


def meeting(mine, other, triangles, near, side=1.0, own=None, way=1.0, pushed=None):
    """Positions, velocities and inverse masses of both, which meet in the arrays given.

    Without triangles of their own at particles these are folded over neither way.
    """
    masses = [part[2].copy() for part in (mine, other)]
    for mass in masses:
        mass.flags.writeable = False  # as those of models are: for kernels it is another type
    n = len(mine[0])
    return Meeting(
        *(mine[0], mine[1], masses[0]),
        np.zeros((n, 3), np.int32) if own is None else own,
        *(other[0], other[1], masses[1]),
        triangles=triangles,
        neighbour=triangles_across(triangles),
        near=near,
        close=np.zeros(n, np.int32),
        plane=np.zeros((n, 6), np.float32),
        found=np.zeros(3, np.int32),
        side=np.float32(side),
        thickness=np.float32(THICKNESS),
        friction=np.float32(0.4),
        reach=np.float32(REACH),
        way=np.full(1, way, np.float32),
        pushed=np.zeros(n, np.float32) if pushed is None else pushed,
    )


@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_nearest_triangle_is_found(cloth, seed):
    ((x, _, _), (y, _, _)), triangles = sheets(cloth, seed)
    x = np.concatenate([x, x + np.float32([0.0, 0.0, 0.03]), x + np.float32([0.0, 0.0, 1.0])])
    near = found(x, y, triangles)
    for p in range(0, len(x), 5):
        t = near[p]
        expected, w = naive_layers.nearest_triangle(
            x[p].astype(np.float64), y.astype(np.float64), triangles, REACH
        )
        if expected < 0 or t < 0:
            assert expected == t
            continue
        corners = y[triangles[t]].astype(np.float64)
        mine = np.linalg.norm(x[p] - naive_layers.closest_weights(corners, x[p]) @ corners)
        best = np.linalg.norm(x[p] - w @ y[triangles[expected]])
        assert mine == pytest.approx(best, abs=1e-7)  # of equally near ones, either


@settings(max_examples=6, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    side=st.sampled_from([1.0, -1.0]),
    way=st.sampled_from([1.0, 5e-4]),
)
def test_moves_as_the_twin_does(cloth, seed, side, way):
    (mine, other), triangles = sheets(cloth, seed)
    topology = mesh_topology(triangles)
    border = {tuple(e) for e in topology.edges[topology.triangle_count == 1].tolist()}
    n = len(mine[0])
    own = (np.arange(n)[:, None] + [0, 9, 1]).astype(np.int32) % n
    own[::2] = own[::2, ::-1]  # folded over, or not
    before = np.random.default_rng(seed).choice([0.0, 0.5 * REACH, 3.0 * REACH], n)
    touched = weaker = left = 0
    # One particle at a time, as each moves what the next one meets; and none that is nearest to
    # an edge, where either of two triangles may be taken.
    for p in range(0, n, 3):
        twins = [[a.astype(np.float64) for a in part] for part in (mine, other)]
        _, w = naive_layers.nearest_triangle(twins[0][0][p], twins[1][0], triangles, REACH)
        if (w == 0.0).any():
            continue
        both = [tuple(a.copy() for a in part) for part in (mine, other)]
        near = np.full(n, -1, np.int32)
        near[p] = found(mine[0][p : p + 1], other[0], triangles)[0]
        pushed = before.copy()
        meets = meeting(*both, triangles, near, side, own, way, before.astype(np.float32))
        find_close_one_way(meets)
        separate_one_way(meets)
        expected = naive_layers.separate(
            *(tuple(part) for part in twins),
            own,
            triangles,
            border,
            only=p,
            side=side,
            thickness=THICKNESS,
            friction=0.4,
            reach=REACH,
            way=way,
            pushed=pushed,
        )
        assert meets.found[1] == expected
        touched += expected
        weaker += expected and before[p] > 0.0
        left += before[p] > 2.0 * REACH and not expected
        if near[p] >= 0:
            assert meets.pushed[p] == pytest.approx(pushed[p], abs=1e-6)
        for got, want in zip(both, twins):
            np.testing.assert_allclose(got[0], want[0], atol=2e-6)
            np.testing.assert_allclose(got[1], want[1], atol=1e-3)
    assert touched > 0
    assert weaker > 0
    assert left > 0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_is_on_its_side_is_not_given_up(cloth, side):
    """Pressed together, cloth is nearer than its thickness for ever; what was through, is not."""
    under, triangles = cloth.grid(7, 6, SPACING)
    over, _ = cloth.grid(5, 5, 0.8 * SPACING)
    held = [(x.astype(np.float32), np.zeros_like(x, np.float32)) for x in (over, under)]
    mine, other = ((x, v, np.zeros(len(x), np.float32)) for x, v in held)
    meets = meeting(mine, other, triangles, found(mine[0], other[0], triangles), side, way=5e-4)

    def tangled_after(rounds, height):
        mine[0][:, 2] = side * height
        for _ in range(rounds):
            find_close_one_way(meets)
            separate_one_way(meets)
        find_close_one_way(meets)
        return int(meets.found[2])

    everyone, patience = len(over), round(2.0 * REACH / 5e-4)
    assert tangled_after(3 * patience, 0.3 * THICKNESS) == 0
    assert not meets.pushed.any()
    assert tangled_after(patience // 2, -2.0 * THICKNESS) == 0
    assert tangled_after(patience, -2.0 * THICKNESS) == everyone
    # Back on its side, nearer than the thickness, it is parted again, little by little.
    assert tangled_after(2, 0.3 * THICKNESS) == 0
    assert tangled_after(4 * patience + 4, 0.3 * THICKNESS) == 0
    assert not meets.pushed.any()
    # Folded over for a moment, nothing is known, and nothing forgotten.
    assert tangled_after(patience // 2, -2.0 * THICKNESS) == 0
    so_far, own = meets.pushed.copy(), meets.own.copy()
    meets.own[:] = [0, 6, 5]
    assert tangled_after(patience, -2.0 * THICKNESS) == 0
    np.testing.assert_array_equal(meets.pushed, so_far)
    meets.own[:] = own
    # Clear of the other garment it is as if it had never been through.
    assert tangled_after(patience, -2.0 * THICKNESS) == everyone
    assert tangled_after(1, 3.0 * THICKNESS) == 0
    assert not meets.pushed.any()


@pytest.mark.parametrize(("cosine", "holds"), [(1.0, True), (0.6, True), (0.4, False)])
def test_a_tight_outer_garment_is_not_drawn_through(cloth, cosine, holds):
    """Drawn by ten times the way of what is through, it keeps its distance, but in wrinkles."""
    under, triangles = cloth.grid(7, 6, SPACING)
    over, _ = cloth.grid(5, 5, 0.8 * SPACING)
    # A triangle far away, so tilted, is taken for that at each particle.
    tilted = [[9.0, 0.0, 0.0], [9.0 + cosine, 0.0, np.sqrt(1.0 - cosine**2)], [9.0, 1.0, 0.0]]
    n, way = len(over), 1e-4
    masses = np.ones(n + 3, np.float32), np.zeros(len(under), np.float32)
    mine, other = (
        (x.astype(np.float32), np.zeros_like(x, np.float32), m)
        for x, m in zip((np.concatenate([over, tilted]), under), masses)
    )
    near = found(mine[0], other[0], triangles)
    own = np.tile(np.int32([n, n + 1, n + 2]), (n + 3, 1))
    meets = meeting(mine, other, triangles, near, 1.0, own, way)
    height = mine[0][:n, 2]
    height[:] = THICKNESS
    for k in range(60):
        height -= np.float32(10 * way)
        if k % 6 == 0:
            find_close_one_way(meets)
        separate_one_way(meets)
    if holds:
        np.testing.assert_allclose(height, THICKNESS, atol=1e-6)
    else:
        assert height.max() < 0.0
    np.testing.assert_array_equal(other[0][:, 2], 0.0)


def test_what_is_pinned_stays(cloth):
    under, triangles = cloth.grid(7, 6, SPACING)
    over, _ = cloth.grid(5, 5, 0.8 * SPACING)
    over[:, 2] = 0.3 * THICKNESS
    mine, other = (
        (x.astype(np.float32), np.zeros_like(x, np.float32), np.full(len(x), m, np.float32))
        for x, m in ((over, 0.0), (under, 1.0))
    )
    own = np.tile(np.int32([0, 5, 1]), (25, 1))
    meets = meeting(mine, other, triangles, found(mine[0], other[0], triangles), own=own, way=1e-4)
    find_close_one_way(meets)
    separate_one_way(meets)
    np.testing.assert_array_equal(mine[0], over.astype(np.float32))
    assert other[0][:, 2].min() < 0.0


@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_momentum_and_the_centre_of_mass_stay(cloth, seed):
    (mine, other), triangles = sheets(cloth, seed)
    mine[2][:], other[2][:] = 800.0, 1700.0
    before = [np.concatenate([a[k] / a[2][:, None] for a in (mine, other)]) for k in (0, 1)]
    before = [b.sum(axis=0, dtype=np.float64) for b in before]
    near = found(mine[0], other[0], triangles)
    meets = meeting(mine, other, triangles, near)
    find_close_one_way(meets)
    separate_one_way(meets)
    assert meets.found[1] > 10
    after = [np.concatenate([a[k] / a[2][:, None] for a in (mine, other)]) for k in (0, 1)]
    for b, a, scale in zip(before, after, (1e-8, 1e-6)):
        np.testing.assert_allclose(a.sum(axis=0, dtype=np.float64), b, atol=scale)


def test_triangles_spread_by_one_ring(cloth):
    _, triangles = cloth.grid(5, 5)
    edges = mesh_topology(triangles).edges
    near = np.full(25, -1, np.int32)
    near[12] = 7
    ring = {int(i) for e in edges if 12 in e for i in e}
    take_from_neighbours(edges, near)
    assert {int(i) for i in np.flatnonzero(near == 7)} == ring
    assert (near[[i not in ring for i in range(25)]] == -1).all()


@pytest.mark.parametrize("seed", range(4))
def test_all_edges_through_the_other_garment_are_found(cloth, seed):
    (over, under), triangles = sheets(cloth, seed, bump=0.02)
    n = len(under[0])
    _, others = cloth.grid(8, 9, SPACING)
    both = np.concatenate([triangles, others + n]).astype(np.int32)
    x = np.concatenate([under[0], over[0]])
    mesh = Mesh.of(both, x)
    split = int((mesh.triangles[mesh.first[:-1], 0] < n).sum())
    room = np.zeros((1000, 7), np.int32)
    count = find_crossings(x, mesh, split, Boxes.room_for(mesh), room)
    found = {(*sorted(c[:2]), *sorted(c[4:])) for c in room[:count].tolist()}
    assert len(found) == count > 20
    expected = {
        (*sorted(c[:2]), *sorted(c[2:]))
        for c in naive_self_collision.crossings(x.astype(float), both).tolist()
        if (c[0] < n) != (c[2] < n)
    }
    assert found == expected
    # Corners beside the edge are those of the triangles that have it.
    edges = {frozenset(t) for t in both.tolist()}
    for a, b, c, d, *_ in room[:count].tolist():
        assert {a, b, c} in edges
        assert d < 0 or {a, b, d} in edges


def test_what_is_not_finite_crosses_nothing(cloth):
    (over, under), triangles = sheets(cloth, 0, bump=0.02)
    _, others = cloth.grid(8, 9, SPACING)
    both = np.concatenate([triangles, others + len(under[0])]).astype(np.int32)
    x = np.concatenate([under[0], np.full_like(over[0], np.nan)])
    mesh = Mesh.of(both, np.concatenate([under[0], over[0]]))
    split = int((mesh.triangles[mesh.first[:-1], 0] < len(under[0])).sum())
    boxes, room = Boxes.room_for(mesh), np.zeros((9, 7), np.int32)
    assert find_crossings(x, mesh, split, boxes, room) == 0


@pytest.mark.parametrize("seed", range(3))
def test_crossings_of_what_touches_are_left_out(seed):
    rng = np.random.default_rng(seed)
    crossings = rng.integers(0, 50, (40, 7)).astype(np.int32)
    touches = rng.random(50) < 0.2
    expected = [c for c in crossings.tolist() if not any(touches[c[k]] for k in (0, 1, 4, 5, 6))]
    left = leave_out(touches, crossings, len(crossings))
    assert 0 < left < 40
    assert crossings[:left].tolist() == expected


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_close_particles_are_not_moved_from_their_side(cloth, seed, side):
    (over, under), triangles = sheets(cloth, seed)
    one = meeting(over, under, triangles, found(over[0], under[0], triangles), side=side)
    find_close_one_way(one)
    close = one.close[: one.found[0]]
    normal = np.zeros(over[0].shape)
    normal[close] = one.plane[: len(close), :3]
    rng = np.random.default_rng(seed)
    x = over[0] + rng.normal(0.0, 1e-3, over[0].shape).astype(np.float32)
    v = over[1] + np.float32(1.0)
    stays = ((x - over[0]) * normal).sum(axis=1) < 0.0
    assert 5 < stays.sum() < len(close)
    expected = np.where(stays[:, None], over[0], x), np.where(stays[:, None], over[1], v)
    keep_to_side(one, x, v)
    np.testing.assert_array_equal(x, expected[0])
    np.testing.assert_array_equal(v, expected[1])


@pytest.mark.parametrize("still", [0, 1])
def test_a_garment_that_stays_takes_over_nothing(cloth, still):
    """Nobody looks whether what stays is still good, as the inner one is while another settles."""
    parts, triangles = sheets(cloth, 1)
    parts[still][2][:] = 0.0
    parts[1 - still][2][:] = 500.0
    kept = [array.copy() for array in parts[still]]
    parts[1 - still][1][:] = np.nan
    (mine, other), near = parts, found(parts[0][0], parts[1][0], triangles)
    met = meeting(mine, other, triangles, near)
    find_close_one_way(met)
    separate_one_way(met)
    assert met.found[1] > 10
    for array, before in zip(parts[still], kept, strict=True):
        np.testing.assert_array_equal(array, before)
