"""Shirts made around a body: their openings."""

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.garment.generators import tshirt
from garment_sim_ros.garment.tshirt import _without_pinholes
from garment_sim_ros.geometry.topology import (
    boundary_loops,
    mesh_topology,
    non_manifold_edges,
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
