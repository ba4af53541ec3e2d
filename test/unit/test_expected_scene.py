"""The scene that is compiled before there is a body is the one that comes to be on it."""

import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.garment.outfit import make_outfit
from garment_sim_ros.garment.outfit_file import outfit_from, read_outfit
from garment_sim_ros.ros.compiler import expected_scene
from garment_sim_ros.sim.placement import GarmentLike
from garment_sim_ros.sim.warm_up import Scene, _sheet

SKIRT = {"name": "skirt", "generator": "short_skirt"}


@pytest.mark.parametrize(
    "file",
    [
        read_outfit("tshirt_short_skirt"),
        read_outfit("tshirt_long_skirt"),
        outfit_from({"version": 1, "garments": [SKIRT], "colliders": {"method": "capsules"}}),
        outfit_from({"version": 1, "garments": [SKIRT], "colliders": {"joints": "none"}}),
    ],
    ids=["short skirt", "long skirt", "capsules", "no joints"],
)
def test_nothing_is_left_to_compile_on_the_mannequin(file):
    body = load_body("mannequin")
    colliders = fit_colliders(body, file.colliders)
    outfit = make_outfit(file, body, colliders=colliders)
    assert Scene.of(colliders, outfit.garments) == expected_scene(file)


def test_scraps_that_are_compiled_with_have_all_that_garments_have():
    scrap = _sheet(3)
    names = [n for n, m in vars(GarmentLike).items() if isinstance(m, property)]
    assert [n for n in names if not hasattr(scrap, n)] == []
