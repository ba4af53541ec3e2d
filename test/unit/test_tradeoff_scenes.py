"""Scenes of the papers' figures: the model is theirs in number, the dress is sewn once."""

import numpy as np
import pytest

from garment_sim_ros.avatar import Avatar
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.tradeoff import scenes, sewn
from garment_sim_ros.tradeoff.playing import Player
from garment_sim_ros.tradeoff.points import preset_point
from garment_sim_ros.tradeoff.waisted_limb import DELTA, lying_hulls, lying_limb, waisted_limb


def corners(flat):
    """Corners of each triangle in an order of their own, shape [t, 3, 2]."""
    return np.array([sorted(map(tuple, triangle.round(9))) for triangle in flat])


class TestLimb:
    def test_it_has_the_numbers_of_the_paper(self):
        x, triangles = waisted_limb()
        edges = x[triangles] - np.roll(x[triangles], 1, axis=1)
        assert (len(x), len(triangles)) == (256, 508)
        assert np.linalg.norm(edges, axis=2).mean() == pytest.approx(0.084)
        for printed in (False, True):
            inner, outer = lying_hulls(printed=printed)
            assert len(inner.faces) == 224
            assert len(outer.faces) <= 116
            assert inner.height(outer.vertices).max() < (np.inf if printed else 2.001 * DELTA)
            assert outer.height(inner.vertices).max() < 0.0

    def test_it_lies_with_its_top_at_the_origins_height(self):
        limb = lying_limb()
        x = limb.geometry["vertices"] + limb.position
        assert x[:, 2].max() == pytest.approx(0.0, abs=1e-12)
        extent = np.ptp(x, axis=0)
        assert extent[0] > 2.0 * extent[1:].max()

    def test_the_sheet_falls_on_it_and_lies_there(self):
        staged = scenes.staged(scenes.SCENES["limb"])
        assert len(staged.garments[0].vertices) == 2500
        player = Player(staged, preset_point("fast", 1 / 60, "plain").arguments(1 / 60))
        player.put_on(settle=False)
        x = player.play(0, 60).paths["sheet"]
        # It starts 3 cm above the top, which holds its middle; the corners fall.
        middle = np.linalg.norm(x[0, :, :2], axis=1) < 0.05
        assert x[0, :, 2] == pytest.approx(0.03)
        assert -0.05 < x[-1, middle, 2].mean() < 0.01
        assert x[-1, :, 2].min() < -0.2


@pytest.mark.parametrize(("name", "mesh"), [("trousers", "trousers"), ("tight_skirt", "skirt")])
def test_a_real_garment_is_worn_by_a_real_body(name, mesh, data_file, monkeypatch):
    data = data_file("garments").parent
    monkeypatch.setenv(scenes.VARIABLE, str(data))
    assert scenes.SCENES[name].absent == ""
    staged = scenes.staged(scenes.SCENES[name], seconds=1 / 60)
    (garment,) = staged.garments
    assert mesh in garment.name
    assert len(garment.vertices) > 1000
    assert staged.avatar.body.name.startswith("mh_female")
    assert staged.frames == 1


class TestDress:
    def test_it_is_sewn_once_for_a_body_and_worn_on_its_colliders(self, monkeypatch, tmp_path):
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
        avatar, made = Avatar.load("mannequin", method="capsules"), []
        tube = Garment.sheet(0.2, 0.2, edge=0.1)

        class Tube:
            vertices = tube.vertices + np.array([0.3, 0.0, 1.2])
            triangles = tube.triangles
            flat = tube.vertices[tube.triangles][:, :, :2]

        class Made:
            sewn = Tube

        def make(pattern, model):
            made.append((pattern, model.body is avatar.body))
            return Made

        monkeypatch.setattr(sewn, "make", make)
        for _ in range(2):
            (garment,) = sewn.sewn_on(avatar, "wide_dress").garments
            assert garment.name == "wide_dress"
            # Triangles may be turned round to look outward.
            np.testing.assert_allclose(corners(garment.flat), corners(Tube.flat), atol=1e-12)
        assert made == [("wide_dress", True)]
        sewn.sewn_on(avatar, "sleeveless_dress")
        assert [pattern for pattern, _ in made] == ["wide_dress", "sleeveless_dress"]

    def test_the_scene_asks_for_the_pattern_in_gravity_and_wind(self, monkeypatch):
        asked = []

        def dressed(avatar, pattern):
            asked.append(pattern)
            return avatar.dress("tshirt_short_skirt")

        monkeypatch.setattr(scenes, "sewn_on", dressed)
        staged = scenes.staged(scenes.SCENES["dress"], seconds=0.05)
        assert asked == ["wide_dress"]
        np.testing.assert_array_equal(staged.joints[0], staged.joints[-1])
        forces = Player(staged, preset_point("fast", 1 / 60).arguments(1 / 60)).simulation
        assert forces.parameters.environment.gust == 1.0
        assert forces.parameters.environment.gravity[2] < -9.0
