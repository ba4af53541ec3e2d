"""Signed distances to hulls through the grid of faces, against all planes."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.spatial.transform import Rotation

from garment_sim_ros.colliders.hulls.hull import convex_hull
from garment_sim_ros.contact.collide import collide
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.kinds.face_grid import face_grid
from garment_sim_ros.contact.kinds.hull import hull_distance
from garment_sim_ros.contact.kinds.packed_hulls import hull_bound, hull_planes, pack_hulls
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.contact.sides import Sides
from garment_sim_ros.errors import GeometryError

CHECKED = settings(derandomize=True, deadline=None, max_examples=25)


@njit
def distances(shapes, posed, k, points, reach, distance, normal):
    for i in range(len(points)):
        d, nx, ny, nz = hull_distance(
            shapes, posed, k, points[i, 0], points[i, 1], points[i, 2], reach
        )
        distance[i] = d
        normal[i, 0], normal[i, 1], normal[i, 2] = nx, ny, nz


def ask(hulls, k, points, R, reach):
    distance = np.full(len(points), np.nan, np.float32)
    normal = np.full((len(points), 3), np.nan, np.float32)
    shapes = pack(
        ColliderSet(
            colliders=tuple(
                Collider(
                    name=str(n),
                    kind="hull",
                    bone="bone",
                    geometry={"vertices": hull.vertices, "faces": hull.faces},
                )
                for n, hull in enumerate(hulls)
            )
        )
    )
    posed = PosedShapes.room_for(shapes)
    posed.rotation[:] = R
    distances(shapes, posed, k, points.astype(np.float32), np.float32(reach), distance, normal)
    return distance, normal


def random_hull(seed, count, shape):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) * shape
    if seed % 2:
        points /= np.linalg.norm(points / shape, axis=1, keepdims=True)
    return convex_hull(points * 0.1)


@CHECKED
@given(
    seed=st.integers(0, 10**6),
    count=st.sampled_from([4, 5, 12, 60, 300]),
    shape=st.sampled_from([(1, 1, 1), (0.2, 0.5, 3), (1, 1, 0.05)]),
)
def test_no_face_is_missed(seed, count, shape):
    hull = random_hull(seed, count, np.array(shape))
    planes = hull_planes(hull.vertices, hull.faces)
    low, high = hull.vertices.min(axis=0) - 0.02, hull.vertices.max(axis=0) + 0.02
    grid = face_grid(planes, low, high)
    rng = np.random.default_rng(seed)
    # 40,000 points each: a million in all; on cell corners and faces as well as inside cells.
    points = rng.uniform(low, high, (40_000, 3))
    snapped = rng.random((40_000, 3)) < 0.3
    points = np.where(snapped, low + np.round((points - low) / grid.cell) * grid.cell, points)
    cell = np.clip(((points - low) / grid.cell).astype(int), 0, grid.count - 1)
    row = (cell[:, 0] * grid.count[1] + cell[:, 1]) * grid.count[2] + cell[:, 2]
    height = points @ planes[:, :3].T - planes[:, 3]
    listed = np.zeros((len(grid.start) - 1, len(planes)), bool)
    listed[np.repeat(np.arange(len(grid.start) - 1), np.diff(grid.start)), grid.face] = True
    best = np.where(listed[row], height, -np.inf).max(axis=1)
    np.testing.assert_allclose(best, height.max(axis=1), atol=1e-6 * (high - low).max())
    assert np.diff(grid.start).min() >= 1


@CHECKED
@given(seed=st.integers(0, 10**6), reach=st.sampled_from([0.0, 0.002, 0.006, 0.05, 1.0]))
def test_distances_are_those_of_all_planes(seed, reach):
    hulls = [random_hull(seed + k, 30, np.array([1.0, 0.7, 2.0])) for k in range(3)]
    rng = np.random.default_rng(seed)
    R = Rotation.random(random_state=seed % 1000).as_matrix()
    for h, hull in enumerate(hulls):
        local = rng.uniform(-0.5, 0.5, (2000, 3))
        distance, normal = ask(hulls, h, local @ R.T, R, reach)
        height = local @ hull.planes[:, :3].T - hull.planes[:, 3]
        expected = height.max(axis=1)
        near = np.abs(expected - reach) > 1e-5
        # Off a sharp corner a plane may be near, but not the hull.
        low, high = hull.vertices.min(axis=0) - reach, hull.vertices.max(axis=0) + reach
        near &= ((local > low + 1e-5) & (local < high - 1e-5)).all(axis=1)
        found = np.isfinite(distance)
        np.testing.assert_array_equal(found[near], (expected <= reach)[near])
        np.testing.assert_allclose(distance[found], expected[found], atol=1e-6)
        # The direction leads out: moved by the depth, the point is on the surface or outside.
        out = (local @ R.T)[found] + normal[found] * -distance[found, None]
        after = (out @ R) @ hull.planes[:, :3].T - hull.planes[:, 3]
        assert after.max(axis=1).min() > -1e-5
        np.testing.assert_allclose(np.linalg.norm(normal[found], axis=1), 1.0, atol=1e-5)


@CHECKED
@given(
    seed=st.integers(0, 10**6),
    slip=st.sampled_from([1e-4, 1e-3, 5e-3, 0.03]),
    thickness=st.sampled_from([0.002, 0.05]),
)
def test_friction_never_leaves_a_particle_on_a_face_that_it_slid_off(seed, slip, thickness):
    hull = random_hull(seed, 30, np.array([1.0, 0.7, 2.0]))
    shape = Collider(
        name="hull",
        kind="hull",
        bone="bone",
        geometry={"vertices": hull.vertices, "faces": hull.faces},
    )
    shapes = pack(ColliderSet(colliders=(shape,)))
    posed, still = PosedShapes.room_for(shapes), ColliderPoses.identity(1)
    pose(shapes, still, still, np.zeros(3), posed)
    rng = np.random.default_rng(seed)
    weight = rng.dirichlet([1.0, 1.0, 1.0], 500)
    at = np.einsum(
        "nc,nck->nk", weight, hull.vertices[hull.faces[rng.integers(len(hull.faces), size=500)]]
    )
    x = (at * rng.uniform(0.9, 1.0, (500, 1))).astype(np.float32)
    before = (x + rng.normal(0.0, slip, x.shape)).astype(np.float32)

    def nearest(p):
        height = p @ hull.planes[:, :3].T - hull.planes[:, 3]
        low, best = np.partition(height, -2, axis=1)[:, -2:].T
        return best, hull.planes[height.argmax(axis=1), :3], best - low > 1e-6

    start, expected = before.astype(np.float64), x.astype(np.float64)
    d, n, clear = nearest(expected)
    way = expected - start
    along = (way * n).sum(axis=1)
    way -= along[:, None] * n
    limit = 0.5 * np.minimum(thickness - d, np.maximum(-along, 0.0))
    expected -= way * np.minimum(1.0, limit / np.linalg.norm(way, axis=1))[:, None]
    d, n, still_clear = nearest(expected)
    expected += n * np.maximum(thickness - d, 0.0)[:, None]
    collide(
        *(shapes, posed, Sides.all_under(500, 1), x, before, thickness, 0.5),
        Contacts.room_for(500, 1),
    )
    clear &= still_clear
    assert clear.mean() > 0.9
    np.testing.assert_allclose(x[clear], expected[clear], atol=2e-6)


@CHECKED
@given(seed=st.integers(0, 10**6))
def test_the_bound_holds_all_corners(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(rng.integers(4, 50), 3)) * rng.uniform(0.1, 2.0, 3)
    bound = np.array(hull_bound(points))
    axis = bound[3:6] - bound[:3]
    t = np.clip((points - bound[:3]) @ axis / max(axis @ axis, 1e-12), 0, 1)
    off = np.linalg.norm(points - bound[:3] - t[:, None] * axis, axis=1)
    assert off.max() <= bound[6] + 1e-9


def test_a_box_has_six_planes():
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    assert len(hull_planes(box.vertices, box.faces)) == 6


@pytest.mark.parametrize("fault", ["dent", "turned", "few", "nan", "index"])
def test_faulty_hulls_are_refused(fault):
    box = trimesh.creation.box((1.0, 1.0, 1.0)).subdivide()
    vertices, faces = np.array(box.vertices), np.array(box.faces)
    if fault == "dent":
        vertices[np.argmax(np.abs(vertices).sum(axis=1))] *= 0.5
    elif fault == "turned":
        faces = faces[:, ::-1]
    elif fault == "few":
        faces = faces[:3]
    elif fault == "nan":
        vertices[0] = np.nan
    else:
        faces[0, 0] = len(vertices)
    with pytest.raises(GeometryError, match="'chest'"):
        pack_hulls({"chest": (vertices, faces)})
