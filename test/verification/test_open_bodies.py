"""Garments on bodies that are open where a game leaves out what is not seen."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.garment.generators import GENERATORS
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.geometry.topology import boundary_loops

SIDES = ("left", "right")
EXTREMITIES = ("neck", "head", *(f"{s}{part}" for s in SIDES for part in ("Hand", "Foot")))


def without(body, bones):
    """The body without the skin that follows some bones."""
    gone = Measures(body).share(*bones) > 0.5
    used, triangles = np.unique(
        body.skin.triangles[~gone[body.skin.triangles].any(axis=1)], return_inverse=True
    )
    skin = dataclasses.replace(
        body.skin,
        vertices=body.skin.vertices[used],
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        bone=body.skin.bone[used],
        weight=body.skin.weight[used],
    )
    return dataclasses.replace(body, skin=skin)


@pytest.mark.parametrize("file", ["mannequin", "mh_female_young.glb", "CesiumMan.glb"])
def test_a_shirt_on_a_body_without_head_hands_and_feet(data_file, file):
    body = load_body(file if file == "mannequin" else data_file("bodies", file))
    body = without(body, EXTREMITIES)
    assert len(boundary_loops(body.skin.triangles)) == 5
    generator = GENERATORS["tshirt"]
    mesh, _ = generator.make(Measures(body), generator.options())
    assert len(boundary_loops(mesh.triangles)) == 4
