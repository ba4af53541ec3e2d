"""Refinement by pruned k-means, and the ellipsoids that come of it."""

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.collider_params import EllipsoidSettings
from garment_sim_ros.colliders.ellipsoids.ellipsoid_binding import fit_ellipsoids
from garment_sim_ros.colliders.ellipsoids.ellipsoids import ellipsoids_around
from garment_sim_ros.colliders.ellipsoids.pruned_kmeans import FEWEST, Clustering, reassign, refine
from garment_sim_ros.colliders.ellipsoids.thresholds import REGIONS, TORSO
from garment_sim_ros.errors import ParameterError


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin:vertices=3000")


def naive_reassign(points, centre, label, error, use_rule, sigma, max_passes, fewest):
    """The same passes over plain lists."""
    centre, label = centre.copy(), label.copy()
    for _ in range(max_passes):
        moved = 0
        for p, x in enumerate(points):
            i = label[p]
            if (label == i).sum() <= fewest:
                continue
            d = ((centre - x) ** 2).sum(axis=1)
            every = range(len(centre))
            allowed = [j for j in every if j == i or not use_rule or error[i] > error[j]]
            best = min(allowed, key=lambda j: (d[j], j != i, j))
            if best != i:
                label[p], moved = best, moved + 1
        before = centre.copy()
        for j in range(len(centre)):
            if (label == j).any():
                centre[j] = points[label == j].mean(axis=0)
        if moved == 0 or np.linalg.norm((centre - before).mean(axis=0)) <= sigma:
            break
    return centre, label


@pytest.mark.parametrize("use_rule", [True, False])
@pytest.mark.parametrize("sigma", [0.0, 0.02])
def test_kmeans_twin(use_rule, sigma):
    rng = np.random.default_rng(3)
    points = rng.normal(size=(300, 3))
    label = rng.integers(0, 6, 300).astype(np.int32)
    centre, error = rng.normal(size=(6, 3)), rng.uniform(size=6)
    expected = naive_reassign(points, centre, label, error, use_rule, sigma, 40, FEWEST)
    reassign(points, centre, label, error, use_rule, sigma, 40, FEWEST)
    assert (label == expected[1]).all()
    assert np.allclose(centre, expected[0])


def test_points_only_move_to_smaller_errors():
    rng = np.random.default_rng(4)
    points = rng.normal(size=(400, 3))
    label = rng.integers(0, 5, 400).astype(np.int32)
    error = np.array([0.3, 0.1, 0.5, 0.2, 0.4])
    before = label.copy()
    reassign(points, rng.normal(size=(5, 3)), label, error, True, 0.0, 1, FEWEST)
    moved = before != label
    assert moved.any()
    assert (error[before[moved]] > error[label[moved]]).all()


def test_refinement_stops_at_the_threshold_and_at_the_most():
    rng = np.random.default_rng(5)
    points = rng.uniform(-1.0, 1.0, size=(600, 3)) * [1.0, 0.2, 0.1]
    part = Clustering.start(points, np.zeros(600, np.int32), sigma=1e-3)
    first = part.worst()[1]
    refine([part], [0.6 * first], 500)
    assert part.worst()[1] <= 0.6 * first
    assert 1 < len(part.clusters) < 500
    capped = Clustering.start(points, np.zeros(600, np.int32), sigma=1e-3)
    refine([capped], [1e-9], 17)
    assert len(capped.clusters) == 17


def test_refinement_ends_where_nothing_can_be_split():
    points = np.repeat(np.eye(3), 3, axis=0)
    part = Clustering.start(points, np.zeros(9, np.int32), sigma=0.0)
    refine([part], [1e-12], 10_000)
    assert len(part.clusters) <= len(points) // FEWEST
    sizes = np.bincount(part.label)
    assert (sizes >= FEWEST).all()


def test_every_point_is_in_its_ellipsoid_and_all_skin_in_the_union(body):
    x, t = body.skin.vertices, body.skin.triangles
    points = ellipsoids_around(body, EllipsoidSettings(max_ellipsoids=50), cover="vertices")
    for i, e in enumerate(points.ellipsoids):
        assert (e.zeta(x[points.label == i]) <= 1.0).all()
    fit = ellipsoids_around(body, EllipsoidSettings(max_ellipsoids=50))
    share = np.random.default_rng(0).dirichlet(np.ones(3), len(t))
    for skin in (x, np.einsum("tk,tkc->tc", share, x[t]), x[t].mean(axis=1)):
        assert np.min([e.zeta(skin) for e in fit.ellipsoids], axis=0).max() <= 1.0 + 1e-9
    assert fit.label.min() == 0
    assert len(np.unique(fit.label)) == len(fit.ellipsoids) == 50


@pytest.mark.parametrize("mu", [0.045, 0.035])
def test_thresholds_hold_for_what_is_returned_or_the_report_says_by_how_much_not(body, mu):
    reached = ellipsoids_around(body, EllipsoidSettings(mu_torso=mu, mu_limb=mu))
    assert reached.error.max() <= mu
    assert reached.report()["over_mu"] == reached.report()["over_mu_mm_max"] == 0
    report = ellipsoids_around(body, EllipsoidSettings(max_ellipsoids=20)).report()
    assert report["over_mu"] > 10
    assert report["over_mu_mm_max"] > 10.0


def test_thresholds_by_part_and_region(body):
    torso = {REGIONS[i] for i in TORSO}

    def fitted(**settings):
        return ellipsoids_around(body, EllipsoidSettings(**settings), cover="vertices")

    loose = fitted(mu_torso=0.03, mu_limb=0.03)
    tight = fitted(mu_torso=0.015, mu_limb=0.03)
    assert tight.error[[r in torso for r in tight.region]].max() <= 0.015
    assert sum(r in torso for r in loose.region) < sum(r in torso for r in tight.region)
    assert loose.region.count("left_calf") == tight.region.count("left_calf")
    fit = fitted(mu_torso=0.03, mu_limb=0.03, mu="left_calf=0.006 right_calf=0.1")
    assert fit.region.count("left_calf") > fit.region.count("right_calf")
    assert fit.region.count("head") == loose.region.count("head")


@pytest.mark.parametrize("name", ["mannequin:vertices=3000", "mannequin:build=1,sex=1"])
def test_lower_error_than_without_segmentation_at_the_same_count(name):
    body = load_body(name)
    options = {"max_ellipsoids": 60, "mu_torso": 1.5e-4, "mu_limb": 1e-4}
    ours, baseline = (
        ellipsoids_around(body, EllipsoidSettings(segmentation=s, **options), cover="vertices")
        for s in ("surface", "none")
    )
    assert len(ours.ellipsoids) == len(baseline.ellipsoids) == 60
    assert ours.mean_error < baseline.mean_error


def test_colliders_contain_the_skin_on_their_bones(body):
    settings = EllipsoidSettings(max_ellipsoids=40)
    colliders, report = fit_ellipsoids(body, settings)
    solid = [c for c in colliders.colliders if c.kind == "ellipsoid"]
    assert len(solid) == report["ellipsoids"] == 40
    assert {c.name for c in colliders.colliders if c.kind == "frame"} >= {"frame_hips"}
    assert {c.bone for c in solid} >= {"head", "hips", "leftUpperLeg", "rightLowerArm"}
    left = [c for c in solid if c.name.startswith("left_calf")]
    assert all(c.bone.startswith("left") for c in left)
    assert report["segmentation"]["confidence"] > 0.3
    assert set(report["ellipsoids_of"]) == set(REGIONS)
    larger, _ = fit_ellipsoids(body, settings, delta=0.01)
    for a, b in zip(solid, larger.colliders):
        assert np.allclose(np.subtract(b.geometry["radii"], a.geometry["radii"]), 0.01)


def test_same_body_same_bytes(body):
    first, _ = fit_ellipsoids(body, EllipsoidSettings(max_ellipsoids=30))
    second, _ = fit_ellipsoids(body, EllipsoidSettings(max_ellipsoids=30))
    assert first.revision == second.revision


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"mu_torso": 0.0}, "mu_torso"),
        ({"mu_limb": np.nan}, "mu_limb"),
        ({"sigma": -1.0}, "sigma"),
        ({"max_ellipsoids": 3}, "max_ellipsoids"),
        ({"max_ellipsoids": 10**9}, "max_ellipsoids"),
        ({"segmentation": "magic"}, "segmentation"),
        ({"mu": "tail=0.01"}, "tail"),
        ({"mu": "head"}, "head"),
        ({"mu": "head=nan"}, "head"),
    ],
)
def test_bad_options(body, options, named):
    with pytest.raises(ParameterError, match=named):
        fit_ellipsoids(body, EllipsoidSettings(**options))


def test_bad_cover_and_delta(body):
    with pytest.raises(ParameterError, match="cover"):
        ellipsoids_around(body, cover="most")
    with pytest.raises(ParameterError, match="delta"):
        fit_ellipsoids(body, delta=-0.1)
