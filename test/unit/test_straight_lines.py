"""Straight lines over meshes whose distances are known."""

import numpy as np
import pytest

from garment_sim_ros.geometry.geodesics import mesh_graph
from garment_sim_ros.geometry.straight_lines import StraightLines


def uneven_sheet(cloth, rows=14, columns=11):
    """A flat sheet whose inner vertices are shifted by up to a quarter of an edge."""
    vertices, triangles = cloth.grid(rows, columns)
    inner = np.abs(vertices[:, :2]) < 0.99 * np.abs(vertices[:, :2]).max(axis=0)
    shift = np.random.default_rng(1).uniform(-0.005, 0.005, (len(vertices), 2))
    vertices[:, :2] += shift * inner.all(axis=1, keepdims=True)
    return vertices, triangles


def distances(vertices, triangles, source, limit=np.inf):
    distance = np.full(len(vertices), np.inf)
    distance[source] = 0.0
    StraightLines(vertices, triangles).shorten(source, limit, distance)
    return distance


@pytest.mark.parametrize("source", [0, 10, 75, 153])
def test_flat(cloth, source):
    """To every vertex, also along rows where the line goes through other vertices."""
    for vertices, triangles in (uneven_sheet(cloth), cloth.grid(14, 11)):
        expected = np.linalg.norm(vertices - vertices[source], axis=1)
        assert distances(vertices, triangles, source) == pytest.approx(expected, abs=1e-12)


def test_rolled_up(cloth):
    """A sheet around a cylinder: as far as in the plane, chords being at most 0.3 % shorter."""
    vertices, triangles = cloth.grid(14, 11)
    radius = 0.08
    x, y, _ = vertices.T
    rolled = np.stack([radius * np.sin(x / radius), y, radius * np.cos(x / radius)], axis=1)
    expected = np.linalg.norm(vertices - vertices[3], axis=1)[np.arange(len(vertices)) != 3]
    graph, _ = mesh_graph(rolled, triangles).distances(3)
    found = np.delete(distances(rolled, triangles, 3), 3)
    assert (np.delete(graph, 3) / expected).max() > 1.05
    assert 0.997 < (found / expected).min() <= (found / expected).max() < 1.0 + 1e-9


def test_not_across_a_hole(cloth):
    """What lies behind a hole is not in sight; nor is what is beyond the limit looked for."""
    vertices, triangles = cloth.grid(11, 11)
    middle = np.abs(vertices[triangles].mean(axis=1)[:, :2]).max(axis=1) < 0.04
    holed = triangles[~middle]
    source = 5  # In the middle of one side.
    found = distances(vertices, holed, source)
    behind = np.flatnonzero((np.abs(vertices[:, 1]) < 0.001) & (vertices[:, 0] > 0.03))
    assert np.isinf(found[behind]).all()
    graph, _ = mesh_graph(vertices, holed).distances(source)
    together = np.minimum(found, graph)
    corner = np.hypot(0.04, 0.06) + np.hypot(0.04, 0.02) + 0.08 - 0.02
    assert together[behind].max() < corner + 0.08
    near = distances(vertices, triangles, source, limit=0.05)
    expected = np.linalg.norm(vertices - vertices[source], axis=1)
    assert near[expected < 0.05] == pytest.approx(expected[expected < 0.05], abs=1e-12)
    assert np.isinf(near[expected > 0.1]).all()


def test_no_farther_than_the_limit(cloth):
    vertices, triangles = cloth.grid(9, 9)
    graph = mesh_graph(vertices, triangles)
    whole, _ = graph.distances(40)
    part, _ = graph.distances(40, limit=0.05)
    assert (part[whole <= 0.05] == whole[whole <= 0.05]).all()
    assert np.isinf(part[whole > 0.05]).all()
