"""Cloth inside of one part of the body alone: what two parts overlap around is left out."""

import numpy as np
import pytest

from garment_sim_ros.recording.metrics import GarmentMesh


@pytest.fixture(scope="module")
def overlaps(bench):
    return bench("overlaps")


def ball(centre, radius=1.0, count=24):
    """A closed ball of latitudes and longitudes."""
    a = np.linspace(0.0, np.pi, count)[1:-1]
    b = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    rings = np.stack(
        [
            np.outer(np.sin(a), np.cos(b)),
            np.outer(np.sin(a), np.sin(b)),
            np.outer(np.cos(a), np.ones(count)),
        ],
        axis=-1,
    )
    x = np.concatenate([rings.reshape(-1, 3), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    top, bottom, triangles = len(x) - 2, len(x) - 1, []
    for j in range(count):
        k = (j + 1) % count
        triangles += [[top, j, k], [bottom, (len(a) - 1) * count + k, (len(a) - 1) * count + j]]
        for i in range(len(a) - 1):
            p, q = i * count, (i + 1) * count
            triangles += [[p + j, q + j, p + k], [p + k, q + j, q + k]]
    return np.asarray(centre) + radius * x, np.array(triangles, np.int32)


def two_balls():
    """Around x = 0 and x = 1: between 0 and 1 both are."""
    (x, t), (y, u) = ball([0.0, 0.0, 0.0]), ball([1.0, 0.0, 0.0])
    return np.concatenate([x, y]), np.concatenate([t, u + len(x)])


def test_winding_numbers_count_the_parts_around_a_point(overlaps):
    x, t = two_balls()
    points = np.array([[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0], [1.5, 0.2, 0.1], [3.0, 0.0, 0.0]])
    assert overlaps.winding_numbers(points, x, t) == pytest.approx([2.0, 1.0, 1.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(("at", "share"), [(0.5, 0.0), (-0.7, 1.0), (3.0, 0.0)])
def test_cloth_between_two_parts_is_left_out(overlaps, at, share):
    skin, triangles = two_balls()
    sheet = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.1, 0.1, 0.0]])
    sheet[:, 0] += at
    mesh = GarmentMesh.from_rest(sheet, np.array([[0, 1, 2], [1, 3, 2]], np.int32))
    meter = overlaps.OverlapMeter(skin, triangles, {"sheet": mesh})
    meter.add(skin, {"sheet": sheet})
    assert meter.p99 == pytest.approx(share)
