"""Repairing, refining, cutting and remeshing keep what they must on any mesh."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from garment_sim_ros.garment.attachments import smoothed
from garment_sim_ros.garment.evening import evened
from garment_sim_ros.garment.isosurface import clipped, surface_net
from garment_sim_ros.garment.mesh import load_garment_mesh
from garment_sim_ros.garment.mesh_repair import repaired
from garment_sim_ros.garment.sizing import Sizes
from garment_sim_ros.garment.slices import NORMALS, Profile, outline, sections
from garment_sim_ros.geometry.connectivity import adjacency, components
from garment_sim_ros.geometry.remesh import remeshed
from garment_sim_ros.geometry.subdivide import subdivided
from garment_sim_ros.geometry.topology import boundary_loops, edge_table, non_manifold_edges

CHECKED = settings(derandomize=True, deadline=None, max_examples=25)


def area(x, triangles):
    a, b, c = np.moveaxis(x[triangles], 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def volume(x, triangles):
    a, b, c = np.moveaxis(x[triangles], 1, 0)
    return np.einsum("ti,ti->", a, np.cross(b, c)) / 6.0


def euler(triangles):
    return len(np.unique(triangles)) - len(edge_table(triangles)[0]) + len(triangles)


def wavy(cloth, rows, columns, seed):
    x, triangles = cloth.grid(rows, columns, 0.05)
    rng = np.random.default_rng(seed)
    return x + rng.uniform(-0.015, 0.015, x.shape), triangles


@CHECKED
@given(st.integers(3, 8), st.integers(3, 8), st.integers(0, 2**32 - 1))
def test_repair_undoes_damage(cloth, rows, columns, seed):
    x, triangles = wavy(cloth, rows, columns, seed)
    rng = np.random.default_rng(seed)
    turned = rng.random(len(triangles)) < 0.3
    damaged = triangles.copy()
    damaged[turned] = damaged[turned][:, ::-1]
    # Every corner refers to one of three copies of its vertex; unused ones lie between.
    copies = np.concatenate([x, x, x, rng.uniform(5.0, 6.0, (7, 3))])
    damaged = damaged + len(x) * rng.integers(0, 3, damaged.shape)
    extra = damaged[rng.integers(0, len(damaged), 5)][:, [1, 2, 0]]
    clean_x, clean, notes = repaired(copies, np.concatenate([damaged, extra]))
    assert len(clean_x) == len(x)
    assert len(clean) == len(triangles)
    assert not len(non_manifold_edges(clean))
    assert np.isclose(area(clean_x, clean), area(x, triangles))
    assert turned.any() <= any("turned" in note for note in notes) or turned.sum() == 0
    again_x, again, more = repaired(clean_x, clean)
    assert not more
    assert np.array_equal(again, clean)
    assert np.array_equal(again_x, clean_x)


@CHECKED
@given(st.integers(2, 6), st.integers(2, 6), st.integers(0, 2**32 - 1), st.floats(0.004, 0.2))
def test_subdivision_keeps_surface_and_topology(cloth, rows, columns, seed, edge_length):
    x, triangles = wavy(cloth, rows, columns, seed)
    fine_x, fine = subdivided(x, triangles, edge_length)
    edges, _, count = edge_table(fine)
    length = np.linalg.norm(fine_x[edges[:, 0]] - fine_x[edges[:, 1]], axis=1)
    assert length.max() <= 4.0 / 3.0 * edge_length
    assert count.max() <= 2
    assert not len(non_manifold_edges(fine))
    assert np.array_equal(fine_x[: len(x)], x)
    assert np.isclose(area(fine_x, fine), area(x, triangles))
    assert euler(fine) == euler(triangles)
    assert len(boundary_loops(fine)) == 1


@CHECKED
@given(st.integers(4, 9), st.integers(0, 2**32 - 1))
def test_cut_splits_the_area(cloth, rows, seed):
    x, triangles = wavy(cloth, rows, rows, seed)
    value = np.random.default_rng(seed + 1).uniform(-1.0, 1.0, len(x))
    value[::5] = 0.0
    assume((value < 0).any() and (value > 0).any())
    total = 0.0
    for sign in (1.0, -1.0):
        part_x, part, origin = clipped(x, triangles, sign * value)
        total += area(part_x, part)
        kept = origin >= 0
        assert np.array_equal(part_x[kept], x[origin[kept]])
        assert (sign * value[origin[kept]] <= 0.0).all()
        assert edge_table(part)[2].max() <= 2
    assert np.isclose(total, area(x, triangles))


def ball_field(radius, centre, spacing, nodes):
    grid = spacing * np.moveaxis(np.indices((nodes,) * 3), 0, -1)
    return np.linalg.norm(grid - centre, axis=-1) - radius


@CHECKED
@given(st.floats(0.3, 0.42), st.floats(0.45, 0.55), st.floats(0.45, 0.55), st.integers(120, 700))
def test_net_and_remeshing_of_a_ball(radius, cx, cy, count):
    centre = np.array([cx, cy, 0.5])
    field = ball_field(radius, centre, 0.05, 21)
    x, triangles = surface_net(field, np.zeros(3), 0.05)
    assert euler(triangles) == 2
    assert not len(non_manifold_edges(triangles))
    assert np.isclose(volume(x - centre, triangles), 4 / 3 * np.pi * radius**3, rtol=0.05)

    def project(points):
        away = points - centre
        return centre + radius * away / np.linalg.norm(away, axis=1, keepdims=True)

    x, triangles = remeshed(x, triangles, count, project)
    assert len(x) == count
    assert euler(triangles) == 2
    assert not len(non_manifold_edges(triangles))
    edges, _, _ = edge_table(triangles)
    length = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)
    assert length.max() < 2.0 * np.median(length)
    assert length.min() > 0.35 * np.median(length)


@CHECKED
@given(st.integers(80, 500), st.floats(0.05, 0.2))
def test_remeshing_keeps_boundaries(count, cut):
    centre = np.full(3, 0.5)
    x, triangles = surface_net(ball_field(0.4, centre, 0.05, 21), np.zeros(3), 0.05)
    for sign in (1.0, -1.0):
        x, triangles, _ = clipped(x, triangles, sign * (x[:, 2] - 0.5) - cut)

    def project(points):
        away = points - centre
        return centre + 0.4 * away / np.linalg.norm(away, axis=1, keepdims=True)

    x, triangles = remeshed(x, triangles, count, project)
    assert len(x) == count
    loops = boundary_loops(triangles)
    assert len(loops) == 2
    assert components(triangles, len(x))[0] == 1
    for loop in loops:
        # Moving along the boundary does not move the boundary.
        assert np.allclose(np.abs(x[loop, 2] - 0.5), cut, atol=0.03)


def pipe(around, rows, notch):
    """A tube whose lower hem has notches, two seams of its texture along it; OBJ lines."""
    angle = 2.0 * np.pi * np.arange(around) / around
    z = np.linspace(0.0, 0.6, rows)
    x = np.array([[0.2 * np.cos(a), 0.2 * np.sin(a), h] for h in z for a in angle])
    x[: around : around // 4, 2] += notch
    lines = [f"v {p[0]:.9f} {p[1]:.9f} {p[2]:.9f}" for p in x]
    lines += [f"vt {k} 0" for k in range(2 * len(x))]
    half = around // 2
    for k in range(rows - 1):
        for i in range(around):
            j = (i + 1) % around
            ring = [k * around + i, k * around + j, (k + 1) * around + j, (k + 1) * around + i]
            # Each half of the tube is a piece of its own on the texture.
            corners = [f"{v + 1}/{v + 1 + (i >= half) * len(x)}" for v in ring]
            lines.append("f " + " ".join(corners))
    return x, "\n".join(lines)


@settings(CHECKED, max_examples=8)
@given(st.sampled_from([16, 24, 32]), st.integers(5, 12), st.floats(0.015, 0.05))
def test_remeshing_keeps_hems_seams_and_their_corners(tmp_path_factory, around, rows, edge):
    path = tmp_path_factory.mktemp("pipe") / "pipe.obj"
    x, text = pipe(around, rows, 0.04)
    path.write_text(text)
    mesh = load_garment_mesh(path, up="z")
    assert len(mesh.seams) == 2 * (rows - 1)
    made = evened(mesh, Sizes.even(edge))
    y, triangles = made.vertices, made.triangles
    edges, _, _ = edge_table(triangles)
    length = np.linalg.norm(y[edges[:, 0]] - y[edges[:, 1]], axis=1)
    assert np.median(length) == pytest.approx(edge, rel=0.15)
    # Tips of the notches, and where seams end.
    for corner in x[: around : around // 4]:
        assert np.linalg.norm(y - corner, axis=1).min() < 1e-9
    # Hems are as long as they were, but for what a longer edge cuts off a round one.
    new, old = boundary_loops(triangles), boundary_loops(mesh.triangles)
    girths = [
        sorted(np.linalg.norm(v[q] - v[np.roll(q, 1)], axis=1).sum() for q in loops)
        for v, loops in ((y, new), (mesh.vertices, old))
    ]
    assert len(new) == len(old) == 2
    assert girths[0] == pytest.approx(girths[1], rel=0.02)
    # A seam is a chain of edges from hem to hem, on the line where it was.
    for side in (0, around // 2):
        ends = x[side], x[side + around * (rows - 1)]
        on = np.linalg.norm(np.cross(y - ends[0], ends[1] - ends[0]), axis=1) < 1e-9
        along = np.sort(y[on, 2])
        assert along[0] == pytest.approx(ends[0][2])
        assert along[-1] == pytest.approx(ends[1][2])
        own = edges[on[edges].all(axis=1)]
        assert len(own) == on.sum() - 1
        assert np.abs(y[own[:, 0], 2] - y[own[:, 1], 2]).sum() == pytest.approx(np.ptp(along))


@CHECKED
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 10.0))
def test_sections_of_a_cylinder_and_their_outline(seed, radius):
    rng = np.random.default_rng(seed)
    centre = rng.uniform(-1.0, 1.0, 2) * radius
    angle = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    ring = centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    heights = (-radius, radius)
    x = np.concatenate([np.column_stack([ring, np.full(200, z)]) for z in heights])
    i = np.arange(200)
    j = (i + 1) % 200
    triangles = np.concatenate([np.stack([i, j, j + 200], 1), np.stack([i, j + 200, i + 200], 1)])
    levels = np.linspace(-0.9, 0.9, 5) * radius
    share = np.ones(len(x))
    profile = sections(x, triangles.astype(np.int32), share, np.eye(4), levels)
    assert np.allclose(profile.support, NORMALS @ centre + radius, rtol=0, atol=3e-4 * radius)
    assert np.allclose(profile.girth, 2.0 * np.pi * radius, rtol=1e-3)
    assert not len(sections(x, triangles, 0 * share, np.eye(4), levels).filled().offset)
    corners = outline(profile.support[2])
    # The polygon contains the section, and is no larger than its tangents allow.
    assert ((ring @ NORMALS.T).max(axis=0) <= (corners @ NORMALS.T).max(axis=0) + 1e-12).all()
    assert np.linalg.norm(corners - centre, axis=1).max() < 1.002 * radius


@CHECKED
@given(st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=6, unique=True), st.floats(-9.0, 9.0))
def test_profile_interpolation(offsets, where):
    offsets = np.sort(offsets)
    support = np.outer(2.0 * offsets + 1.0, np.ones(len(NORMALS)))
    at = Profile(offset=offsets, support=support).at(np.array([where]))[0]
    assert np.allclose(at, 2.0 * np.clip(where, offsets[0], offsets[-1]) + 1.0)


class Counted:
    """A matrix that counts its products."""

    def __init__(self, matrix):
        self.matrix, self.products = matrix, 0

    def __matmul__(self, other):
        self.products += 1
        return self.matrix @ other


@CHECKED
@given(st.integers(2, 9), st.integers(2, 9), st.integers(1, 400), st.integers(0, 2**32 - 1))
def test_smoothing_is_that_of_many_rounds(cloth, rows, columns, rounds, seed):
    triangles = cloth.grid(rows, columns)[1]
    neighbours = adjacency(triangles, rows * columns)
    values = np.random.default_rng(seed).random((rows * columns, 3))
    expected = values.copy()
    degree = neighbours.sum(axis=1).reshape(-1, 1)
    for _ in range(rounds):
        expected = 0.5 * (expected + np.asarray(neighbours @ expected / degree))
    np.testing.assert_allclose(smoothed(neighbours, values, rounds), expected, atol=1e-9)


def test_smoothing_takes_far_fewer_products_than_rounds(cloth, monkeypatch):
    """A finer mesh needs as many more rounds as it has vertices."""
    neighbours = adjacency(cloth.grid(4, 4)[1], 16)
    made = []

    def counted(matrix):
        made.append(Counted(matrix))
        return made[-1]

    monkeypatch.setattr("garment_sim_ros.garment.attachments.sp.csr_matrix", counted)
    smoothed(neighbours, np.ones((16, 1)), 10_000)
    assert made[0].products < 600
