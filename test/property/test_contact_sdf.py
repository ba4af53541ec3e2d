"""Sampled signed distances among the shapes that cloth meets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.spatial.transform import Rotation

from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.contact.kinds.sdf import sdf_distance, sdf_height
from garment_sim_ros.contact.packed import PosedShapes, pack
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.errors import GeometryError

CHECKED = settings(derandomize=True, deadline=None, max_examples=20)
CELL = 0.01


def nodes(count):
    return CELL * (np.indices(count).reshape(3, -1).T - 0.5 * (np.array(count) - 1))


def random_grid(seed):
    """The union of two ellipsoid-like blobs, in a grid with 2 to 4 cells around."""
    rng = np.random.default_rng(seed)
    centre, radius = rng.uniform(-0.03, 0.03, (2, 3)), rng.uniform(0.02, 0.05, 2)
    count = rng.integers(20, 26, 3)
    apart = np.linalg.norm(nodes(count)[:, None] - centre, axis=2) - radius
    return DistanceGrid.sampled(CELL, apart.min(axis=1).reshape(count)), centre, radius


def packed(*grids):
    return pack(
        ColliderSet(
            colliders=tuple(
                Collider(name=str(i), kind="sdf", bone="bone", geometry=grid.geometry())
                for i, grid in enumerate(grids)
            )
        )
    )


@njit
def ask(shapes, posed, k, points, reach, height, found):
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        found[i, 0], found[i, 1], found[i, 2], found[i, 3] = sdf_distance(
            shapes, posed, k, x, y, z, reach
        )
        height[i] = sdf_height(shapes, shapes.hull[k], x, y, z)


def asked(shapes, k, points, R, reach):
    posed = PosedShapes.room_for(shapes)
    posed.rotation[:] = R
    height = np.empty(len(points), np.float32)
    found = np.empty((len(points), 4), np.float32)
    ask(shapes, posed, k, points.astype(np.float32), np.float32(reach), height, found)
    return height, found


@CHECKED
@given(seed=st.integers(0, 10**6))
def test_distances_are_those_in_double_precision(seed):
    grids = [random_grid(seed + i)[0] for i in range(2)]
    rng = np.random.default_rng(seed)
    R = Rotation.random(random_state=seed % 1000).as_matrix()
    shapes = packed(*grids)
    for k, grid in enumerate(grids):
        # Within the grid, on its samples, and up to a metre beyond.
        half = -grid.low
        local = np.concatenate(
            [
                rng.uniform(-half, half, (1500, 3)),
                rng.permutation(nodes(grid.distance.shape))[:500],
                rng.uniform(-1.0, 1.0, (500, 3)),
            ]
        )
        expected = grid.value(local)
        _, found = asked(shapes, k, local @ R.T, R, 9.0)
        distance, normal = found[:, 0], found[:, 1:] @ R
        np.testing.assert_allclose(distance, expected, atol=2e-6)  # float32 near 1 m
        height, _ = asked(shapes, k, local, np.eye(3), 9.0)
        np.testing.assert_allclose(height, expected, atol=2e-6)
        # The direction is where the distance grows fastest, off the faces between cells.
        np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-5)
        inner = local[:1500]
        at = (inner - grid.low) / CELL
        inner_cell = np.abs(at - np.round(at)).min(axis=1) > 0.01
        e = 1e-5 * np.eye(3)
        slope = np.stack([grid.value(inner + d) - grid.value(inner - d) for d in e], axis=1)
        size = np.linalg.norm(slope, axis=1)
        plain = inner_cell & (size > 2e-6)
        cosine = (normal[:1500] * slope).sum(axis=1)[plain] / size[plain]
        assert cosine.min() > 0.999
        # Beyond the reach it is infinite.
        for reach in (0.0, 0.004):
            _, found = asked(shapes, k, local @ R.T, R, reach)
            clear = np.abs(expected - reach) > 1e-5
            box = grid.box()
            in_box = ((local > box[:3] - reach + 1e-6) & (local < box[3:] + reach - 1e-6)).all(1)
            np.testing.assert_array_equal(
                np.isfinite(found[:, 0])[clear & in_box], (expected <= reach)[clear & in_box]
            )
            assert not np.isfinite(found[:, 0])[clear & (expected > reach)].any()


@CHECKED
@given(seed=st.integers(0, 10**6))
def test_bounds_hold(seed):
    grid, centre, radius = random_grid(seed)
    rng = np.random.default_rng(seed)
    half = -grid.low
    inside = rng.uniform(-half, half, (20_000, 3))
    value = grid.value(inside)
    # The box holds all that is inside, and so do the samples around it.
    box = grid.box()
    own = inside[value < 0.0]
    assert ((own >= box[:3] - 1e-12) & (own <= box[3:] + 1e-12)).all()
    assert (own.max(axis=0) <= grid.rim().max(axis=0)).all()
    # No change is steeper than told.
    step = rng.normal(scale=0.3 * CELL, size=inside.shape)
    other = np.clip(inside + step, -half, half)
    way = np.linalg.norm(other - inside, axis=1)
    assert (np.abs(grid.value(other) - value) <= grid.steepest() * way + 1e-12).all()
    assert 1.0 <= grid.steepest() < 2.0
    # Beyond the grid no distance is more than the true one, but for interpolation: at most an
    # eighth of the second derivative, one over the distance from a centre, times three cells
    # squared.
    beyond = rng.uniform(-1.0, 1.0, (5000, 3))
    beyond = beyond[(np.abs(beyond) > half).any(axis=1)]
    true = (np.linalg.norm(beyond[:, None] - centre, axis=2) - radius).min(axis=1)
    bound = grid.value(beyond)
    assert (bound <= true + 3.0 * CELL**2 / (8.0 * 0.05)).all()
    gap = np.linalg.norm(np.maximum(np.abs(beyond) - half, 0.0), axis=1)
    assert (bound >= gap).all()


FAULTS = {
    "open": {"distance": np.full((4, 4, 4), -1, np.int16)},
    "empty": {"distance": np.full((4, 4, 4), 1, np.int16)},
    "flat": {"distance": np.full((4, 4), 1, np.int16)},
    "thin": {"distance": np.full((2, 4, 4), 1, np.int16)},
    "floats": {"distance": np.full((4, 4, 4), 1.0)},
    "no cell": {"cell": 0.0},
    "no step": {"step": np.nan},
    "text": {"cell": "wide"},
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_grids_are_refused(fault):
    geometry = random_grid(0)[0].geometry() | FAULTS[fault]
    bad = Collider(name="chest", kind="sdf", bone="b", geometry=geometry)
    with pytest.raises(GeometryError, match="'chest'"):
        pack(ColliderSet(colliders=(bad,)))
