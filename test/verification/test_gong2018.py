"""The preset gong2018: the second paper's segmentation, ellipsoids, hits and wind."""

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.collider_params import ColliderOptions
from garment_sim_ros.colliders.ellipsoids.ellipsoids import ellipsoids_around, segment_body
from garment_sim_ros.colliders.fitting import fitted
from garment_sim_ros.colliders.segmentation.feature_points import TABLE_1
from garment_sim_ros.presets import usual_colliders

PRESET = "gong2018"


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin")


@pytest.fixture(scope="module")
def fit(body):
    return fitted(body, usual_colliders(PRESET))


def test_table_1_has_the_printed_coefficients():
    """L1, L7, L4, L3 and L2 over the stature H, all in millimetres."""
    male, female = TABLE_1["male"], TABLE_1["female"]
    assert male == {
        "neck": (0.0836, 168.9137),
        "elbow": (0.5510, -283.1964),
        "knee": (0.7447, -257.6398),
        "waist": (0.8044, -243.0916),
        "chest": (0.9630, -311.3857),
    }
    assert female == {
        "neck": (0.0994, 142.6445),
        "elbow": (0.5672, -307.5205),
        "knee": (0.7134, -207.8311),
        "waist": (0.7683, -170.2316),
        "chest": (0.9309, -245.0959),
    }


@pytest.mark.parametrize("sex", ["male", "female"])
def test_the_neck_is_where_the_column_of_the_sex_has_it(body, sex):
    features = segment_body(body, "table1", sex=sex, paths="edges").features
    slope, offset = TABLE_1[sex]["neck"]
    assert features.level["neck"] == pytest.approx(slope * features.ends.height + 1e-3 * offset)


def test_ways_along_edges_are_longer(body):
    edges, unfolded = (
        segment_body(body, "table1", paths=paths).features.level["left_crotch"]
        for paths in ("edges", "unfolded")
    )
    assert 1.005 * unfolded < edges < 1.15 * unfolded


def test_settings_reach_the_segmentation(body):
    counts = []
    for sex, paths in (("female", "edges"), ("male", "edges"), ("female", "unfolded")):
        options = usual_colliders(PRESET)
        options = ColliderOptions(**{**vars(options), "sex": sex, "paths": paths})
        report = ellipsoids_around(body, options).report()
        counts.append(report["segmentation"]["regions"])
    assert counts[0] != counts[1]
    assert counts[0] != counts[2]


def test_every_ellipsoid_is_within_mu(fit):
    report = fit.report()["ellipsoid_fit"]
    assert report["over_mu"] == 0
    assert 15 < report["ellipsoids"] < 1000
    assert report["refitted"] == 0
    assert fit.missed == ()
    kinds = {c.kind for c in fit.colliders.colliders if not c.is_frame}
    assert kinds == {"ellipsoid"}


def test_a_cap_that_binds_is_told(body):
    options = ColliderOptions(**{**vars(usual_colliders(PRESET)), "max_ellipsoids": 40})
    missed = fitted(body, options).missed
    assert len(missed) == 1
    assert "of 40 ellipsoids are over their threshold mu" in missed[0]
    assert "max_ellipsoids" in missed[0]


@pytest.mark.parametrize(
    "asked",
    [{}, {"contact": "rays", "response": "surface"}],
    ids=["reflection", "from the centre"],
)
def test_cloth_moves_in_wind_and_stays_finite(body, fit, asked):
    avatar = gs.Avatar(body, fit.colliders, attachments="arms")
    simulation = gs.Simulation(
        avatar.dress("tshirt_short_skirt"), fit.colliders, preset=PRESET, **asked
    )
    settings, forces = simulation.parameters.settings, simulation.parameters.environment
    assert (settings.sweeps, settings.extras) == (3, False)
    assert asked or (settings.contact, settings.response) == ("earliest", "reflection")
    assert forces.gust > 0.0
    simulation.reset(avatar.poses(), settle=False)
    places = []
    for _ in range(8):
        simulation.step(dt=0.033)
        places.append(simulation.positions("skirt").copy())
    assert np.isfinite(places).all()
    assert np.abs(places[-1] - places[-2]).max() > 1e-4
    assert simulation.health("tshirt").contacts > 50
