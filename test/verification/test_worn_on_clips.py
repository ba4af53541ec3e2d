"""Garments stay worn on real bodies through real clips: the measures of `docs/worn.md`."""

import pytest

MANNEQUIN, YOUNG, CESIUM = "mannequin:height=1.75", "mh_female_young.glb", "CesiumMan.glb"
SHORT, LONG = "tshirt_short_skirt", "tshirt_long_skirt"
SHIRT_AND_SKIRT = "tshirt_female.obj+skirt_short_female.obj"
TROUSERS = "trousers_female.obj"


@pytest.fixture
def figures(bench, data_file):
    """What `bench/worn.py` says of one run with the defaults."""
    worn = bench("worn")

    def figures(body, outfit, clip, *, seconds, variant="plain"):
        made_on = [YOUNG] if ".obj" in outfit else []
        for word in (body, clip, *outfit.split("+"), *made_on):
            folder = {".glb": "bodies", ".bvh": "mocap", ".obj": "garments"}.get(word[-4:])
            if folder:
                data_file(folder, word)
        asked = (body, outfit, clip, variant, "xpbd", "balanced", (), seconds, "")
        return worn.run(worn.Asked(*asked))

    return figures


def test_a_cartwheel_in_a_shirt_and_a_skirt(figures):
    """Its first 1.5 s, upside down and back."""
    f = figures(MANNEQUIN, SHORT, "deepmimic_cartwheel.bvh", seconds=1.5)
    assert f["pierced"] == 0.0
    assert f["inside_p99"] < 0.005
    assert f["inside_median"] < 0.0005
    assert f["strain_max"] < 1.2
    assert f["finite"]
    assert f["resets"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["plain", "2x", "15hz", "stalls"])
@pytest.mark.parametrize(
    ("body", "outfit", "clip"),
    [
        (MANNEQUIN, SHORT, "deepmimic_spinkick.bvh"),
        (MANNEQUIN, LONG, "cmu_14_14_jumping_jacks_30fps.bvh"),
        (YOUNG, SHORT, "rokoko_jesse_dance.bvh"),
        (YOUNG, LONG, "deepmimic_run.bvh"),
    ],
)
def test_nothing_is_pierced_in_calm_frames(figures, body, outfit, clip, variant):
    """Frames from half a second after a stall on; without one, all. One of 240 may be chance."""
    f = figures(body, outfit, clip, seconds=4.0, variant=variant)
    assert f["finite"]
    assert f["pierced_calm"] < 1.5 / f["frames"]
    assert f["strain_max"] < 1.2 or variant != "plain"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "outfit", "clip", "inside"),
    [
        (YOUNG, SHIRT_AND_SKIRT, "deepmimic_run.bvh", 0.01),
        (YOUNG, TROUSERS, "deepmimic_jump.bvh", 0.005),
        (MANNEQUIN, TROUSERS, "deepmimic_walk.bvh", 0.005),
        (CESIUM, SHORT, "deepmimic_jump.bvh", 0.03),
        (CESIUM, TROUSERS, "deepmimic_walk.bvh", 0.005),
    ],
)
def test_real_meshes_and_a_rig_that_pulls_skin_away(figures, body, outfit, clip, inside):
    f = figures(body, outfit, clip, seconds=3.0)
    assert f["finite"]
    assert f["pierced"] < 1.5 / f["frames"]
    assert f["inside_once_p99"] < inside
    assert f["strain_max"] < 1.2
