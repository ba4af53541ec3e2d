"""Elastic bands: what they pull with, and what they hold."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.avatar import Avatar
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.geometry.topology import boundary_loops, mesh_topology
from garment_sim_ros.sim.elastic import ElasticEdges, with_bands
from garment_sim_ros.sim.elasticity import edge_stiffness
from garment_sim_ros.sim.simulation import Simulation

EDGES = np.array([[0, 1], [1, 2], [2, 0]], np.int32)


def test_two_springs_side_by_side_are_one():
    stiffness, length = np.array([40.0, 40.0, 40.0]), np.array([0.02, 0.03, 0.02])
    there = np.array([[2, 1], [0, 9]], np.int32)
    bands = ElasticEdges(there, np.array([3.0, 1.0]), np.full(2, 0.8))
    total, drawn = with_bands(bands, EDGES, stiffness, length)
    # At the length that it was cut to, the cloth pulls not at all and the band with its tension.
    assert total * (length - drawn) == pytest.approx([0.0, 3.0, 0.0])
    # Where the band is slack only the cloth pushes.
    assert total[1] * (0.8 * 0.03 - drawn[1]) == pytest.approx(40.0 * (0.8 - 1.0) * 0.03)
    same = with_bands(ElasticEdges.none(), EDGES, stiffness, length)
    assert same[0] is stiffness
    assert same[1] is length


def lengths(x):
    return np.linalg.norm(x[EDGES[:, 0]] - x[EDGES[:, 1]], axis=1)


@pytest.mark.parametrize("solver", ["xpbd", "implicit", "relaxation"])
def test_an_edge_comes_to_rest_where_cloth_and_band_are_in_balance(cloth, solver):
    x = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.05, 0.08, 0.0]])
    triangles = np.array([[0, 1, 2]], np.int32)
    plain = cloth.garment(x, triangles, damping=5.0)
    bands = ElasticEdges(EDGES[:1], np.array([2.0]), np.array([0.8]))
    still = ColliderPoses.identity(1)
    found = []
    for garment in (plain, dataclasses.replace(plain, elastic=bands)):
        simulation = Simulation(
            (garment,), cloth.colliders(), solver=solver, gravity=(0.0, 0.0, 0.0)
        )
        simulation.reset(still, settle=False)
        for _ in range(120):
            simulation.advance(still, still, 1 / 60)
        found.append(lengths(np.asarray(simulation.positions("cloth"), float)))
    edges = mesh_topology(triangles).edges
    k = float(edge_stiffness(x, triangles, edges, plain.material)[0])
    band = 2.0 / (0.2 * 0.1)
    assert edges[0].tolist() == [0, 1]
    assert found[0] == pytest.approx(lengths(x), rel=1e-3)
    assert found[1][0] == pytest.approx((k * 0.1 + band * 0.08) / (k + band), rel=2e-3)
    assert found[1][1:] == pytest.approx(found[0][1:], rel=2e-3)


def test_a_cuff_of_elastic_is_narrower(tmp_path):
    """A band of some newtons draws a wide hem in until it is slack, other edges stay."""
    avatar = Avatar.load("mannequin:vertices=1500")
    narrow = {}
    for more in ("", "    elastic: [{rule: hem, tension: 20, slack: 0.6, name: gathered}]\n"):
        path = tmp_path / "skirt.yaml"
        path.write_text(
            "version: 1\ngarments:\n  - name: skirt\n    generator: short_skirt\n"
            "    options: {vertices: 500}\n    material: {preset: polyester}\n" + more
        )
        outfit = avatar.dress(path)
        simulation = Simulation(outfit, avatar.colliders)
        for _ in range(60):
            simulation.step(avatar.poses(), dt=1 / 60)
        (garment,) = outfit.garments
        y = np.asarray(simulation["skirt"].positions, float)
        waist, hem = sorted(
            boundary_loops(garment.triangles), key=lambda loop: -garment.vertices[loop, 2].mean()
        )
        girth = [np.linalg.norm(y[v] - y[np.roll(v, -1)], axis=1).sum() for v in (waist, hem)]
        narrow[bool(more)] = girth
        assert list(garment.marks) == (["waist", "gathered"] if more else ["waist"])
        assert simulation["skirt"].health.resets == 0
    assert narrow[True][1] < 0.92 * narrow[False][1]
    assert narrow[True][0] == pytest.approx(narrow[False][0], rel=0.02)
