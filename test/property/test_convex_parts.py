"""Cutting solids into convex parts."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.colliders.hulls.convex_parts import convex_parts, cut, split
from garment_sim_ros.colliders.hulls.hull import convex_hull

CHECKED = settings(derandomize=True, deadline=None, max_examples=30)


def volume(surface):
    a, b, c = surface.transpose(1, 0, 2)
    return np.einsum("tk,tk->", a, np.cross(b, c)) / 6


def area(surface):
    a, b, c = surface.transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def random_plane(seed, reach):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    return np.array([*normal / np.linalg.norm(normal), rng.uniform(-reach, reach)])


@CHECKED
@given(seed=st.integers(0, 10**6), shape=st.sampled_from(["torus", "box", "ball"]))
def test_a_cut_keeps_surface_and_volume(seed, shape):
    mesh = {
        "torus": lambda: trimesh.creation.torus(1.0, 0.3),
        "box": lambda: trimesh.creation.box((1.0, 2.0, 3.0)),
        "ball": lambda: trimesh.creation.icosphere(subdivisions=3),
    }[shape]()
    surface = mesh.vertices[mesh.faces]
    plane = random_plane(seed, 0.25)
    height = surface @ plane[:3] - plane[3]
    low, high, segments = split(surface, height)
    assert area(low) + area(high) == pytest.approx(mesh.area)
    np.testing.assert_allclose(segments @ plane[:3], plane[3], atol=1e-12)
    below, above = cut(surface, plane)
    assert (below @ plane[:3]).max() <= plane[3] + 1e-12
    assert (above @ plane[:3]).min() >= plane[3] - 1e-12
    assert volume(below) + volume(above) == pytest.approx(mesh.volume)
    assert volume(below) >= -1e-9
    assert volume(above) >= -1e-9


def test_a_convex_solid_stays_whole():
    ball = trimesh.creation.icosphere(subdivisions=3)
    assert len(convex_parts(ball.vertices[ball.faces], saving=0.01, most=10)) == 1


def cross():
    """Two crossed bars, 4 by 1 by 1 each."""
    corners = [(2, 0.5), (0.5, 0.5), (0.5, 2), (-0.5, 2), (-0.5, 0.5), (-2, 0.5)]
    outline = np.array(corners + [(-x, -y) for x, y in corners])
    top = np.column_stack([outline, np.full(12, 0.5)])
    bottom = top * [1, 1, -1]
    fan = np.array([[0.0, 0, 0.5]])
    n = 12
    vertices = np.vstack([top, bottom, fan, fan * [1, 1, -1]])
    ring = [(i, (i + 1) % n) for i in range(n)]
    faces = [(i, j, 2 * n) for i, j in ring] + [(n + j, n + i, 2 * n + 1) for i, j in ring]
    faces += [(j, i, n + i) for i, j in ring] + [(j, n + i, n + j) for i, j in ring]
    return vertices[np.array(faces)]


def test_a_cross_comes_apart_into_bars():
    surface = cross()
    assert volume(surface) == pytest.approx(7.0)
    parts = convex_parts(surface, saving=0.05, most=10)
    hulls = [convex_hull(part.reshape(-1, 3)) for part in parts]
    assert len(parts) <= 7
    assert sum(h.volume for h in hulls) == pytest.approx(7.0, rel=0.12)
    points = np.random.default_rng(0).uniform(-2, 2, (5000, 3)) * [1, 1, 0.25]
    inside = (np.abs(points[:, :2]).min(axis=1) <= 0.5) & (np.abs(points[:, :2]).max(axis=1) <= 2)
    height = np.min([h.height(points) for h in hulls], axis=0)
    assert (height[inside] < 1e-9).all()


def test_an_open_tube_is_closed_not_hollow():
    tube = trimesh.creation.cylinder(radius=1.0, height=4.0)
    side = np.abs(tube.face_normals[:, 2]) < 0.5
    parts = convex_parts(tube.vertices[tube.faces[side]], saving=1e-9, most=1)
    assert volume(parts[0]) == pytest.approx(tube.volume)


@pytest.mark.parametrize("most", [1, 2, 3])
def test_most_is_kept(most):
    surface = cross()
    parts = convex_parts(surface, saving=1e-6, most=most)
    assert len(parts) == most
    hulls = [convex_hull(part.reshape(-1, 3)) for part in parts]
    height = np.min([h.height(surface.reshape(-1, 3)) for h in hulls], axis=0)
    assert height.max() < 1e-9
