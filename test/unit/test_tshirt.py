"""Shirts made around a body: their openings."""

from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.garment.generators import tshirt
from garment_sim_ros.garment.tshirt import _without_pinches, _without_pinholes
from garment_sim_ros.geometry.topology import (
    boundary_loops,
    mesh_topology,
    non_manifold_edges,
    pinched_vertices,
    vertex_normals,
)


def _without(garment, vertices):
    """The mesh of a garment without some vertices' triangles."""
    kept = ~np.isin(garment.triangles, vertices).any(axis=1)
    used, triangles = np.unique(garment.triangles[kept], return_inverse=True)
    return garment.vertices[used], triangles.reshape(-1, 3).astype(np.int32)


def test_a_shirt_has_no_pinholes_and_keeps_larger_holes():
    garment = tshirt(load_body("mannequin:vertices=2000"))
    x = np.asarray(garment.vertices)
    inner = np.argsort(np.linalg.norm(x - x.mean(axis=0) - [1.0, 0.0, 0.0], axis=1))[0]
    vertices, triangles = _without(garment, [inner])
    loops = boundary_loops(triangles)
    assert len(loops) == 5
    hole = vertices[loops[4]]
    around = np.linalg.norm(np.roll(hole, -1, axis=0) - hole, axis=1).sum()

    same, kept = _without_pinholes(vertices, triangles, 0.99 * around)
    assert same is vertices
    assert kept is triangles
    closed, faces = _without_pinholes(vertices, triangles, 1.01 * around)
    assert len(boundary_loops(faces)) == 4
    assert not len(non_manifold_edges(faces))
    assert closed[-1] == pytest.approx(hole.mean(axis=0))
    topology = mesh_topology(faces)
    assert topology.triangle_count.max() == 2
    # The new faces look where their neighbours do.
    normal = np.empty_like(closed)
    vertex_normals(closed, faces, normal)
    assert normal[-1] @ normal[loops[4]].mean(axis=0) > 0.9


def test_holes_that_touch_become_one():
    garment = tshirt(load_body("mannequin:vertices=2000"))
    x = np.asarray(garment.vertices)
    inner = int(np.argmin(np.linalg.norm(x - x.mean(axis=0) - [1.0, 0.0, 0.0], axis=1)))
    # Two of the triangles around a vertex that have no edge in common: a hole on either side.
    around = np.flatnonzero((garment.triangles == inner).any(axis=1))
    first = around[0]
    shares = [len(np.intersect1d(garment.triangles[first], garment.triangles[t])) for t in around]
    second = around[shares.index(1)]
    pinched = np.delete(garment.triangles, [first, second], axis=0)
    assert pinched_vertices(pinched).tolist() == [inner]

    vertices, triangles = _without_pinches(x, pinched)
    assert len(vertices) == len(x) - 1
    assert len(triangles) == len(garment.triangles) - len(around)
    loops = boundary_loops(triangles)
    assert len(loops) == 5
    assert len(loops[4]) == len(around)


@pytest.mark.parametrize(
    ("heights", "along", "across"),
    [
        ([1.38, 1.43, 1.50], [1.0, 1.0, 1.0], [1.0, 1.6, 1.0]),
        ([1.40, 1.44, 1.49], [1.0, 1.0, 1.0], [1.0, 1.8, 1.0]),
        ([1.42, 1.46, 1.50], [1.0, 1.0, 1.0], [1.0, 2.0, 1.0]),
        ([1.38, 1.44, 1.60], [1.0, 1.4, 1.4], [1.0, 1.4, 1.4]),
    ],
    ids=["thick", "thicker", "none", "child"],
)
def test_a_neckline_lies_at_the_base_of_any_neck(heights, along, across):
    body = load_body("mannequin:vertices=2000")
    x = np.array(body.skin.vertices)
    trunk = np.abs(x[:, 1]) < 0.16
    for axis, scale in ((0, along), (1, across)):
        x[trunk, axis] *= np.interp(x[trunk, 2], heights, scale)
    garment = tshirt(replace(body, skin=replace(body.skin, vertices=x)))
    loops = [garment.vertices[loop] for loop in boundary_loops(garment.triangles)]
    assert len(loops) == 4
    (neckline,) = (x for x in loops if x[:, 2].min() > 1.33 and abs(x[:, 1].mean()) < 0.05)
    chin = 1.49
    assert neckline[:, 2].max() < chin
    # It goes around the neck, not up it: as long as about a circle about it, or longer.
    length = np.linalg.norm(np.roll(neckline, -1, axis=0) - neckline, axis=1).sum()
    assert length > 0.9 * np.pi * np.ptp(neckline[:, 1])
