"""What `bench/comparators.py` builds of what the papers compare themselves with."""

from types import SimpleNamespace

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.contact.plain_shapes import ellipsoid


@pytest.fixture(scope="module")
def comparators(bench):
    return bench("comparators")


def test_particles_ride_on_the_ellipsoid_that_they_are_nearest_to(comparators):
    shapes = [
        ellipsoid((0.3, 0.1, 0.1), (0.0, 0.0, 0.0), name="long"),
        ellipsoid((0.1, 0.1, 0.1), (0.0, 0.0, 1.0), name="round"),
    ]
    colliders = gs.ColliderSet.of(*shapes)
    before = colliders.poses()
    moves = {c.name: i for i, c in enumerate(colliders.colliders)}
    after = before.copy()
    after.position[moves["long"]] += [0.0, 0.2, 0.0]
    half = np.sqrt(0.5)
    after.orientation[moves["round"]] = [0.0, 0.0, half, half]  # a quarter about z
    rider = SimpleNamespace(avatar=SimpleNamespace(colliders=colliders))
    # The last one is nearer to the centre of the round one, but to the surface of the long one.
    x = np.array([[0.0, 0.12, 0.0], [0.15, 0.0, 1.0], [0.0, 0.0, -0.2], [0.55, 0.0, 0.52]])
    found = comparators.Riding._ridden(rider, x, before, after)
    expected = [[0.0, 0.32, 0.0], [0.0, 0.15, 1.0], [0.0, 0.2, -0.2], [0.55, 0.2, 0.52]]
    assert found == pytest.approx(np.array(expected))


def test_a_truncated_ellipsoid_is_the_ellipsoid_between_the_ends_of_its_region(comparators):
    body = load_body(comparators.BODY)
    fit = comparators.ellipsoids_around(
        body, comparators.EllipsoidSettings(**comparators.ONE_EACH)
    )
    cut = comparators.truncated(body, gs.ColliderSet(colliders=()))
    assert len(cut.colliders) == len(fit.ellipsoids) == 15
    shorter = 0
    for e, members, c in zip(fit.ellipsoids, fit.members, cut.colliders):
        corners = np.asarray(c.geometry["vertices"])
        # On or inside the ellipsoid, and as long as the region's skin.
        assert np.linalg.norm(corners / e.radii, axis=1).max() <= 1.0 + 1e-2
        along = (members.of(body.skin.vertices) - e.centre) @ e.axes[:, 0]
        assert np.ptp(corners[:, 0]) == pytest.approx(np.ptp(along), rel=1e-6)
        shorter += np.ptp(corners[:, 0]) < 1.9 * e.radii[0]
    assert shorter >= 10
