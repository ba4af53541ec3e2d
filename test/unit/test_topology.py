import numpy as np
import pytest

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.topology import (
    boundary_loops,
    mesh_topology,
    non_manifold_edges,
    vertex_normals,
)

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], dtype=np.int32)


def test_grid_of_50_by_50_has_the_springs_that_its_figures_are_stated_for(cloth):
    _, triangles = cloth.grid(50, 50)
    topology = mesh_topology(triangles)
    assert len(topology.edges) == 7301
    assert len(topology.opposite) == 7105
    assert (topology.triangle_count == 2).sum() == 7105


def test_edges_are_sorted_unique_and_low_index_first(cloth):
    _, triangles = cloth.grid(4, 5)
    edges = mesh_topology(triangles).edges
    assert (edges[:, 0] < edges[:, 1]).all()
    assert (np.unique(edges, axis=0) == edges).all()


def test_opposite_vertices_are_those_not_shared():
    topology = mesh_topology(np.array([[0, 1, 2], [2, 1, 3]], dtype=np.int32))
    assert topology.opposite.tolist() == [[0, 3]]


def test_a_fan_of_three_triangles_on_one_edge_pairs_neighbours_in_file_order():
    fan = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]], dtype=np.int32)
    assert mesh_topology(fan).opposite.tolist() == [[2, 3], [3, 4]]
    assert non_manifold_edges(fan).tolist() == [[0, 1]]


def test_opposite_winding_is_found_and_good_meshes_have_none():
    assert non_manifold_edges(TETRAHEDRON).size == 0
    assert non_manifold_edges(np.array([[0, 1, 2], [0, 1, 3]])).tolist() == [[0, 1]]


def test_degenerate_and_duplicate_triangles_make_no_springs_of_their_own():
    triangles = np.array([[0, 1, 2], [0, 1, 2], [1, 1, 2], [2, 1, 3]], dtype=np.int32)
    topology = mesh_topology(triangles)
    assert topology.edges.tolist() == [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    assert topology.opposite.tolist() == [[0, 3]]


def test_no_triangles_have_no_edges():
    assert mesh_topology(np.zeros((0, 3), np.int32)).edges.shape == (0, 2)


def test_boundary_loops_of_a_tube_run_with_its_triangles():
    around = 7
    ring = np.arange(around)
    after = np.roll(ring, -1)
    low = np.stack([ring, after, ring + around], axis=1)
    high = np.stack([after, after + around, ring + around], axis=1)
    loops = boundary_loops(np.concatenate([low, high]))
    assert [len(loop) for loop in loops] == [around, around]
    assert loops[0].tolist() == ring.tolist()
    assert loops[1].tolist() == [around, *(around + ring[:0:-1])]


def test_closed_mesh_has_no_boundary():
    assert boundary_loops(TETRAHEDRON) == []


def test_loops_that_touch_in_a_point_are_refused():
    with pytest.raises(GeometryError, match="vertex 2"):
        boundary_loops(np.array([[0, 1, 2], [2, 3, 4]]))


def test_normals_of_a_plane_point_up_and_lone_vertices_have_none(cloth):
    vertices, triangles = cloth.grid(3, 4)
    x = np.concatenate([vertices, [[9.0, 9.0, 9.0]]]).astype(np.float32)
    normal = np.full_like(x, np.nan)
    vertex_normals(x, triangles, normal)
    assert normal[:-1] == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(vertices), 1)), abs=1e-6)
    assert normal[-1].tolist() == [0.0, 0.0, 0.0]


def test_normals_are_weighted_by_area():
    corners = np.eye(3) * [1.0, 2.0, 3.0]
    x = np.concatenate([[[0.0, 0.0, 0.0]], corners])
    normal = np.zeros_like(x)
    vertex_normals(x, TETRAHEDRON, normal)
    faces = np.cross(
        x[TETRAHEDRON[:, 1]] - x[TETRAHEDRON[:, 0]], x[TETRAHEDRON[:, 2]] - x[TETRAHEDRON[:, 0]]
    )
    for i in range(4):
        expected = faces[np.isin(TETRAHEDRON, i).any(axis=1)].sum(axis=0)
        assert normal[i] == pytest.approx(expected / np.linalg.norm(expected), abs=1e-12)
