"""Whole blocks of particles against each by itself, where nothing is left out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from garment_sim_ros.colliders.hulls.hull import convex_hull
from garment_sim_ros.contact.collide import collide
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.contact.sides import UNDER, Sides

THICKNESS = 0.003


def body(rng, size):
    """Overlapping hulls, spheres, tapered capsules and an ellipsoid in a cube of 0.4 `size`."""
    geometry = []
    for k in range(6):
        points = rng.normal(size=(40, 3)) * rng.uniform(0.03, 0.1, 3) * size
        hull = convex_hull(points)
        r0, r1, length = rng.uniform([0.03, 0.03, 0.0], [0.1, 0.1, 0.3]) * size
        geometry.append(
            [
                ("hull", {"vertices": hull.vertices, "faces": hull.faces}),
                ("sphere", {"radius": r0}),
                ("capsule", {"radius0": r0, "radius1": r1, "length": length}),
                ("hull", {"vertices": hull.vertices, "faces": hull.faces}),
                ("ellipsoid", {"radii": [r0, r1, 0.5 * (r0 + r1)]}),
                ("hull", {"vertices": hull.vertices, "faces": hull.faces}),
            ][k]
        )
    colliders = tuple(
        Collider(name=f"c{k}", kind=kind, bone="b", geometry=g)
        for k, (kind, g) in enumerate(geometry)
    )
    orientation = rng.normal(size=(6, 4))
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    position = rng.uniform(-0.15, 0.15, (6, 3)) * size
    return ColliderSet(colliders=colliders), ColliderPoses(
        position=position, orientation=orientation
    )


def blob(name, seed):
    """Two balls, sampled."""
    rng = np.random.default_rng(seed)
    centre, radius = rng.uniform(-0.06, 0.06, (2, 3)), rng.uniform(0.03, 0.1, 2)
    at = 0.02 * (np.indices((22, 22, 22)).reshape(3, -1).T - 10.5)
    apart = (np.linalg.norm(at[:, None] - centre, axis=2) - radius).min(axis=1)
    geometry = DistanceGrid.sampled(0.02, apart.reshape(22, 22, 22)).geometry()
    return Collider(name=name, kind="sdf", bone="b", geometry=geometry)


def meet(shapes, start, end, x, x_start, row, side, thickness):
    """Positions after contact with friction, the shapes that touch, and depths."""
    posed = PosedShapes.room_for(shapes)
    pose(shapes, start, end, np.zeros(3), posed)
    out = np.ascontiguousarray(x, np.float32).copy()
    contacts = Contacts.room_for(len(out), len(shapes.kind))
    before = np.ascontiguousarray(x_start, np.float32)
    collide(shapes, posed, Sides.of(row, side), out, before, thickness, 0.3, contacts)
    return out, contacts.shape, contacts.depth


def scene(seed, size=1.0):
    """A packed body that moves a little, a sheet through it, and sides of all kinds."""
    rng = np.random.default_rng(seed)
    colliders, start = body(rng, size)
    end = ColliderPoses(
        position=start.position + rng.normal(0.0, 0.005, (6, 3)) * size,
        orientation=start.orientation,
    )
    u, v = np.meshgrid(np.linspace(-0.2, 0.2, 20), np.linspace(-0.2, 0.2, 10), indexing="ij")
    sheet = np.stack([u, v, 0.03 * np.sin(20.0 * u)], axis=-1).reshape(-1, 3)
    x_start = (sheet + rng.normal(0.0, 0.002, sheet.shape)) * size
    x = x_start + rng.normal(0.0, 0.004, sheet.shape) * size
    row = rng.integers(0, 3, len(x))
    side = np.where(rng.random((3, 6)) < 0.6, 0, rng.integers(0, 3, (3, 6)))
    return pack(colliders), start, end, x, x_start, row, side


@given(st.integers(0, 10**6))
@settings(derandomize=True, deadline=None, max_examples=12)
def test_blocks_and_bounds_change_nothing(seed):
    *bodies, x, x_start, row, side = scene(seed)
    together, shape, depth = meet(*bodies, x, x_start, row, side, THICKNESS)
    rest = len(x) - len(x) % 7
    on_the_brink = 0
    for p in range(0, rest, 7):
        one = slice(p, p + 1)
        alone, k, d = meet(*bodies, x[one], x_start[one], row[one], side, THICKNESS)
        # Of shapes within rounding of each other either may be met first, and on the brink
        # between leaving and being pinched rounding decides: for one point in two thousand.
        if np.abs(together[p] - alone[0]).max() > 2e-6:
            on_the_brink += 1
            continue
        assert (shape[p] < 0) == (k[0] < 0)
        if k[0] >= 0 and k[0] == shape[p]:
            # Infinite where it is pressed from the other side.
            assert depth[p] == pytest.approx(d[0], abs=2e-6)
    assert on_the_brink <= 1


@given(st.integers(0, 10**6), st.sampled_from([1e-3, 1.0 / 17.0, 60.0]))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_small_and_large_bodies_are_met_alike(seed, size):
    """No length of the rule is absolute: a body of 1 mm and one of 100 m behave like a human."""
    *human, row, side = scene(seed)
    *scaled, _, _ = scene(seed, size)
    expected, shape, _ = meet(*human, row, side, THICKNESS)
    found, k, _ = meet(*scaled, row, side, THICKNESS * size)
    off = np.linalg.norm(found / size - expected, axis=1)
    # Rounding decides on the brink between leaving and being pinched, here and there.
    assert (off > 1e-5).mean() <= 0.02
    assert (k != shape).mean() <= 0.02


@njit
def nearest_under(shapes, posed, side, x, reach, nearest):
    """Distance of each point to the nearest shape under it, each asked for by itself."""
    for p in range(x.shape[0]):
        for k in range(side.shape[0]):
            if side[k, p] == UNDER:
                d, _, _, _ = shape_distance(shapes, posed, k, x[p, 0], x[p, 1], x[p, 2], reach)
                nearest[p] = min(nearest[p], d)


@pytest.mark.parametrize(
    "kinds",
    ["all", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("ellipsoid", "sdf"))],
)
@given(st.integers(0, 10**6))
@settings(derandomize=True, deadline=None, max_examples=30)
def test_no_contact_goes_unnoticed(kinds, seed):
    """A bound may take one shape for the nearest where another one holds the point."""
    shapes, start, end, x, x_start, row, side = scene(seed)
    if kinds == "ellipsoid":
        rng = np.random.default_rng(seed)
        colliders = tuple(
            Collider(
                name=f"e{k}",
                kind="ellipsoid",
                bone="b",
                geometry={"radii": rng.uniform([0.02, 0.02, 0.05], [0.1, 0.05, 0.3])},
            )
            for k in range(6)
        )
        shapes = pack(ColliderSet(colliders=colliders))
    if kinds == "sdf":
        shapes = pack(ColliderSet(colliders=tuple(blob(f"s{k}", seed + k) for k in range(6))))
    _, shape, _ = meet(shapes, start, end, x, x_start, row, side, THICKNESS)
    posed = PosedShapes.room_for(shapes)
    pose(shapes, start, end, np.zeros(3), posed)
    x = np.ascontiguousarray(x, np.float32)
    nearest = np.full(len(x), np.inf, np.float32)
    # Interpolated distances may grow less than the way; what counts is within the inflated box.
    reach = np.float32(THICKNESS if kinds == "sdf" else 9.0)
    nearest_under(shapes, posed, Sides.of(row, side).side, x, reach, nearest)
    assert (shape[nearest < THICKNESS - 1e-6] >= 0).all()


def test_repeated_passes_give_the_same_bits():
    *bodies, x, x_start, row, side = scene(3)
    first = meet(*bodies, x, x_start, row, side, THICKNESS)
    again = meet(*bodies, x, x_start, row, side, THICKNESS)
    for a, b in zip(first, again):
        assert a.tobytes() == b.tobytes()
