from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.geometry.colouring import colour_springs, order_by_colour
from garment_sim_ros.geometry.locality import BLOCK, near_together, spatial_order
from garment_sim_ros.geometry.topology import mesh_topology


@st.composite
def springs(draw):
    particles = draw(st.integers(2, 40))
    end = st.integers(0, particles - 1)
    pairs = draw(st.lists(st.tuples(end, end).filter(lambda p: p[0] != p[1]), max_size=150))
    return np.array(pairs, dtype=np.int32).reshape(-1, 2)


@given(springs())
@settings(derandomize=True, deadline=None)
def test_no_two_springs_of_a_colour_share_a_particle(pairs):
    colour = colour_springs(pairs)
    for c in np.unique(colour):
        ends = pairs[colour == c].ravel()
        assert len(np.unique(ends)) == len(ends)


@given(springs())
@settings(derandomize=True, deadline=None)
def test_number_of_colours_is_bounded_by_the_busiest_particle(pairs):
    if len(pairs):
        busiest = np.bincount(pairs.ravel()).max()
        colours = colour_springs(pairs).max() + 1
        assert busiest <= colours <= 2 * busiest - 1


@given(springs())
@settings(derandomize=True, deadline=None)
def test_order_is_a_permutation_grouped_by_colour(pairs):
    order, start = order_by_colour(pairs)
    assert sorted(order.tolist()) == list(range(len(pairs)))
    colour = colour_springs(pairs)
    assert start[0] == 0
    assert start[-1] == len(pairs)
    for c, (begin, end) in enumerate(pairwise(start)):
        assert (colour[order[begin:end]] == c).all()


def test_colours_of_a_cloth_are_balanced(cloth):
    population = np.bincount(colour_springs(mesh_topology(cloth.grid(50, 50)[1]).edges))
    assert population.max() <= 1.1 * population.min()


@given(st.integers(0, 200), st.integers(0, 2**31))
@settings(derandomize=True, deadline=None)
def test_spatial_order_is_a_permutation(count, seed):
    points = np.random.default_rng(seed).integers(0, 4, (count, 3)).astype(float)
    assert sorted(spatial_order(points).tolist()) == list(range(count))


def test_blocks_of_a_cloth_are_compact(cloth):
    vertices, _ = cloth.grid(64, 64, 1.0)
    ordered = vertices[spatial_order(vertices)].reshape(-1, BLOCK, 3)
    assert np.ptp(ordered, axis=1).max() <= 7.0


def test_triangles_near_together_are_the_same_in_compact_runs(cloth):
    vertices, triangles = cloth.grid(64, 64, 1.0)
    shuffled = np.random.default_rng(1).permutation(triangles)
    ordered = near_together(vertices, shuffled)
    assert sorted(map(tuple, ordered)) == sorted(map(tuple, triangles))
    runs = vertices[ordered[: len(ordered) // BLOCK * BLOCK]].reshape(-1, 3 * BLOCK, 3)
    assert np.ptp(runs, axis=1).max() <= 9.0


@given(springs())
@settings(derandomize=True, deadline=None)
def test_each_spring_takes_the_least_used_colour_that_is_free_at_its_ends(pairs):
    used = [0] * (np.bincount(pairs.ravel()).max() if len(pairs) else 0)
    taken = {}
    for pair, colour in zip(pairs.tolist(), colour_springs(pairs)):
        free = [c for c in range(len(used)) if not any(c in taken.get(p, ()) for p in pair)]
        if not free:
            free = [len(used)]
            used.append(0)
        expected = min(free, key=lambda c: (used[c], c))
        assert colour == expected
        used[expected] += 1
        for p in pair:
            taken.setdefault(p, set()).add(expected)
