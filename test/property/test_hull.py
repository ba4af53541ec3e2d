"""Hulls, their inflation and their simplification."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.colliders.hulls.hull import (
    clearance,
    convex_hull,
    inflate_planes,
    inflate_vertices,
)
from garment_sim_ros.colliders.hulls.hull_placement import QUADRIC, VOLUME
from garment_sim_ros.colliders.hulls.hull_simplify import Simplification, simplify_hull
from garment_sim_ros.errors import GeometryError, ParameterError

CHECKED = settings(derandomize=True, deadline=None, max_examples=40)


def cloud(seed, count, flatness=1.0):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) * [1.0, rng.uniform(0.3, 1.0), flatness]
    return points @ np.linalg.qr(rng.normal(size=(3, 3)))[0] * 0.1 + rng.normal(size=3)


def assert_closed_and_convex(hull):
    mesh = trimesh.Trimesh(hull.vertices, hull.faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(hull.volume)
    assert hull.volume > 0
    size = np.ptp(hull.vertices, axis=0).max()
    assert hull.height(hull.vertices).max() < 1e-9 * size


@CHECKED
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(4, 200),
    flatness=st.sampled_from([1.0, 0.1, 0.01]),
)
def test_hulls_are_closed_convex_and_contain(seed, count, flatness):
    points = cloud(seed, count, flatness)
    hull = convex_hull(points)
    assert_closed_and_convex(hull)
    assert hull.height(points).max() < 1e-12 * np.abs(points).max() * 10


def test_coplanar_and_doubled_points_of_a_box():
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 3), -1).reshape(-1, 3)
    hull = convex_hull(np.vstack([grid, grid]))
    assert_closed_and_convex(hull)
    assert hull.volume == pytest.approx(1.0)
    assert not hull.outside(grid).any()
    assert hull.outside(grid[-1:] + 1e-15).all()


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.eye(3),
        np.zeros((10, 3)),
        np.column_stack([np.random.default_rng(0).normal(size=(50, 2)), np.zeros(50)]),
        np.full((5, 3), np.nan),
    ],
)
def test_degenerate_points_are_refused(points):
    with pytest.raises(GeometryError):
        convex_hull(points)


@CHECKED
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(4, 100),
    delta=st.sampled_from([0.0, 1e-4, 0.005, 0.1, 5.0]),
)
def test_inflation_gains_clearance(seed, count, delta):
    hull = convex_hull(cloud(seed, count))
    by_vertices = inflate_vertices(hull, delta)
    assert_closed_and_convex(by_vertices)
    gained = clearance(by_vertices, hull)
    assert gained.min() > -1e-12
    assert gained.max() <= delta + 1e-12
    by_planes = inflate_planes(hull, delta)
    assert clearance(by_planes, hull).min() >= delta - 1e-9


@CHECKED
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(8, 250),
    delta=st.sampled_from([0.0, 1e-3, 0.01, 0.2]),
    outside=st.sampled_from([1.0, 2.0, 4.0]),
    objective=st.sampled_from([QUADRIC, VOLUME]),
)
def test_simplified_hulls_contain_and_stay_in_their_band(seed, count, delta, outside, objective):
    points = cloud(seed, count)
    hull = convex_hull(points)
    start = inflate_vertices(hull, delta)
    band = max(outside * delta, start.height(hull.vertices).max())
    how = Simplification(max_faces=4, outside=outside * delta, objective=objective)
    simple = simplify_hull(start, hull, how)
    assert_closed_and_convex(simple)
    assert len(simple.faces) <= max(len(start.faces), 4)
    if delta > 0:
        assert not simple.outside(points).any()
        assert hull.height(simple.vertices).max() <= max(band, outside * delta) + 1e-6


@CHECKED
@given(seed=st.integers(0, 10**6), floor=st.integers(4, 60))
def test_the_floor_is_a_floor(seed, floor):
    hull = convex_hull(cloud(seed, 150))
    start = inflate_vertices(hull, 0.002)
    simple = simplify_hull(start, hull, Simplification(max_faces=floor))
    assert min(floor, len(start.faces)) <= len(simple.faces) <= max(floor + 1, 12)
    assert not simple.outside(hull.vertices).any()


@CHECKED
@given(seed=st.integers(0, 10**6), floor=st.integers(4, 100))
def test_triangles_alone_go_four_faces_at_a_time(seed, floor):
    hull = convex_hull(cloud(seed, 150))
    start = inflate_vertices(hull, 0.01)
    how = Simplification(max_faces=floor, triangles_only=True)
    simple = simplify_hull(start, hull, how)
    assert_closed_and_convex(simple)
    assert not simple.outside(hull.vertices).any()
    # A triangle that collapses to a vertex takes itself and its three neighbours along.
    assert (len(start.faces) - len(simple.faces)) % 4 == 0
    assert len(simple.faces) >= min(floor, len(start.faces))


def test_more_room_never_needs_more_faces():
    hull = convex_hull(cloud(5, 300))
    counts = [
        len(
            simplify_hull(
                inflate_vertices(hull, delta), hull, Simplification(outside=2 * delta)
            ).faces
        )
        for delta in (0.001, 0.004, 0.016, 0.064)
    ]
    assert counts == sorted(counts, reverse=True)


def test_volume_placement_is_tighter_than_quadric():
    hull = convex_hull(cloud(6, 300))
    start = inflate_vertices(hull, 0.005)
    volumes = [
        simplify_hull(
            start, hull, Simplification(max_faces=60, outside=0.02, objective=objective)
        ).volume
        for objective in (QUADRIC, VOLUME)
    ]
    assert hull.volume < volumes[1] < volumes[0]


def test_a_floor_below_a_tetrahedron_is_refused():
    hull = convex_hull(cloud(0, 20))
    with pytest.raises(ParameterError, match="4 or more"):
        simplify_hull(hull, hull, Simplification(max_faces=3))
