"""Geodesic distances and iso-lines on surfaces whose distances are known."""

import numpy as np
import pytest
import scipy.sparse.csgraph as csgraph
import trimesh
from scipy.sparse import csr_matrix

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.geodesics import cut, iso_line, longest_loops, mesh_graph, path_to


def sphere(subdivisions=4):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32)


@pytest.mark.parametrize("paths", ["edges", "unfolded"])
def test_dijkstra_is_exact_on_its_graph(paths):
    x, t = sphere(3)
    graph = mesh_graph(x, t, paths=paths)
    distance, before = graph.distances(5)
    matrix = csr_matrix((graph.length, graph.end, graph.start), shape=(len(x), len(x)))
    expected = csgraph.dijkstra(matrix, indices=5)
    assert np.allclose(distance, expected)
    path = path_to(before, 100)
    assert path[0] == 5
    assert path[-1] == 100
    assert np.all(np.diff(distance[path]) > 0.0)


def test_unfolded_paths_are_closer_to_the_truth():
    x, t = sphere()
    truth = np.arccos(np.clip(x @ x[0], -1.0, 1.0))
    error = {}
    for paths in ("edges", "unfolded"):
        distance, _ = mesh_graph(x, t, paths=paths).distances(0)
        relative = (distance - truth)[truth > 0.3] / truth[truth > 0.3]
        assert relative.min() > -2e-3
        error[paths] = relative.mean()
    assert error["unfolded"] < 0.5 * error["edges"]
    assert error["unfolded"] < 0.05


def test_several_sources_and_parts():
    x, t = sphere(2)
    both = np.concatenate([x, x + 5.0])
    triangles = np.concatenate([t, t + len(x)])
    graph = mesh_graph(both, triangles)
    assert graph.parts()[0] == 2
    distance, _ = graph.distances(0)
    assert np.isinf(distance[len(x) :]).all()
    nearest, _ = graph.distances(np.array([0, 7], np.int32))
    assert np.allclose(nearest[: len(x)], np.minimum(distance, graph.distances(7)[0])[: len(x)])
    bridged = mesh_graph(both, triangles, bridges=np.array([[0, len(x)]], np.int32))
    assert bridged.parts()[0] == 1


def test_equation_2():
    a, b = np.array([[0.0, 0.0, 0.0]]), np.array([[4.0, 0.0, 0.0]])
    assert np.allclose(cut(np.array([3.0]), np.array([1.0]), a, b, 2.5), [[1.0, 0.0, 0.0]])


def test_iso_line_is_a_closed_circle():
    x, t = sphere()
    line = iso_line(x, t, x[:, 2], 0.6)
    points = line.segments.reshape(-1, 3)
    assert np.allclose(points[:, 2], 0.6)
    assert len(line.parts()) == 1
    assert line.lengths.sum() == pytest.approx(2.0 * np.pi * 0.8, rel=0.02)
    assert np.allclose(line.centre(), [0.0, 0.0, 0.6], atol=1e-3)
    # Every cut point is the end of two pieces.
    _, count = np.unique(np.round(points, 9), axis=0, return_counts=True)
    assert (count == 2).all()


def test_iso_line_with_two_parts_and_with_none():
    x, t = sphere()
    line = iso_line(x, t, np.abs(x[:, 0]), 0.5)
    assert len(line.parts()) == 2
    empty = iso_line(x, t, x[:, 2], 9.0)
    assert len(empty.segments) == 0
    assert np.isnan(empty.centre()).all()


def test_unknown_paths():
    x, t = sphere(1)
    with pytest.raises(GeometryError, match="unfolded"):
        mesh_graph(x, t, paths="heat")


def test_longest_loops_are_those_of_the_iso_lines():
    x, t = sphere(3)
    x = x * [1.0, 0.7, 1.3]
    value = np.abs(x[:, 0] - 0.1) + 0.3 * x[:, 2]
    levels = np.linspace(-0.2, 0.9, 23)
    expected = [
        parts[0].lengths.sum() if (parts := iso_line(x, t, value, level).parts()) else np.nan
        for level in levels
    ]
    assert longest_loops(x, t, value, levels) == pytest.approx(expected, nan_ok=True)
    assert np.isnan(longest_loops(x, t, value, np.array([99.0]))).all()
