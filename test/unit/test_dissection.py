"""The order in which a mesh's matrix is eliminated."""

import numpy as np
import pytest

from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.sim.solvers.implicit.dissection import dissect


@pytest.mark.parametrize("side", [2, 9, 40])
def test_fronts_hold_every_entry_and_all_fill(cloth, side):
    """Each edge lies in the front of its earlier end, and a front's rows in its parent."""
    rest, triangles = cloth.grid(side, side)
    edges = mesh_topology(triangles).edges
    fronts = dissect(rest, edges)
    assert sorted(fronts.place) == list(range(side * side))
    ends = np.sort(fronts.place[edges], axis=1)

    def columns(s):
        rows = fronts.rows[fronts.row_start[s] : fronts.row_start[s + 1]]
        return np.concatenate([np.arange(fronts.first[s], fronts.first[s + 1]), rows])

    for low, high in ends:
        assert {low, high} <= set(columns(fronts.owner[low]))
    for s, parent in enumerate(fronts.parent):
        rows = columns(s)[fronts.first[s + 1] - fronts.first[s] :]
        assert len(rows) == 0 or set(rows) <= set(columns(parent))
    # A separator of a square has some side vertices: the factor grows like n log n.
    assert fronts.factor_start[-1] < 40 * side**2 * max(1.0, np.log2(side)) + 32**2
