"""The exact skin as a collider, against all triangles one by one."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.contact.mesh.collide import MeshCollider
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.mesh_distance import MeshDistance


def naive_winding(x, triangles, points):
    """Solid angles of all triangles, summed."""
    a, b, c = (x[triangles[:, k]][None] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    dot = lambda u, v: (u * v).sum(axis=-1)  # noqa: E731
    below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
    return np.arctan2(dot(a, np.cross(b, c)), below).sum(axis=1) / (2.0 * np.pi)


def naive_first_hit(x0, x1, triangles, p, q, samples=2001):
    """Share of the way at which a point first gets behind a triangle through it, by sampling."""
    s = np.linspace(0.0, 1.0, samples)[:, None]
    at = p + s * (q - p)
    first = np.inf
    for triangle in triangles:
        a, b, c = (x0[i] + s * (x1[i] - x0[i]) - at for i in triangle)
        over = -(a * np.cross(b, c)).sum(axis=1)
        for k in np.flatnonzero((over[:-1] >= 0.0) & (over[1:] < 0.0)):
            shares = [np.cross(u, v)[k] for u, v in ((b, c), (c, a), (a, b))]
            if all(share @ sum(shares) >= 0.0 for share in shares):
                first = min(first, s[k, 0])
    return first


def ball(subdivisions=2, radius=0.1, centre=(0.0, 0.0, 0.0)):
    mesh = trimesh.creation.icosphere(subdivisions, radius=radius)
    return np.array(mesh.vertices) + centre, np.array(mesh.faces, np.int32)


def together(*parts):
    count = np.cumsum([0, *(len(x) for x, _ in parts)])
    return np.concatenate([x for x, _ in parts]), np.concatenate(
        [t + n for (_, t), n in zip(parts, count)]
    )


@pytest.fixture(scope="module")
def bent():
    """A mannequin with elbow, knee and shoulder so bent that its skin cuts itself."""
    body = load_body("mannequin:vertices=1000")
    T = rest_transforms(body.rig)
    posed = T.copy()
    for bone, axis, angle in (
        ("leftLowerArm", [0, 0, -1], 2.4),
        ("rightLowerLeg", [0, 1, 0], 2.3),
        ("rightUpperArm", [-1, 0, 0], -0.9),
    ):
        top = body.rig.index(body.humanoid[bone])
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_rotvec(np.array(axis) * angle).as_matrix()
        turn[:3, 3] = posed[top, :3, 3] - turn[:3, :3] @ posed[top, :3, 3]
        below = {top}
        for j in range(top, len(body.rig)):
            if j == top or int(body.rig.parent[j]) in below:
                below.add(j)
                posed[j] = turn @ posed[j]
    return skin_vertices(body.skin, T), skin_vertices(body.skin, posed), body.skin.triangles


def near(x, triangles, count, spread, seed=0):
    rng = np.random.default_rng(seed)
    on = x[triangles[rng.integers(len(triangles), size=count)]].mean(axis=1)
    return on + rng.normal(scale=spread, size=on.shape)


def test_inside_is_where_all_solid_angles_say(bent):
    _, x, triangles = bent
    points = near(x, triangles, 200, 0.02)
    exact = naive_winding(x, triangles, points)
    found = MeshCollider(x, triangles).is_inside(points)
    clear = np.abs(exact - 0.5) > 0.03  # dipoles are that exact
    assert clear.mean() > 0.98
    np.testing.assert_array_equal(found[clear], exact[clear] > 0.5)
    assert exact.max() > 1.5  # it does cut itself


def test_what_is_inside_goes_to_the_closest_outer_surface(bent):
    _, x, triangles = bent
    collider = MeshCollider(x, triangles)
    points = near(x, triangles, 300, 0.012)
    thickness = 0.002
    y, normal, met = collider.collide(points, points, thickness)
    exact = naive_winding(x, triangles, y)
    assert exact.max() < 0.53
    middle = x[triangles].mean(axis=1)
    a, b, c = x[triangles].transpose(1, 0, 2)
    up = np.cross(b - a, c - a)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    outer = naive_winding(x, triangles, middle + 1e-4 * up) < 0.5
    assert (~outer).sum() > 10
    envelope = MeshDistance(x, triangles[outer])
    gap = np.abs(envelope.signed_distance(y)[0])
    touched = met >= 0
    np.testing.assert_array_equal(y[~touched], points[~touched])
    assert (normal[~touched] == 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(normal[touched], axis=1), 1.0, atol=1e-9)
    # A few end between surfaces that are less than twice the thickness apart.
    assert np.quantile(gap[touched], 0.02) > 0.9 * thickness
    inside = naive_winding(x, triangles, points) > 0.5
    moved = np.linalg.norm(y - points, axis=1)
    depth = np.abs(envelope.signed_distance(points)[0])
    once = inside & (moved < depth + thickness + 1e-6)
    # The shortest way, but in creases and where the nearest triangle is partly buried.
    assert once.sum() > 0.8 * inside.sum()
    assert moved.max() < 0.1
    assert touched[inside].all()


def test_the_union_of_balls_is_left_whatever_their_order():
    parts = [ball(3, centre=(0.06 * k, 0.0, 0.0)) for k in range(3)]
    rng = np.random.default_rng(1)
    points = rng.uniform([-0.1, -0.1, -0.1], [0.22, 0.1, 0.1], (200, 3))
    found = []
    for order in ((0, 1, 2), (2, 0, 1)):
        x, triangles = together(*(parts[k] for k in order))
        y, _, _ = MeshCollider(x, triangles).collide(points, points, 0.001)
        assert naive_winding(x, triangles, y).max() < 0.51
        found.append(y)
    # Points with two nearest places may go to either.
    assert (np.linalg.norm(found[0] - found[1], axis=1) < 1e-9).mean() > 0.99


@pytest.mark.parametrize("moving", ["particle", "skin", "both"])
def test_a_way_through_a_limb_ends_where_it_went_in(moving):
    x, triangles = ball(radius=0.03)
    rng = np.random.default_rng(2)
    aim = rng.uniform(-0.02, 0.02, (60, 3))
    way = rng.normal(size=(60, 3))
    way *= 0.2 / np.linalg.norm(way, axis=1, keepdims=True)
    skin_moves = {"particle": 0.0, "skin": 1.0, "both": 0.5}[moving]
    for p, d in zip(aim, way):
        collider = MeshCollider(x + skin_moves * d, triangles)
        collider.update(x - skin_moves * d)
        start = (p - (1.0 - skin_moves) * d)[None]
        end = (p + (1.0 - skin_moves) * d)[None]
        y, _, met = collider.collide(end, start, 0.001)
        assert met[0] >= 0
        seen = y[0] + skin_moves * d  # from the skin
        assert seen @ d < 0.0
        assert 0.0295 < np.linalg.norm(seen) < 0.0325


def test_first_hits_are_those_of_a_moving_folding_skin(bent):
    before, x, triangles = bent
    moved = before + 0.15 * (x - before)
    start = near(before, triangles, 500, 0.01, seed=3)
    start = start[naive_winding(before, triangles, start) < 0.4][:120]
    end = start + np.random.default_rng(4).normal(scale=0.05, size=start.shape)
    collider = MeshCollider(before, triangles)
    collider.update(moved)
    _, _, met = collider.collide(end, start, 0.0)
    hits = 0
    for p, q, m in zip(start, end, met):
        low = np.minimum(p, q)
        high = np.maximum(p, q)
        both = np.stack([before[triangles], moved[triangles]])
        close = (both.min(axis=(0, 2)) <= high) & (both.max(axis=(0, 2)) >= low)
        close = triangles[close.all(axis=1)]
        if np.isfinite(naive_first_hit(before, moved, close, p, q)):
            hits += 1
            assert m >= 0
    assert 20 < hits < 110


def test_a_ball_that_overruns_particles_carries_them_in_front():
    x, triangles = ball(subdivisions=3)
    rng = np.random.default_rng(5)
    particles = rng.uniform([0.11, -0.05, -0.05], [0.3, 0.05, 0.05], (200, 3))
    collider = MeshCollider(x, triangles)
    centre = np.zeros(3)
    for step in range(10):
        centre = np.array([0.06 * (step + 1), 0.0, 0.0])  # 60 mm at a time
        collider.update(x + centre)
        particles, _, _ = collider.collide(particles, particles, 0.001)
        assert np.linalg.norm(particles - centre, axis=1).min() > 0.0995
    assert particles[:, 0].min() > centre[0] - 0.02


def test_open_and_inside_out_skins_still_have_an_inside():
    x, triangles = ball(subdivisions=3)
    holed = triangles[x[triangles].mean(axis=1)[:, 2] < 0.09]  # a cap is missing
    for skin in (holed, triangles[:, ::-1]):
        collider = MeshCollider(x, skin)
        inside = collider.is_inside(np.array([[0.0, 0, 0], [0.05, 0, -0.05], [0.2, 0, 0]]))
        assert inside.tolist() == [True, True, False]
        y, _, _ = collider.collide(np.array([[0.0, 0, -0.08]]), np.array([[0.0, 0, -0.08]]))
        assert np.linalg.norm(y) == pytest.approx(0.1, abs=2e-3)


def test_what_cannot_be_used_is_refused_and_nan_is_left_alone():
    x, triangles = ball()
    for vertices, faces in ((x, triangles[:0]), (x, triangles + 1000), (x * np.nan, triangles)):
        with pytest.raises(GeometryError):
            MeshCollider(vertices, faces)
    collider = MeshCollider(x, triangles)
    with pytest.raises(GeometryError):
        collider.update(x[:-1])
    with pytest.raises(GeometryError):
        collider.collide(np.zeros((2, 3)), np.zeros((3, 3)))
    y, _, met = collider.collide(np.full((1, 3), np.nan), np.zeros((1, 3)))
    assert np.isnan(y).all()
    assert met.tolist() == [-1]
