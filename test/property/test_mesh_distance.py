"""`MeshDistance` against brute force and against analytic shapes."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.mesh_distance import MeshDistance, sort_triangles
from garment_sim_ros.geometry.winding_number import inside_of

CHECKED = settings(derandomize=True, deadline=None, max_examples=30)


def closest_on_triangles_naive(triangles, point):
    """Closest point of every triangle [t, 3, 3]: the best of plane, edges and corners."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    candidates = []
    for p, q in ((a, b), (b, c), (c, a)):
        d = q - p
        s = np.clip(((point - p) * d).sum(1) / np.maximum((d * d).sum(1), 1e-300), 0, 1)
        candidates.append(p + s[:, None] * d)
    n = np.cross(b - a, c - a)
    area2 = (n * n).sum(1)
    foot = point - (((point - a) * n).sum(1) / np.maximum(area2, 1e-300))[:, None] * n
    inside = area2 > 0
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(q - p, foot - p) * n).sum(1) >= 0
    candidates.append(np.where(inside[:, None], foot, a))
    stacked = np.stack(candidates, axis=1)
    d2 = ((stacked - point) ** 2).sum(-1)
    best = d2.argmin(1)
    rows = np.arange(len(triangles))
    return stacked[rows, best], np.sqrt(d2[rows, best])


def winding_number(triangles, point):
    """Solid angle over 4 pi (van Oosterom & Strackee 1983)."""
    r = triangles - point
    length = np.linalg.norm(r, axis=-1)
    numerator = (r[:, 0] * np.cross(r[:, 1], r[:, 2])).sum(1)
    denominator = (
        length.prod(1)
        + (r[:, 0] * r[:, 1]).sum(1) * length[:, 2]
        + (r[:, 1] * r[:, 2]).sum(1) * length[:, 0]
        + (r[:, 2] * r[:, 0]).sum(1) * length[:, 1]
    )
    return np.arctan2(numerator, denominator).sum() / (2 * np.pi)


def star(seed, subdivisions=2):
    """A closed star-shaped mesh with deep creases."""
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    radius = np.random.default_rng(seed).uniform(0.4, 1.0, len(sphere.vertices))
    return sphere.vertices * radius[:, None], sphere.faces


@CHECKED
@given(seed=st.integers(0, 10**6), spread=st.sampled_from([0.01, 0.3, 2.0]))
def test_agrees_with_brute_force_and_winding_number_on_creased_shapes(seed, spread):
    vertices, faces = star(seed)
    rng = np.random.default_rng(seed + 1)
    points = vertices[rng.integers(0, len(vertices), 40)] + rng.normal(0, spread, (40, 3))
    distance, closest, triangle = MeshDistance(vertices, faces).signed_distance(points)
    for p, d, c, t in zip(points, distance, closest, triangle):
        feet, lengths = closest_on_triangles_naive(vertices[faces], p)
        assert abs(d) == pytest.approx(lengths.min(), abs=1e-12)
        assert lengths[t] == pytest.approx(lengths.min(), abs=1e-12)
        np.testing.assert_allclose(c, feet[t], atol=1e-12)
        if abs(d) > 1e-9:
            assert (d < 0) == (winding_number(vertices[faces], p) > 0.5)


@pytest.mark.parametrize("direction", [(1, 0, 0), (1, 1, 0), (1, 1, 1), (-2, 3, 0.5)])
def test_box_is_exact_at_faces_edges_and_corners(direction):
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    points = np.linspace(-3, 3, 61)[:, None] * np.asarray(direction, float)
    distance, _, _ = MeshDistance(box.vertices, box.faces).signed_distance(points)
    q = np.abs(points) - 1.0
    expected = np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(1), 0)
    np.testing.assert_allclose(distance, expected, atol=1e-12)


def test_torus_within_its_chord_error():
    torus = trimesh.creation.torus(1.0, 0.3, major_sections=128, minor_sections=64)
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (3000, 3))
    distance, _, _ = MeshDistance(torus.vertices, torus.faces).signed_distance(points)
    ring = np.hypot(points[:, 0], points[:, 1]) - 1.0
    expected = np.hypot(ring, points[:, 2]) - 0.3
    chord = 1.3 * (1 - np.cos(np.pi / 128)) + 0.3 * (1 - np.cos(np.pi / 64))
    np.testing.assert_allclose(distance, expected, atol=chord)


def test_refit_equals_a_new_tree():
    vertices, faces = star(3, subdivisions=3)
    moved = vertices * [1.0, 0.5, 2.0] + [0.1, 0.2, 0.3]
    points = np.random.default_rng(0).normal(size=(500, 3))
    refitted = MeshDistance(vertices, faces)
    refitted.refit(moved)
    got = refitted.signed_distance(points)[0]
    np.testing.assert_allclose(got, MeshDistance(moved, faces).signed_distance(points)[0])


def test_degenerate_triangles_and_unused_vertices_do_no_harm():
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    vertices = np.vstack([box.vertices, [[9.0, 9.0, 9.0]]])
    faces = np.vstack([box.faces, [[0, 0, 1], [2, 2, 2]]])
    points = np.random.default_rng(0).uniform(-2, 2, (500, 3))
    distance = MeshDistance(vertices, faces).signed_distance(points)[0]
    np.testing.assert_allclose(
        distance, MeshDistance(box.vertices, box.faces).signed_distance(points)[0], atol=1e-12
    )


def test_points_that_are_not_finite_are_marked():
    vertices, faces = star(0)
    points = np.array([[np.nan, 0, 0], [0, np.inf, 0], [0, 0, 3.0]])
    distance, _, triangle = MeshDistance(vertices, faces).signed_distance(points)
    assert np.isnan(distance[:2]).all()
    assert (triangle[:2] == -1).all()
    assert distance[2] > 2.0


@pytest.mark.parametrize(
    ("vertices", "triangles"),
    [
        (np.zeros((3, 3)), np.zeros((0, 3), int)),
        (np.zeros((3, 3)), [[0, 1, 3]]),
        (np.zeros((3, 3)), [[0, 1, -1]]),
        (np.full((3, 3), np.nan), [[0, 1, 2]]),
    ],
)
def test_unusable_meshes_are_refused(vertices, triangles):
    with pytest.raises(GeometryError):
        MeshDistance(vertices, np.asarray(triangles))


@CHECKED
@given(seed=st.integers(0, 10**6), count=st.integers(1, 200), depth=st.integers(0, 6))
def test_triangles_are_sorted_in_halves(seed, count, depth):
    """By their middles along the longest axis of each half; equal ones may be anywhere."""
    middles = np.random.default_rng(seed).integers(0, 9, (count, 3)).astype(float)
    order = np.arange(count, dtype=np.int32)
    sort_triangles(middles, order, depth)
    assert sorted(order.tolist()) == list(range(count))

    for level in range(depth):
        edges = [(k * count) >> (level + 1) for k in range(2 ** (level + 1) + 1)]
        for begin, middle, end in zip(edges[0::2], edges[1::2], edges[2::2]):
            if begin < middle < end:
                node = middles[order[begin:end]]
                along = node[:, np.argmax(np.ptp(node, axis=0))]
                assert along[: middle - begin].max() <= along[middle - begin :].min()


@CHECKED
@given(seed=st.integers(0, 10**6))
def test_inside_of_a_surface_that_moves(seed):
    """Triangle by triangle, of single vertices, as the winding number has it."""
    vertices, faces = star(seed, subdivisions=1)
    x = vertices.astype(np.float32)
    points = np.random.default_rng(seed + 1).uniform(-0.7, 0.7, (40, 3))
    found = np.zeros(40, np.bool_)
    inside_of(x, faces.astype(np.int32), points, found)
    expected = [winding_number(x.astype(float)[faces], p) for p in points]
    for inside, number in zip(found, expected, strict=True):
        assert abs(number - 0.5) < 1e-3 or inside == (number > 0.5)
    assert 0 < found.sum() < 40
