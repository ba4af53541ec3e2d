"""Measures of cloth against skin, on shapes where the answer is known."""

import dataclasses

import numpy as np
import pytest
import trimesh

from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh, crossed, rate
from garment_sim_ros.sim.model import build_model


@pytest.fixture
def body():
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.3)
    return np.asarray(mesh.vertices), mesh.faces.astype(np.int32)


def shell(radius):
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return np.asarray(mesh.vertices), mesh.faces.astype(np.int32)


def test_cloth_outside_has_a_gap_and_no_penetration(body):
    vertices, triangles = shell(0.31)
    meter = ClothMeter(*body, {"shirt": GarmentMesh.from_rest(vertices, triangles)})
    meter.add(body[0], {"shirt": vertices})
    result = meter.result()
    assert result["gap_mm_median"] == pytest.approx(10.0, abs=0.3)
    assert result["penetration_mm_max"] == 0.0
    assert result["strain_max"] == pytest.approx(0.0, abs=1e-6)
    assert result["finite"] is True


def test_chords_between_particles_count_as_penetration(body):
    # All particles are outside, the centres of the large triangles are not.
    ball = trimesh.creation.icosahedron()
    vertices, triangles = ball.vertices, ball.faces
    vertices = 0.301 * vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    meter = ClothMeter(*body, {"cap": GarmentMesh.from_rest(vertices, triangles.astype(np.int32))})
    meter.add(body[0], {"cap": vertices})
    depth = 0.3 - np.linalg.norm(vertices[triangles].mean(axis=1), axis=1).min()
    assert meter.result()["penetration_mm_max"] == pytest.approx(1e3 * depth, rel=0.02)
    assert meter.result()["gap_mm_median"] > 0.0


def test_strain_is_a_fraction_of_the_rest_length(body):
    vertices, triangles = shell(0.4)
    meter = ClothMeter(*body, {"shirt": GarmentMesh.from_rest(vertices, triangles)})
    meter.add(body[0], {"shirt": 1.1 * vertices})
    meter.add(body[0], {"shirt": 0.9 * vertices})
    assert meter.result()["strain_max"] == pytest.approx(0.1, abs=1e-5)
    assert meter.result()["strain_p95"] == pytest.approx(0.1, abs=1e-5)


def test_body_that_moves_is_measured_where_it_is(body):
    vertices, triangles = shell(0.31)
    meter = ClothMeter(*body, {"shirt": GarmentMesh.from_rest(vertices, triangles)})
    meter.add(body[0] + 5.0, {"shirt": vertices + 5.0})
    assert meter.result()["gap_mm_median"] == pytest.approx(10.0, abs=0.3)


def test_nan_is_reported_and_spoils_nothing_else(body):
    vertices, triangles = shell(0.31)
    broken = vertices.copy()
    broken[3] = np.nan
    meter = ClothMeter(*body, {"shirt": GarmentMesh.from_rest(vertices, triangles)})
    meter.add(body[0], {"shirt": vertices})
    meter.add(body[0], {"shirt": broken})
    assert meter.result()["finite"] is False
    assert np.isfinite(meter.result()["penetration_mm_max"])


def test_inside_is_the_share_of_the_area_that_is_deep_in_the_skin(body):
    # A sphere as cloth: above a plane through the ball it is outside, below it is 5 mm deep.
    fine = trimesh.creation.icosphere(subdivisions=5, radius=0.31)
    vertices, triangles = np.asarray(fine.vertices), fine.faces.astype(np.int32)
    sunk = vertices * np.where(vertices[:, 2:] < 0.31 * 0.8, 1.0, 0.295 / 0.31)
    mesh = GarmentMesh.from_rest(vertices, triangles)
    meter = ClothMeter(*body, {"shirt": mesh})
    meter.add(body[0], {"shirt": vertices})
    meter.add(body[0], {"shirt": sunk})
    meter.add(body[0], {"shirt": vertices})
    cap = (1.0 - 0.8) / 2.0
    assert meter.result()["inside_median"] == 0.0
    assert meter.result()["inside_p99"] == pytest.approx(0.98 * cap, rel=0.06)
    assert meter.result()["skin_shows_p99"] == pytest.approx(0.98 * cap, rel=0.1)
    # 1 mm deep is not inside, but skin shows through.
    meter = ClothMeter(*body, {"shirt": mesh})
    meter.add(body[0], {"shirt": vertices * 0.2995 / 0.31})
    assert meter.result()["inside_p99"] == 0.0
    assert meter.result()["skin_shows_p99"] > 0.9
    assert meter.result()["penetration_mm_max"] > 0.3


@pytest.mark.parametrize("cut", ["in its vertices", "elsewhere", "flat"])
def test_strain_is_of_the_lengths_at_rest(cloth, cut):
    """A sheet that is put on with four fifths of its width, and is at rest with all of it."""
    rest, triangles = cloth.grid(9, 7)
    drawn = rest * [1.0, 0.8, 1.0]
    garment = cloth.garment(rest if cut == "in its vertices" else drawn, triangles)
    if cut == "elsewhere":
        garment = dataclasses.replace(garment, rest=rest)
    elif cut == "flat":
        assert np.ptp(rest[:, 2]) == 0.0
        garment = dataclasses.replace(garment, flat=rest[triangles][:, :, :2])
    mesh = GarmentMesh.of(garment)
    assert mesh.strain(rest) == pytest.approx(0.0, abs=1e-12)
    along = np.ptp(rest[mesh.edges][:, :, 0], axis=1) == 0.0
    assert mesh.strain(drawn)[along] == pytest.approx(-0.2, abs=1e-12)
    assert mesh.rest_area.sum() == pytest.approx(np.ptp(rest[:, 0]) * np.ptp(rest[:, 1]))
    # As the solver has it.
    x = garment.vertices if garment.rest is None else garment.rest
    springs = build_model("c", x, triangles, garment.material, flat=garment.flat).springs
    of_solver = springs.rest_length[springs.bending :]
    assert np.sort(mesh.rest_length) == pytest.approx(np.sort(of_solver), rel=1e-6)


def test_a_garment_that_shows_through_another_is_crossed(body):
    vertices, triangles = shell(0.31)
    larger = shell(0.32)
    meshes = {
        "shirt": GarmentMesh.from_rest(vertices, triangles),
        "coat": GarmentMesh.from_rest(*larger),
    }
    meter = ClothMeter(*body, meshes)
    meter.add(body[0], {"shirt": vertices, "coat": larger[0]})
    assert meter.result()["crossed_p99"] == 0.0
    through = larger[0].copy()
    through[5] *= 0.9  # one corner of the coat is under the shirt
    meter.add(body[0], {"shirt": vertices, "coat": through})
    edges = int((meshes["coat"].edges == 5).any(axis=1).sum())
    expected = edges / len(meshes["coat"].edges)
    assert meter.result()["crossed_p99"] == pytest.approx(expected, rel=0.1)


def every_edge_through_every_triangle(x, edges, y, triangles):
    """Share of the edges for which some triangle separates the ends and is met between them."""
    through = 0
    for start, end in x[edges]:
        a, b, c = y[triangles].transpose(1, 0, 2)
        way = end - start
        normal = np.cross(b - a, c - a)
        s = ((a - start) * normal).sum(axis=1) / (way * normal).sum(axis=1)
        at = start + s[:, None] * way
        inside = [
            (np.cross(v - u, at - u) * normal).sum(axis=1) >= 0.0
            for u, v in ((a, b), (b, c), (c, a))
        ]
        through += bool(((s >= 0.0) & (s <= 1.0) & np.all(inside, axis=0)).any())
    return through / len(edges)


@pytest.mark.parametrize("shift", [0.0, 0.12, 0.9])
def test_crossed_is_that_of_every_edge_with_every_triangle(shift):
    """However far garments are apart, and where one edge runs through many triangles."""
    rng = np.random.default_rng(7)
    shirt = trimesh.creation.cylinder(0.2, 0.6, sections=19).subdivide()
    skirt = trimesh.creation.cylinder(0.21, 0.5, sections=23).subdivide()
    spike = np.array([[-2.0, 0.013, 0.021], [2.0, 0.017, -0.03], [0.0, 0.02, 9.0]])
    meshes = [shirt, skirt, trimesh.Trimesh(spike, [[0, 1, 2]])]
    places = [rng.normal(scale=0.004, size=np.shape(m.vertices)) + m.vertices for m in meshes]
    places[1][:, 2] += shift
    made = [GarmentMesh.from_rest(x, np.asarray(m.faces)) for x, m in zip(places, meshes)]
    for i, k in ((0, 1), (1, 0), (2, 0), (2, 1), (0, 2)):
        found = crossed(made[i], places[i], made[k], places[k])
        expected = every_edge_through_every_triangle(
            places[i], made[i].edges, places[k], made[k].triangles
        )
        assert found == pytest.approx(expected)
    assert (crossed(made[0], places[0], made[1], places[1]) > 0.0) == (shift < 0.6)


def test_nothing_measured_gives_none(body):
    assert ClothMeter(*body, {}).result()["penetration_mm_max"] is None


def test_rate_counts_intervals():
    assert rate(np.arange(61) / 60.0) == pytest.approx(60.0)
    assert rate(np.array([1.0])) == 0.0
