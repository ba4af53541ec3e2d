"""The order in which edges are solved."""

import numpy as np

from garment_sim_ros.sim.solvers.xpbd.order import inward_order


def test_edges_are_solved_towards_the_pins_or_from_the_boundary_inwards(cloth):
    _, triangles = cloth.grid(5, 5)
    column = np.array([[k, k + 5] for k in range(0, 20, 5)], dtype=np.int32)
    # The last five particles, one side of the grid, are pinned: towards them.
    assert inward_order(column, triangles, 20).tolist() == [0, 1, 2, 3]
    # Nothing is pinned: rim, then middle.
    middle = np.array([[12, 7], [2, 7], [2, 1]], dtype=np.int32)
    assert inward_order(middle, triangles, 25).tolist() == [2, 1, 0]
