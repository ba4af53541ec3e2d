"""Outer maps and planar location against brute force."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.colliders.hulls.hull import convex_hull, inflate_vertices
from garment_sim_ros.contact.papers.hull_location import HullLocator
from garment_sim_ros.contact.papers.outer_map import outer_map
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.obb import oriented_box

CHECKED = settings(derandomize=True, deadline=None, max_examples=15)


def boxed_hull(seed, count, shape):
    """A random hull in the frame of its oriented box: vertices and faces."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) * shape
    if seed % 2:
        points /= np.linalg.norm(points / shape, axis=1, keepdims=True)
    hull = convex_hull(points)
    return oriented_box(hull.vertices, hull.faces).local(hull.vertices), hull.faces


def planes_of(vertices, faces):
    a, b, c = vertices[faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return normal, (normal * a).sum(axis=1)


def tricky_points(rng, locator, vertices, count):
    """Points inside and around, many of them on seams, poles, rows and cell corners."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    points = rng.uniform(low - 0.1 * (high - low), high + 0.1 * (high - low), (count, 3))
    table = locator.map
    angle = np.arctan2(points[:, 1], points[:, 0])
    r = np.hypot(points[:, 0], points[:, 1])
    step = 2 * np.pi / table.around
    angle = np.where(rng.random(count) < 0.3, np.round(angle / step) * step, angle)
    r = np.where(rng.random(count) < 0.02, 0.0, r)
    z = points[:, 2]
    if table.is_sphere:
        polar = np.arctan2(r, z)
        rho = np.hypot(r, z)
        snapped = np.round(polar * table.per_row) / table.per_row
        polar = np.where(rng.random(count) < 0.3, snapped, polar)
        r, z = rho * np.sin(polar), rho * np.cos(polar)
    else:
        snapped = table.low + np.round((z - table.low) * table.per_row) / table.per_row
        z = np.where(rng.random(count) < 0.3, snapped, z)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


@CHECKED
@given(
    seed=st.integers(0, 10**6),
    count=st.sampled_from([4, 6, 30, 200]),
    shape=st.sampled_from([(1, 1, 1), (1, 1.2, 1.6), (0.3, 0.4, 2), (0.1, 1, 1.1)]),
    size=st.sampled_from([(3, 1), (12, 8), (7, 5), (24, 16)]),
    search=st.sampled_from(["grid", "kirkpatrick"]),
)
def test_exits_and_insides_are_those_of_all_faces(seed, count, shape, size, search):
    vertices, faces = boxed_hull(seed, count, np.array(shape))
    locator = HullLocator(vertices, faces, around=size[0], rows=size[1], search=search)
    # 40,000 points each: a million in all.
    points = tricky_points(np.random.default_rng(seed), locator, vertices, 40_000)
    normal, offset = planes_of(vertices, faces)
    height = (points @ normal.T - offset).max(axis=1)
    clear = np.abs(height) > 1e-9
    np.testing.assert_array_equal(locator.inside(points)[clear], (height < 0)[clear])

    origin = np.zeros_like(points) if locator.map.is_sphere else points * [0, 0, 1]
    way = points - origin
    length = np.linalg.norm(way, axis=1, keepdims=True)
    way = np.where(length > 0, way / np.where(length > 0, length, 1), [1.0, 0, 0])
    slope = way @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (offset - origin @ normal.T) / slope
    leave = np.where(slope > 0, t, np.inf).min(axis=1)
    enter = np.where(slope < 0, t, -np.inf).max(axis=1)
    reached = np.where(slope == 0, origin @ normal.T <= offset, True).all(axis=1)
    hit = reached & (leave > np.maximum(enter, 0) + 1e-9) & (leave < np.inf)
    found, face = locator.exits(points)
    assert (face[hit] >= 0).all()
    expected = origin + way * leave[:, None]
    np.testing.assert_allclose(found[hit], expected[hit], atol=1e-8)


def test_lists_hold_every_triangle_of_a_direction_and_hardly_more():
    vertices, faces = boxed_hull(5, 60, np.array([1.0, 1.1, 1.3]))
    table = outer_map(vertices, faces, around=12, rows=8, kind="sphere")
    rng = np.random.default_rng(0)
    way = rng.normal(size=(200_000, 3))
    normal, offset = planes_of(vertices, faces)
    with np.errstate(divide="ignore"):
        t = np.where(way @ normal.T > 0, offset / (way @ normal.T), np.inf)
    face = t.argmin(axis=1)
    column = (np.arctan2(way[:, 1], way[:, 0]) % (2 * np.pi) * 12 / (2 * np.pi)).astype(int)
    row = (np.arctan2(np.hypot(way[:, 0], way[:, 1]), way[:, 2]) * 8 / np.pi).astype(int)
    seen = np.zeros((96, len(faces)), bool)
    seen[column * 8 + row, face] = True
    listed = np.zeros_like(seen)
    listed[np.repeat(np.arange(96), np.diff(table.start)), table.face] = True
    assert not (seen & ~listed).any()
    # What no ray of 200,000 met are slivers in cell corners.
    assert (listed & ~seen).sum() <= 0.05 * listed.sum()


def test_shape_decides_the_kind():
    ball, rod = (trimesh.creation.icosphere(subdivisions=2).vertices * s for s in (1, [1, 1, 4.0]))
    faces = convex_hull(ball).faces
    assert outer_map(convex_hull(ball).vertices, faces).is_sphere == 1
    assert outer_map(convex_hull(rod).vertices, convex_hull(rod).faces).is_sphere == 0
    with pytest.raises(GeometryError, match="inside"):
        outer_map(convex_hull(ball + np.array([3.0, 0, 0])).vertices, faces, kind="sphere")


def test_an_oriented_box_holds_its_points_and_finds_axes():
    rng = np.random.default_rng(1)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    box = trimesh.creation.box((1.0, 2.0, 4.0))
    vertices = box.vertices @ turn.T + [5.0, 6.0, 7.0]
    found = oriented_box(vertices, box.faces)
    np.testing.assert_allclose(found.half, [0.5, 1.0, 2.0], atol=1e-9)
    np.testing.assert_allclose(found.centre, [5.0, 6.0, 7.0], atol=1e-9)
    assert np.linalg.det(found.axes) == pytest.approx(1.0)
    local = found.local(vertices)
    assert (np.abs(local) <= found.half + 1e-9).all()


def test_dense_corners_do_not_pull_the_box():
    hull = inflate_vertices(convex_hull(trimesh.creation.box((1.0, 2.0, 4.0)).vertices), 0.0)
    faces = [tuple(f) for f in hull.faces]
    vertices = [tuple(v) for v in hull.vertices]
    for _ in range(300):  # one corner's face divided again and again
        a, b, c = faces.pop()
        vertices.append(tuple(np.mean([vertices[a], vertices[a], vertices[b], vertices[c]], 0)))
        n = len(vertices) - 1
        faces += [(b, c, n), (c, a, n), (a, b, n)]
    found = oriented_box(np.array(vertices), np.array(faces))
    np.testing.assert_allclose(found.half, [0.5, 1.0, 2.0], atol=1e-6)
