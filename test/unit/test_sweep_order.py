"""The order in which edges are solved."""

import numpy as np

from garment_sim_ros.sim.solvers.xpbd.order import in_fours, inward_order


def test_edges_are_solved_towards_the_pins_or_from_the_boundary_inwards(cloth):
    _, triangles = cloth.grid(5, 5)
    column = np.array([[k, k + 5] for k in range(0, 20, 5)], dtype=np.int32)
    # The last five particles, one side of the grid, are pinned: towards them.
    assert inward_order(column, triangles, 20).tolist() == [0, 1, 2, 3]
    # Nothing is pinned: rim, then middle.
    middle = np.array([[12, 7], [2, 7], [2, 1]], dtype=np.int32)
    assert inward_order(middle, triangles, 25).tolist() == [2, 1, 0]


def test_fours_have_no_common_particle_and_a_pass_has_the_same_result():
    rng = np.random.default_rng(1)
    for particles, ends in ((100, 2), (200, 4)):
        given = np.array([rng.choice(particles, ends, replace=False) for _ in range(200)])
        order, fours = in_fours(given)
        assert sorted(order.tolist()) == list(range(200))
        assert fours > 120
        for n in range(0, fours, 4):
            assert len(np.unique(given[order[n : n + 4]])) == 4 * ends
        for p in range(particles):
            assert (np.diff(order[(given[order] == p).any(axis=1)]) > 0).all()


def test_a_chain_has_no_fours():
    order, fours = in_fours(np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]]))
    assert order.tolist() == [0, 1, 2, 3, 4]
    assert fours == 0
    assert in_fours(np.zeros((0, 2), np.int32))[1] == 0
