import numpy as np
import pytest
import trimesh
from scipy.special import ellipe

from garment_sim_ros.body.mannequin.girth import girth
from garment_sim_ros.body.mannequin.mesh import symmetric_mesh
from garment_sim_ros.body.mannequin.surface import Loft, surface
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.marching_tetrahedra import marching_tetrahedra

RADII = np.array([0.5, 0.3, 0.7])


def ellipsoid(points):
    """Field of an ellipsoid, exact on its surface."""
    q = np.linalg.norm(points / RADII, axis=-1)
    return (q - 1.0) * RADII.min()


def sample(origin, spacing, shape):
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1)
    return ellipsoid(origin + spacing * grid)


def scaled_to_surface(points):
    return points / np.linalg.norm(points / RADII, axis=1, keepdims=True)


def test_marching_tetrahedra_give_a_closed_outward_surface():
    x, triangles = marching_tetrahedra(
        sample(np.full(3, -0.8), 0.05, (33, 33, 33)), np.full(3, -0.8), 0.05
    )
    mesh = trimesh.Trimesh(x, triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2
    assert mesh.volume == pytest.approx(4.0 / 3.0 * np.pi * RADII.prod(), rel=0.03)


@pytest.mark.parametrize("vertices", [100, 999, 2000])
def test_symmetric_mesh_has_the_wanted_size_and_lies_on_the_surface(vertices):
    x, triangles = symmetric_mesh(
        sample,
        scaled_to_surface,
        lambda points: np.ones(len(points)),
        np.full(3, -0.8),
        np.full(3, 0.8),
        0.04,
        vertices,
    )
    mesh = trimesh.Trimesh(x, triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2
    assert abs(len(x) - vertices) <= 1
    assert np.abs(ellipsoid(x)).max() < 1e-12
    assert np.degrees(mesh.face_angles.min()) > 20.0
    assert mesh.volume == pytest.approx(4.0 / 3.0 * np.pi * RADII.prod(), rel=12.0 / vertices)


def test_a_coarse_grid_is_refused():
    with pytest.raises(GeometryError, match="too coarse"):
        symmetric_mesh(
            sample,
            scaled_to_surface,
            lambda points: np.ones(len(points)),
            np.full(3, -0.8),
            np.full(3, 0.8),
            0.3,
            5000,
        )


def loft(**changes):
    """A tapered, leaning, asymmetric part."""
    axis = np.array([0.3, 0.1, 1.0]) / np.linalg.norm([0.3, 0.1, 1.0])
    u = np.cross([0.0, 1.0, 0.0], axis)
    u /= np.linalg.norm(u)
    fields = {
        "origin": np.array([0.1, 0.25, 0.4]),
        "frame": np.array([u, np.cross(axis, u), axis]),
        "stations": np.array([0.0, 0.2, 0.5, 0.6]),
        "sections": np.array(
            [
                [0.00, 0.00, 0.10, 0.14, 0.08, 0.09, 2.0],
                [0.02, 0.01, 0.12, 0.13, 0.09, 0.10, 2.4],
                [0.01, 0.02, 0.09, 0.08, 0.07, 0.07, 2.2],
                [0.00, 0.00, 0.07, 0.07, 0.06, 0.06, 2.0],
            ]
        ),
        "caps": (0.05, 0.08),
        "blend": 0.04,
    }
    return Loft(**{**fields, **changes})


def naive_loft(packed, index, point):
    """One part's field in plain numpy, from its packed knots."""
    origin, frame = packed.frame[index, 0], packed.frame[index, 1:]
    first, last, low_cap, high_cap = packed.span[index, :4]
    u, v, t = frame @ (point - origin)
    inside = np.clip(t, first, last)
    knots = packed.knots[index]
    s = (inside - first) / (last - first) * (len(knots) - 1)
    i = min(int(s), len(knots) - 2)
    s -= i
    around = knots[[max(i - 1, 0), i, i + 1, min(i + 2, len(knots) - 1)]]
    basis = np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]]) / 2.0
    section = np.array([1.0, s, s**2, s**3]) @ basis @ around
    u, v = u - section[0], v - section[1]
    a, b = section[2 if u > 0.0 else 3], section[4 if v > 0.0 else 5]
    n = section[6]
    q = (abs(u / a) ** n + abs(v / b) ** n) ** (1.0 / n)
    q = np.hypot(q, (t - inside) / (low_cap if t < inside else high_cap))
    return np.linalg.norm([u, v, t - inside]) * (1.0 - 1.0 / q)


def test_part_field_equals_its_naive_twin():
    packed = surface([loft()], floor_blend=0.01)
    points = np.random.default_rng(1).uniform([-0.3, 0.0, 0.1], [0.6, 0.6, 1.3], (300, 3))
    np.testing.assert_allclose(
        packed.part(0, points), [naive_loft(packed, 0, p) for p in points], rtol=1e-9, atol=1e-12
    )


def naive_union(packed, point):
    """The whole field from naive parts: smooth unions in order, without any culling."""

    def smooth_minimum(a, b, k):
        return min(a, b) - (max(k - abs(a - b), 0.0) ** 3 / (6.0 * k * k) if k > 0.0 else 0.0)

    d = 1e9
    for i, (mirrored, carved) in enumerate(packed.flags):
        part = naive_loft(packed, i, point)
        if mirrored:
            twin = naive_loft(packed, i, point * [1.0, -1.0, 1.0])
            part = smooth_minimum(part, twin, packed.span[i, 5])
        sign = -1.0 if carved else 1.0
        d = sign * smooth_minimum(sign * d, part, packed.span[i, 4])
    return -smooth_minimum(-d, point[2], packed.floor_blend)


def test_union_equals_its_naive_twin_near_the_surface():
    packed = surface(
        [
            loft(),
            loft(origin=np.array([0.2, 0.12, 0.3]), mirrored=True, twin_blend=0.05),
            loft(origin=np.array([0.3, 0.2, 0.5]), carved=True, blend=0.02),
        ],
        floor_blend=0.01,
    )
    points = np.random.default_rng(2).uniform([-0.3, -0.6, -0.1], [0.7, 0.6, 1.2], (3000, 3))
    value = packed(points)
    near = np.abs(value) < 0.03
    assert near.sum() > 100
    twin = np.array([naive_union(packed, p) for p in points[near]])
    np.testing.assert_allclose(value[near], twin, rtol=1e-9, atol=1e-12)


def test_projection_and_sampling_agree_with_the_field():
    packed = surface([loft(mirrored=True)], floor_blend=0.01)
    points = np.random.default_rng(3).uniform([-0.1, -0.5, 0.3], [0.5, 0.5, 1.1], (2000, 3))
    points = points[np.abs(packed(points)) < 0.02]
    for _ in range(6):
        points = packed.project(points)
    assert np.percentile(np.abs(packed(points)), 98) < 1e-6
    origin, spacing = np.array([-0.2, 0.0, 0.2]), 0.03
    grid = packed.sample(origin, spacing, (31, 22, 37))
    nodes = np.stack(np.meshgrid(*(np.arange(n) for n in grid.shape), indexing="ij"), axis=-1)
    value = packed((origin + spacing * nodes).reshape(-1, 3)).reshape(grid.shape)
    assert ((grid < 0.0) == (value < 0.0)).all()
    close = np.abs(value) < 2.0 * spacing
    np.testing.assert_array_equal(grid[close], value[close])


def test_tape_around_an_ellipse():
    a, b = 0.5, 0.3
    length = girth(ellipsoid, np.zeros(3), np.eye(3)[0], np.eye(3)[1], 0.4, rays=96)
    assert length == pytest.approx(4.0 * a * ellipe(1.0 - (b / a) ** 2), rel=2e-3)
