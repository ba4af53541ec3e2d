"""Garments on real bodies: made to fit, and settled on them without spikes."""

from functools import cache

import numpy as np
import pytest

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.colliders.capsules.capsules import fit_capsules
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.carrying_over import carried_over
from garment_sim_ros.garment.evening import evened, is_uneven
from garment_sim_ros.garment.generators import long_skirt, short_skirt, tshirt
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import load_garment_mesh
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.sizing import Sizes
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import boundary_loops, mesh_topology, non_manifold_edges
from garment_sim_ros.sim.simulation import Simulation

PEOPLE = {
    "woman": ("bodies", "mh_female_young.glb"),
    "stylised man": ("bodies", "CesiumMan.glb"),
    "androgynous": ("bodies", "makehuman", "base.obj"),
}
STICK_FIGURE = ("urdf", "human_1m65.urdf")


@cache
def loaded(path):
    return load_body(path)


def settled(body, garments, colliders):
    """World positions of the garments at rest on the body's rest pose."""
    positions = []
    for garment in garments:
        simulation = Simulation([garment], colliders)
        simulation.reset(ColliderPoser(colliders, body).poses(rest_transforms(body.rig)))
        positions.append(simulation.positions(garment.name).astype(np.float64))
    return positions


def strain(garment, x):
    edges = mesh_topology(garment.triangles).edges
    rest = np.linalg.norm(np.subtract(*garment.vertices[edges.T]), axis=1)
    return np.linalg.norm(np.subtract(*x[edges.T]), axis=1) / rest - 1.0


def skin_of(body):
    x = skin_vertices(body.skin, rest_transforms(body.rig))
    return MeshDistance(x, body.skin.triangles)


@pytest.mark.parametrize("person", PEOPLE)
@pytest.mark.parametrize(
    ("make", "vertices", "triangles", "openings"),
    [(short_skirt, 1687, 3264, 2), (long_skirt, 2235, 4338, 2), (tshirt, 1503, 2908, 4)],
)
def test_made_to_measure(data_file, person, make, vertices, triangles, openings):
    body = loaded(data_file(*PEOPLE[person]))
    garment = make(body)
    assert len(garment.vertices) == vertices
    assert len(garment.triangles) == pytest.approx(triangles, rel=0.011)
    assert len(boundary_loops(garment.triangles)) == openings
    assert not len(non_manifold_edges(garment.triangles))
    assert skin_of(body).signed_distance(garment.vertices)[0].min() > 0.001
    edges = mesh_topology(garment.triangles).edges
    length = np.linalg.norm(np.subtract(*garment.vertices[edges.T]), axis=1)
    assert 0.012 < np.median(length) < 0.03
    assert length.max() < 2.0 * np.median(length)


@pytest.mark.parametrize("person", PEOPLE)
def test_settles_without_spikes(data_file, person):
    body = loaded(data_file(*PEOPLE[person]))
    colliders = fit_capsules(body)
    garments = load_outfit("tshirt_short_skirt", body, colliders=colliders).garments
    skin = skin_of(body)
    for garment, x in zip(garments, settled(body, garments, colliders)):
        assert np.isfinite(x).all()
        stretch = strain(garment, x)
        assert stretch.max() < 0.6
        assert np.quantile(stretch, 0.95) < 0.15
        gap = skin.signed_distance(x)[0]
        assert np.quantile(gap, 0.01) > -0.002
        assert np.median(gap) < 0.04
        # It hangs where it was put, some lower.
        assert np.median(np.linalg.norm(x - garment.vertices, axis=1)) < 0.05
        assert x[:, 2].max() > garment.vertices[:, 2].max() - 0.04


def test_stick_figure(data_file):
    """Thin cylinders, arms hanging: made with raised arms, then worn on lowered ones."""
    body = loaded(data_file(*STICK_FIGURE))
    colliders = fit_capsules(body)
    garments = load_outfit("tshirt_short_skirt", body, colliders=colliders).garments
    assert [len(g.vertices) for g in garments] == [1687, 1503]
    shirt = garments[1]
    cuffs = sorted(boundary_loops(shirt.triangles), key=lambda c: abs(shirt.vertices[c, 1].mean()))
    elbow = abs(Measures(body).joint("leftLowerArm")[1])
    assert abs(shirt.vertices[cuffs[-1], 1]).mean() > elbow + 0.08
    positions = settled(body, garments, colliders)
    for garment, x in zip(garments, positions):
        assert np.quantile(strain(garment, x), 0.95) < 0.3
        assert x[:, 2].max() > garment.vertices[:, 2].max() - 0.12
    # The sleeves hang beside the trunk again.
    assert abs(positions[1][cuffs[-1], 1]).mean() < elbow + 0.09


@pytest.mark.parametrize(
    ("file", "loops", "edges"),
    [
        ("tshirt_female.obj", 4, 96),
        ("trousers_female.obj", 3, 62),
        ("skirt_long_female.obj", 2, 72),
    ],
)
def test_real_meshes_load_and_refine(data_file, file, loops, edges):
    path = data_file("garments", file)
    plain = load_garment_mesh(path)
    assert not plain.notes
    found = boundary_loops(plain.triangles)
    assert (len(found), sum(map(len, found))) == (loops, edges)
    fine = load_garment_mesh(path, edge_length=0.022)
    assert len(boundary_loops(fine.triangles)) == loops
    assert np.array_equal(fine.vertices[: len(plain.vertices)], plain.vertices)
    e = mesh_topology(fine.triangles).edges
    assert np.linalg.norm(np.subtract(*fine.vertices[e.T]), axis=1).max() < 0.0294


@pytest.mark.parametrize(
    ("file", "away"),
    [
        ("tshirt_female.obj", 0.009),  # creases narrower than an edge
        ("trousers_female.obj", 0.004),
        ("skirt_long_female.obj", 0.003),
        ("skirt_short_female.obj", 0.003),
    ],
)
def test_a_remeshed_garment_has_its_hems_and_its_shape(data_file, file, away):
    mesh = load_garment_mesh(data_file("garments", file))
    even = evened(mesh, Sizes.even(0.022))
    girths = []
    for made in (mesh, even):
        x, loops = made.vertices, boundary_loops(made.triangles)
        girths.append(sorted(np.linalg.norm(x[v] - x[np.roll(v, 1)], axis=1).sum() for v in loops))
    assert girths[1] == pytest.approx(girths[0], rel=0.03)
    back = MeshDistance(even.vertices, even.triangles).signed_distance(mesh.vertices)[0]
    assert np.percentile(np.abs(back), 99.0) < away
    x = even.vertices[even.triangles]
    sides = [x[:, k - 1] - x[:, k] for k in range(3)]
    cosine = [
        -np.einsum("ti,ti->t", a, b) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
        for a, b in ((sides[0], sides[1]), (sides[1], sides[2]), (sides[2], sides[0]))
    ]
    narrowest = np.degrees(np.arccos(np.max(cosine, axis=0)))
    assert narrowest.min() > 20.0
    assert np.percentile(narrowest, 1.0) > 35.0


@pytest.mark.parametrize("rest", ["relaxed", "given"])
def test_rest_lengths_of_a_mesh_are_those_of_its_file_where_that_is_asked(
    data_file, tmp_path, rest
):
    """A skirt carried over to a smaller body is slack there, or as it was cut."""
    path = data_file("garments", "skirt_short_female.obj")
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(
        f"version: 1\ngarments:\n  - name: worn\n    mesh: {path}\n"
        f"    options: {{remesh: never, edge_length: 1, rest: {rest}, "
        f"made_on: {data_file('bodies', 'mh_female_young.glb')}}}\n"
    )
    mannequin = load_body("mannequin:height=1.45,build=0")
    (garment,) = load_outfit(outfit, mannequin).garments
    edges = mesh_topology(garment.triangles).edges
    given = load_garment_mesh(path).vertices
    model = Simulation((garment,), fit_capsules(mannequin)).model("worn")
    springs = model.springs
    pairs = model.vertex[springs.particles.reshape(-1, 2)[springs.bending :]]
    x = given if rest == "given" else garment.vertices
    wanted = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    assert springs.rest_length[springs.bending :] == pytest.approx(wanted, rel=1e-5)
    there = [np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1).sum() for v in (given, x)]
    assert (there[1] < 0.95 * there[0]) == (rest == "relaxed")


@pytest.mark.parametrize("file", ["tshirt_female.obj", "trousers_female.obj"])
def test_uneven_meshes_are_meshed_anew_on_the_same_surface(data_file, tmp_path, file):
    path = data_file("garments", file)
    plain = load_garment_mesh(path)
    assert is_uneven(plain)
    even = evened(plain, Sizes.even(0.022))
    fine = load_garment_mesh(path, edge_length=0.022)
    assert not is_uneven(even)
    length = np.linalg.norm(
        np.subtract(*even.vertices[mesh_topology(even.triangles).edges.T]), axis=1
    )
    assert length.min() > 0.4 * np.median(length)
    assert np.median(length) == pytest.approx(0.022, rel=0.1)
    assert len(boundary_loops(even.triangles)) == len(boundary_loops(fine.triangles))
    away = MeshDistance(fine.vertices, fine.triangles).signed_distance(even.vertices)[0]
    assert np.abs(away).max() < 1e-6
    back = MeshDistance(even.vertices, even.triangles).signed_distance(fine.vertices)[0]
    assert np.percentile(np.abs(back), 99.0) < 0.008  # corners of the neckline are cut
    assert "meshed anew: edges of" in even.notes[-1]
    # An outfit does so unless it is told not to, or names vertices.
    body = loaded(data_file("bodies", "mh_female_young.glb"))
    counts = []
    for more in ("", "options: {remesh: never}", "max_distance: [{distance: 1, vertices: [0]}]"):
        outfit = tmp_path / "outfit.yaml"
        outfit.write_text(f"version: 1\ngarments:\n  - name: worn\n    mesh: {path}\n    {more}\n")
        counts.append(len(load_outfit(outfit, body).garments[0].vertices))
    assert counts == [len(even.vertices), len(fine.vertices), len(fine.vertices)]


@pytest.mark.parametrize("file", ["tshirt_female.obj", "trousers_female.obj"])
def test_a_mesh_made_on_another_body_is_carried_over(data_file, tmp_path, file):
    path = data_file("garments", file)
    made_on = data_file("bodies", "mh_female_young.glb")
    mesh = load_garment_mesh(path)
    woman, man = loaded(made_on), loaded(data_file("bodies", "CesiumMan.glb"))
    assert carried_over(mesh, woman, woman) is mesh
    measures = Measures(man)
    skin = MeshDistance(measures.vertices, man.skin.triangles)
    assert skin.signed_distance(mesh.vertices)[0].min() < -0.05
    worn = carried_over(mesh, woman, man)
    gap = skin.signed_distance(worn.vertices)[0]
    assert gap.min() > 0.0
    assert np.median(gap) < 0.03
    # Ends of sleeves and legs are around the limbs that they are worn on.
    for loop in boundary_loops(worn.triangles):
        assert skin.is_inside(worn.vertices[loop].mean(axis=0)[None]).all()
    # The same through an outfit file, which names the body from its own folder.
    (tmp_path / "woman.glb").write_bytes(made_on.read_bytes())
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(
        f"version: 1\ngarments:\n  - name: worn\n    mesh: {path}\n"
        "    options: {made_on: woman.glb, remesh: never, edge_length: 1}\n"
    )
    made = load_outfit(outfit, man)
    assert "carried over" in " ".join(made.notes)
    np.testing.assert_allclose(made.garments[0].vertices, worn.vertices, atol=5e-3)


@pytest.mark.parametrize("body", ["CesiumMan.glb", "mannequin"])
@pytest.mark.parametrize("name", ["tshirt", "skirt_short", "skirt_long", "trousers"])
def test_a_mesh_keeps_its_shape_on_another_body(data_file, name, body):
    """Bodies whose rigs put pelvis and spine elsewhere: no part is stretched out of shape."""
    woman = loaded(data_file("bodies", "mh_female_young.glb"))
    other = loaded(body if body == "mannequin" else data_file("bodies", body))
    mesh = load_garment_mesh(data_file("garments", f"{name}_female.obj"))
    worn = carried_over(mesh, woman, other)
    here, there = Measures(woman), Measures(other)
    # As high on the body, between crotch and shoulders.
    for end in (np.min, np.max):
        was, now = (
            (end(x[:, 2]) - m.crotch) / (m.shoulders - m.crotch)
            for x, m in ((mesh.vertices, here), (worn.vertices, there))
        )
        assert abs(was - now) < 0.1
    # Edges change as the bodies' sizes do: by 0.8 to 1.1 times, and some more where arms begin.
    ends = mesh.triangles[:, [0, 1, 2]], mesh.triangles[:, [1, 2, 0]]
    long, was = (
        np.linalg.norm(x[ends[0]] - x[ends[1]], axis=-1) for x in (worn.vertices, mesh.vertices)
    )
    low, middle, high = np.percentile(long / was, [1.0, 50.0, 99.0])
    assert 0.8 < middle < 1.15
    assert low > 0.4 * middle
    assert high < 2.0 * middle
    # Around the body, not between its legs: skin below the waist is under cloth.
    if name != "tshirt":
        cloth = MeshDistance(worn.vertices, worn.triangles)
        z = there.vertices[:, 2]
        seat = (z > there.crotch + 0.01) & (z < worn.vertices[:, 2].max() - 0.1)
        seat &= there.trunk_share > 0.9
        assert seat.sum() > 10
        # What is behind the cloth looks at the inside of its nearest triangle.
        assert (cloth.signed_distance(there.vertices[seat])[0] > 0.0).mean() < 0.01


def test_faults_of_a_real_mesh_are_named(data_file):
    mesh = load_garment_mesh(
        data_file("garments", "source", "female_elegantsuit01.obj"), unit="dm"
    )
    notes = " ".join(mesh.notes)
    assert "triangles were turned to agree with their neighbours" in notes
    assert "2 separate parts" in notes


def test_real_garments_are_worn(data_file, tmp_path):
    body = loaded(data_file(*PEOPLE["woman"]))
    colliders = fit_capsules(body)
    names = ("skirt_short_female", "tshirt_female", "trousers_female")
    lines = [
        f"  - {{name: g{i}, mesh: {data_file('garments', n + '.obj')}}}"
        for i, n in enumerate(names)
    ]
    file = tmp_path / "outfit.yaml"
    file.write_text("version: 1\ngarments:\n" + "\n".join(lines))
    outfit = load_outfit(file, body, colliders=colliders)
    assert any("under the skin were put over it" in note for note in outfit.notes)
    waist = Measures(body).waist
    for garment, x in zip(outfit.garments, settled(body, outfit.garments, colliders)):
        assert 0 < len(garment.pins) < 0.06 * len(garment.vertices)
        height = garment.vertices[garment.pins, 2]
        if garment.name == "g1":
            assert height.min() > Measures(body).shoulders
        else:
            assert abs(height - waist).max() < 0.2
        assert np.quantile(strain(garment, x), 0.95) < 0.25
        assert skin_of(body).signed_distance(x)[0].min() > -0.01


def test_static_body_has_no_place_for_garments(data_file):
    body = loaded(data_file("bodies", "f_smpl_average_A40.obj"))
    with pytest.raises(GeometryError, match="no bone"):
        short_skirt(body)
