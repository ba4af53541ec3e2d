"""Garments over garments at rest: the order they lie in, and room for both."""

import numpy as np
import pytest
import trimesh

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.contact.crossings import find_hits
from garment_sim_ros.garment.outfit import make_outfit
from garment_sim_ros.garment.outfit_file import outfit_from
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import mesh_topology

WIDE, NARROW = {"flare": 0.4, "length": 0.4}, {"flare": 0.1, "length": 0.5}


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin")


@pytest.fixture(scope="module")
def colliders(body):
    return fit_colliders(body)


def skirt(name, options, **more):
    return {"name": name, "generator": "short_skirt", "options": options, **more}


def worn(body, colliders, *garments):
    return make_outfit(
        outfit_from({"version": 1, "garments": list(garments)}), body, colliders=colliders
    )


def crossings(mine, other):
    """Edges of one garment that run through the other."""
    ends = mine.vertices[mesh_topology(mine.triangles).edges]
    found = np.empty(len(ends), np.int32), np.empty(len(ends))
    return find_hits(ends, other.vertices, other.triangles, *found)


def layers(outfit):
    return {g.name: g.layer for g in outfit.garments}


def test_layers_are_those_that_garments_lie_in(body, colliders):
    for garments in (
        (skirt("wide", WIDE), skirt("narrow", NARROW)),
        (skirt("narrow", NARROW), skirt("wide", WIDE)),
    ):
        outfit = worn(body, colliders, *garments)
        assert layers(outfit) == {"narrow": 0, "wide": 1}
        assert [g.name for g in outfit.garments] == [g["name"] for g in garments]
        (note,) = [n for n in outfit.notes if n.startswith("layers")]
        assert "narrow 0" in note
        assert "wide 1" in note


def test_garments_apart_are_in_one_layer(body, tmp_path):
    """Two bands, 20 cm apart, about the trunk."""
    (whole,) = worn(body, None, skirt("skirt", NARROW)).garments
    top = whole.vertices[:, 2].max()
    names = []
    for name, low, high in (("upper", top - 0.1, top + 1.0), ("lower", top - 0.5, top - 0.3)):
        z = whole.vertices[whole.triangles][..., 2]
        band = whole.triangles[((low < z) & (z < high)).all(axis=1)]
        mesh = trimesh.Trimesh(whole.vertices, band, process=False)
        mesh.remove_unreferenced_vertices()
        mesh.export(tmp_path / f"{name}.ply")
        names.append({"name": name, "mesh": str(tmp_path / f"{name}.ply"), "options": {"up": "z"}})
    outfit = worn(body, None, *names)
    assert layers(outfit) == {"upper": 0, "lower": 0}
    assert not any(n.startswith("layers") for n in outfit.notes)


def test_the_file_has_the_last_word(body, colliders):
    outfit = worn(body, colliders, skirt("wide", WIDE, layer=0), skirt("narrow", NARROW))
    assert layers(outfit) == {"wide": 0, "narrow": 0}


@pytest.mark.parametrize("over_colliders", [False, True])
def test_what_is_cut_wider_is_let_in_under_the_other(body, colliders, over_colliders):
    met = colliders if over_colliders else None
    garments = (skirt("wide", WIDE, layer=1), skirt("narrow", NARROW, layer=2))
    outfit = worn(body, met, *garments)
    inner, outer = outfit.garments
    apart = worn(body, met, *(g | {"layer": 0} for g in garments)).garments
    assert np.linalg.norm(apart[0].vertices - inner.vertices, axis=1).max() > 0.05
    # Its hem stood far out of the other one; now it is inside, and both are off the skin.
    assert crossings(inner, outer) == crossings(outer, inner) == 0
    height, _, _ = MeshDistance(outer.vertices, outer.triangles).signed_distance(inner.vertices)
    below_the_waist = inner.vertices[:, 2] < outer.vertices[:, 2].max() - 0.02
    assert height[below_the_waist].max() < 0.0
    skin = MeshDistance(body.skin.vertices, body.skin.triangles)
    for garment in outfit.garments:
        assert skin.signed_distance(garment.vertices)[0].min() > 0.0
    assert any(n.startswith("wide: was let in under narrow by up to") for n in outfit.notes)


def test_garments_in_their_places_stay_as_they_are(body, colliders):
    garments = (skirt("narrow", NARROW, layer=0), skirt("wide", WIDE, layer=1))
    together = worn(body, colliders, *garments)
    for garment in garments:
        (alone,) = worn(body, colliders, garment).garments
        (same,) = [g for g in together.garments if g.name == garment["name"]]
        gap = np.linalg.norm(alone.vertices - same.vertices, axis=1)
        assert np.median(gap) < 1e-4  # at the waist both lie on the skin, and need room there
        assert gap.max() < 0.003


@pytest.fixture(scope="module", params=["mh_female_young.glb", "CesiumMan.glb"])
def wearer(request, data_file):
    body = load_body(data_file("bodies", request.param))
    return body, fit_colliders(body)


@pytest.mark.parametrize("tucked", [False, True])
def test_a_shirt_and_a_skirt_of_meshes(data_file, wearer, tucked):
    """Modelled with the shirt over the skirt, some centimetres off it."""
    body, colliders = wearer
    made_on = {"made_on": str(data_file("bodies", "mh_female_young.glb"))}
    garments = [
        {"name": n, "mesh": str(data_file("garments", file)), "options": made_on}
        | ({"layer": layer} if tucked else {})
        for layer, (n, file) in enumerate(
            (("shirt", "tshirt_female.obj"), ("skirt", "skirt_short_female.obj"))
        )
    ]
    outfit = worn(body, colliders, *garments)
    shirt, skirt = outfit.garments
    assert (shirt.layer, skirt.layer) == ((0, 1) if tucked else (1, 0))
    edges = len(mesh_topology(skirt.triangles).edges)
    assert crossings(skirt, shirt) + crossings(shirt, skirt) < (0.05 if tucked else 0.01) * edges
