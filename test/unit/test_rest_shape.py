"""Cloth that was cut flat: rest lengths, masses, threads and seams are those of its panels."""

import numpy as np
import pytest

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.topology import hinge_vertices, mesh_topology
from garment_sim_ros.params import Material
from garment_sim_ros.sim.elasticity import SEAM, edge_stiffness, hinges, warp_directions
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.rest_shape import edge_lengths, unfolded, upright

FABRIC = Material(stretch_stiffness_warp=900.0, stretch_stiffness_weft=300.0)


def sheet(n=6, spacing=0.02):
    u, v = np.meshgrid(np.arange(n) * spacing, np.arange(n) * spacing)
    flat = np.stack([u.ravel(), v.ravel()], axis=1)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    return flat, triangles


def crumpled(flat):
    z = 0.01 * np.sin(90.0 * flat[:, :1]) * np.cos(70.0 * flat[:, 1:])
    return np.concatenate([0.7 * flat, z], axis=1)


def test_a_sheet_given_crumpled_has_the_rest_shape_of_its_panel():
    flat, triangles = sheet()
    upright_sheet = np.concatenate([np.zeros((len(flat), 1)), flat], axis=1)
    as_cut = build_model("c", upright_sheet, triangles, FABRIC)
    given = build_model("c", crumpled(flat), triangles, FABRIC, flat=flat[triangles])
    for one, other in ((as_cut, given), (given, as_cut)):
        key = {
            tuple(sorted(one.vertex[p])): r
            for p, r in zip(one.springs.particles.reshape(-1, 2), one.springs.rest_length)
        }
        for p, r in zip(other.springs.particles.reshape(-1, 2), other.springs.rest_length):
            assert key[tuple(sorted(other.vertex[p]))] == pytest.approx(r, rel=1e-5)
    mass = {m.vertex[k]: m.mass[k] for m in (as_cut,) for k in range(len(m))}
    assert [mass[v] for v in given.vertex] == pytest.approx(given.mass.tolist())


def test_threads_lie_as_in_the_panel():
    flat, triangles = sheet()
    corners = upright(flat[triangles], len(triangles), "c")
    assert warp_directions(flat, triangles, corners) == pytest.approx(
        np.tile([0.0, 0.0, 1.0], (len(triangles), 1))
    )
    edges = mesh_topology(triangles).edges
    k = edge_stiffness(crumpled(flat), triangles, edges, FABRIC, corners)
    along = flat[edges[:, 0]] - flat[edges[:, 1]]
    warp, weft = k[along[:, 0] == 0.0], k[along[:, 1] == 0.0]
    assert warp.max() / weft.max() == pytest.approx(3.0, rel=0.2)


def test_an_eased_seam_has_the_mean_of_both_lengths_and_is_stiffer_to_bend():
    triangles = np.array([[0, 1, 2], [1, 0, 3]], np.int32)
    flat = np.array([[[0, 0], [1, 0], [0.5, 1]], [[5.2, 0], [4, 0], [4.6, 1]]], float)
    corners = upright(flat, 2, "c")
    edges = np.array([[0, 1]], np.int32)
    assert edge_lengths(corners, triangles, edges) == pytest.approx([1.1])
    x = np.array([[0, 0, 0], [0, 1, 0], [0, 0.5, 1], [0, 0.5, -1]], float)
    whole = hinges(x, triangles, FABRIC)
    sewn = hinges(x, triangles, FABRIC, corners)
    same = hinges(x, triangles, FABRIC, x[triangles])
    assert same.stiffness == pytest.approx(whole.stiffness)
    assert same.weight == pytest.approx(whole.weight)
    assert sewn.stiffness[0] > 0.8 * SEAM * whole.stiffness[0]


def test_unfolded_triangles_are_as_far_apart_as_in_the_plane():
    flat, triangles = sheet()
    corners = upright(flat[triangles], len(triangles), "c")
    h = hinge_vertices(triangles)
    expected = np.linalg.norm(flat[h[:, 2]] - flat[h[:, 3]], axis=1)
    assert unfolded(corners, triangles, h) == pytest.approx(expected)


@pytest.mark.parametrize("flat", [np.zeros((3, 3, 2)), np.full((50, 3, 2), np.nan)])
def test_flat_corners_that_cannot_be_are_refused(flat):
    x, triangles = sheet()
    with pytest.raises(GeometryError, match=r"garment 'c'.*flat"):
        build_model("c", crumpled(x), triangles, FABRIC, flat=flat)
