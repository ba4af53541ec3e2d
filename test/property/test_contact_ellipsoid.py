"""Ellipsoids among the shapes that cloth meets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from garment_sim_ros.contact.kinds.ellipsoid import ellipsoid_distance, ellipsoid_size
from garment_sim_ros.contact.packed import PosedShapes, pack
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.errors import GeometryError


@njit
def distance_to_first(shapes, posed, qx, qy, qz, reach):
    return ellipsoid_distance(shapes, posed, 0, qx, qy, qz, reach)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_signed_distance_in_single_precision(seed):
    """Against the closest of many points of the surface, and its sign against zeta."""
    rng = np.random.default_rng(seed)
    radii = rng.uniform(0.03, 0.3, 3)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    u = rng.normal(size=(20_000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    surface = (u * radii) @ R.T
    ellipsoid = Collider(name="e", kind="ellipsoid", bone="b", geometry={"radii": radii})
    shapes = pack(ColliderSet(colliders=(ellipsoid,)))
    posed = PosedShapes.room_for(shapes)
    posed.rotation[0] = R
    for q in rng.normal(size=(5, 3)) * 0.2:
        values = distance_to_first(shapes, posed, *q.astype(np.float32), np.float32(9.0))
        inside = (((R.T @ q) / radii) ** 2).sum() < 1.0
        truth = np.linalg.norm(surface - q, axis=1).min() * (-1.0 if inside else 1.0)
        assert values[0] == pytest.approx(truth, abs=4e-3)
        n = np.array(values[1:])
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-5)
        at = R.T @ (q - values[0] * n) / radii
        assert (at**2).sum() == pytest.approx(1.0, abs=2e-3)
        # Where it is out of reach it is not worked out.
        far = distance_to_first(shapes, posed, *q.astype(np.float32), np.float32(0.0))
        assert far[0] == values[0] if inside else far[0] > 0.0


@pytest.mark.parametrize("radii", [[1.0, 1.0], [1.0, 0.0, 1.0], [1.0, np.nan, 1.0], "abc"])
def test_bad_radii(radii):
    bad = Collider(name="e", kind="ellipsoid", bone="b", geometry={"radii": radii})
    with pytest.raises(GeometryError, match="'e'"):
        pack(ColliderSet(colliders=(bad,)))
    assert ellipsoid_size([3.0, 2.0, 1.0]) == (3.0, 2.0, 1.0, 0.0)
