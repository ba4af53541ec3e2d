"""Swept contact, and what shapes do to cloth between and beside searches, against naive twins."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_contact

from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.guard.guard import Guard
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.pinch import stay_between
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.contact.sides import OPPOSED, PASSING, UNDER, Sides
from garment_sim_ros.contact.sweep import Sweep, sweep
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.sim.solvers.xpbd.given import Bodies, Planes
from garment_sim_ros.sim.solvers.xpbd.planes import (
    remember_planes,
    return_to_planes,
    stop_at_contacts,
    touch_planes,
)
from garment_sim_ros.sim.solvers.xpbd.second_planes import remember_second_planes

SEEDS = st.integers(0, 10**6)
THICKNESS = 0.003


class Scene:
    """Spheres and tapered capsules that move in a step, about an origin away from the world's."""

    def __init__(self, rng, count, way, turn, spread=0.1):
        colliders = []
        for k in range(count):
            r0, r1, length = rng.uniform([0.02, 0.02, 0.0], [0.06, 0.06, 0.3])
            capsule = {"radius0": r0, "radius1": r1, "length": length}
            kind, geometry = ("sphere", {"radius": r0}) if k % 2 else ("capsule", capsule)
            colliders.append(Collider(name=f"c{k}", kind=kind, bone="b", geometry=geometry))
        self.set = ColliderSet(colliders=tuple(colliders))
        self.origin = rng.normal(size=3)
        q = rng.normal(size=(count, 4))
        self.start = ColliderPoses(
            position=rng.uniform(-spread, spread, (count, 3)) + self.origin,
            orientation=q / np.linalg.norm(q, axis=1, keepdims=True),
        )
        q = self.start.orientation + turn * rng.normal(size=(count, 4))
        self.end = ColliderPoses(
            position=self.start.position + way * rng.normal(size=(count, 3)),
            orientation=q / np.linalg.norm(q, axis=1, keepdims=True),
        )
        self.packed = pack(self.set)
        self.posed = PosedShapes.room_for(self.packed)
        pose(self.packed, self.start, self.end, self.origin, self.posed)
        self.way = Sweep.of(self.set, self.packed)

    @property
    def carry(self):
        """From the poses, in float64."""
        R0, R1 = (matrix_from_quaternion(p.orientation) for p in (self.start, self.end))
        R = R1 @ R0.transpose(0, 2, 1)
        p0, p1 = self.start.position - self.origin, self.end.position - self.origin
        offset = p1 - np.einsum("kij,kj->ki", R, p0)
        return np.concatenate([R - np.eye(3), offset[..., None]], axis=2)

    @property
    def shapes(self):
        """For the naive twins, at the end of the step."""
        R = matrix_from_quaternion(self.end.orientation)
        return list(zip(self.set.colliders, self.end.position - self.origin, R))


@pytest.mark.parametrize(
    ("way", "turn", "least"), [(0.0, 0.0, 1), (0.02, 0.5, 10), (0.1, 0.0, 8), (0.2, 0.5, 10)]
)
def test_sweep(way, turn, least):
    """As the twin, which looks at all shapes, but for particles on the brink of some threshold.

    Fast shapes past slow particles and the other way round; particles that begin inside, go
    nowhere, or meet shapes that do not count.
    """
    total = brink = 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        count = 2 + seed % 4
        scene = Scene(rng, count, way, turn)
        x_start = rng.uniform(-0.15, 0.15, (50, 3)).astype(np.float32)
        far = rng.choice([0.0, 0.005, 0.2], (50, 1))
        x = (x_start + far * rng.normal(size=(50, 3))).astype(np.float32)
        x_start[:count] = scene.start.position - scene.origin
        x[:2] = x_start[:2]
        before = x.copy()
        side = rng.choice([UNDER, UNDER, UNDER, PASSING, OPPOSED], (count, 50)).astype(np.int8)
        coast = x_start + rng.choice([0.0, 1.0], (50, 1)) * (x - x_start)
        x_coast = (coast + 0.01 * rng.normal(size=(50, 3))).astype(np.float32)
        stopped = sweep(
            *(scene.packed, scene.posed, side, scene.way, x, x_start, x_coast),
            np.float32(THICKNESS),
        )
        expected = naive_contact.sweep(
            *(scene.shapes, scene.carry, scene.way.inscribed_radius.astype(np.float64)),
            *(side == UNDER, before, x_start, x_coast, THICKNESS),
        )
        # A way ten times as long as a radius, at a grazing angle, multiplies rounding.
        brink += (np.abs(x - expected).max(axis=1) > 1e-5).sum()
        assert stopped == (x != before).any(axis=1).sum()
        total += stopped
        if way == turn == 0.0:
            slow = np.linalg.norm(x_coast - x_start, axis=1) < 0.01
            assert (x[slow] == before[slow]).all()
    assert total > least
    assert brink <= 1


@given(SEEDS, st.integers(2, 5))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_pinches(seed, count):
    """Particles near to where shapes face each other, some of them at rest there."""
    rng = np.random.default_rng(seed)
    scene = Scene(rng, count, 0.01, 0.05, spread=0.05)
    middle = np.mean([place for _, place, _ in scene.shapes], axis=0)
    n = 200
    x_start = (middle + 0.04 * rng.normal(size=(n, 3))).astype(np.float32)
    x = (x_start + rng.choice([0.0, 0.01], (n, 1)) * rng.normal(size=(n, 3))).astype(np.float32)
    asked = (x + rng.choice([0.0, 1e-3], (n, 1)) * rng.normal(size=(n, 3))).astype(np.float32)
    side = rng.choice([UNDER, OPPOSED, PASSING], (count, n)).astype(np.int8)
    rounding = 1e-6
    off = []
    for p in range(n):
        k = int(rng.integers(count))
        place, *found = stay_between(
            *(scene.packed, scene.posed, side, p, x_start, tuple(asked[p]), tuple(x[p]), k),
            *np.float32([THICKNESS, rounding]),
        )
        pressing = [s for s, where in zip(scene.shapes, side[:, p]) if where != PASSING]
        if not pressing:
            assert not any(found)
            continue
        moved_with = x_start[p] + naive_contact.moved_with(scene.carry[k], x_start[p])
        expected, *expected_found = naive_contact.stay_between(
            *(pressing, asked[p].astype(np.float64), x[p].astype(np.float64), moved_with),
            *(THICKNESS, rounding, float(scene.packed.longest)),
        )
        off.append(np.abs(np.array(place) - expected).max() + (found != expected_found))
    # Which of two shapes is nearest may be a matter of rounding.
    assert (np.array(off) > 1e-4).sum() <= 1


def contact_arrays(rng, n, m):
    """Shapes touched, unit normals, and depths, some of them infinite."""
    shape = rng.integers(-1, m, n).astype(np.int32)
    normal = rng.normal(size=(n, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    depth = np.where(rng.random(n) < 0.1, np.inf, rng.uniform(0.0, 0.01, n))
    return shape, normal.astype(np.float32), depth.astype(np.float32)


@given(SEEDS, st.floats(1e-3, 0.02), st.sampled_from([0.0, 0.3, 2.0]), st.booleans())
@settings(derandomize=True, deadline=None, max_examples=40)
def test_planes(seed, dt, friction, searched):
    """What touched moves with the shape, held or slipping; a plane just met changes nothing.

    Before a search what is deep comes up, but not all the way.
    """
    rng = np.random.default_rng(seed)
    n, m = 60, 3
    dt, friction = np.float32(dt), np.float32(friction)
    x_start = rng.normal(size=(n, 3)).astype(np.float32)
    touched_at = (x_start + 0.003 * rng.normal(size=(n, 3))).astype(np.float32)
    v = (0.5 * rng.normal(size=(n, 3))).astype(np.float32)
    x = (x_start + dt * v).astype(np.float32)
    x[0], x_start[1], v[1] = touched_at[0], x[1], 0.0
    shape, normal, depth = contact_arrays(rng, n, m)
    carry = (0.005 * rng.normal(size=(m, 3, 4))).astype(np.float32)
    place, shift = np.full((2, n, 3), 7.0, np.float32)
    planes = Planes(shape, normal, depth, np.zeros(n, np.bool_), place, shift)
    remember_planes(touched_at, x_start, planes, carry)
    inscribed_radius = rng.uniform(0.02, 0.3, m).astype(np.float32)
    expected = []
    for p in range(n):
        at, speed = x[p].astype(np.float64), v[p].astype(np.float64)
        if shape[p] < 0:
            assert (place[p] == 7.0).all()
        else:
            radius = float(inscribed_radius[shape[p]])
            way = naive_contact.moved_with(carry[shape[p]].astype(np.float64), x_start[p])
            pressed = bool(np.isinf(depth[p]))
            moves = at, speed, x_start[p].astype(np.float64), touched_at[p] + way, way
            out = normal[p].astype(np.float64)
            if not searched:
                at, speed = naive_contact.touch_plane(*moves, out, pressed, friction, float(dt))
            elif pressed:
                at, speed = naive_contact.stay_near(*moves[:3], way, radius, float(dt))
            else:
                at, speed = naive_contact.return_to_plane(*moves, out, radius, friction, float(dt))
        expected.append((at, speed))
    arrays = (x, v, x_start, planes)
    if searched:
        return_to_planes(*arrays, inscribed_radius, friction, dt)
    else:
        touch_planes(*arrays, friction, dt)
    np.testing.assert_allclose(x, [e[0] for e in expected], atol=2e-6)
    # Positions are rounded to 2e-7 m.
    np.testing.assert_allclose(v, [e[1] for e in expected], atol=1e-6 / dt + 1e-6)


@given(SEEDS, st.floats(1e-3, 0.02), st.sampled_from([0.0, 0.3, 2.0]))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_velocities_after_a_search(seed, dt, friction):
    rng = np.random.default_rng(seed)
    n, m = 60, 3
    dt, friction = np.float32(dt), np.float32(friction)
    x_start = rng.normal(size=(n, 3)).astype(np.float32)
    v = (0.5 * rng.normal(size=(n, 3))).astype(np.float32)
    v[0] = 0.0
    shape, normal, depth = contact_arrays(rng, n, m)
    # Some went all the way out, some sideways, some nowhere.
    way_out = np.where(np.isinf(depth), 0.0, depth)[:, None] * normal
    way_out *= rng.choice([0.0, 0.3, 1.0], (n, 1))
    x_before = (x_start + dt * v).astype(np.float32)
    x = (x_before + way_out).astype(np.float32)
    carry = (0.005 * rng.normal(size=(m, 3, 4))).astype(np.float32)
    carry[0] = 0.0
    expected = v.astype(np.float64)
    for p in np.flatnonzero(shape >= 0):
        way = naive_contact.moved_with(carry[shape[p]].astype(np.float64), x_start[p])
        expected[p] = naive_contact.stop_at_contact(
            *(expected[p], (x[p] - x_before[p]).astype(np.float64), way / dt),
            *(normal[p].astype(np.float64), float(depth[p]), float(friction)),
        )
    motion = np.zeros(2)
    planes = Planes(shape, normal, depth, np.zeros(n, np.bool_), *np.zeros((2, n, 3), np.float32))
    stop_at_contacts(x, v, x_start, x_before, planes, carry, friction, dt, motion)
    np.testing.assert_allclose(v, expected, atol=1e-6 / dt)
    speed = (v.astype(np.float64) ** 2).sum(axis=1)
    assert motion == pytest.approx([speed.sum(), speed.max()], rel=1e-5)


@given(SEEDS, st.integers(2, 5))
@settings(derandomize=True, deadline=None, max_examples=20)
def test_second_planes(seed, count):
    """Particles near to shapes that they touched before, far off, deep in them, or kept."""
    rng = np.random.default_rng(seed)
    scene = Scene(rng, count, 0.01, 0.05, spread=0.05)
    n = 400
    middle = np.mean([place for _, place, _ in scene.shapes], axis=0)
    x = (middle + 0.05 * rng.normal(size=(n, 3))).astype(np.float32)
    x_start = (x - 0.01 * rng.normal(size=(n, 3))).astype(np.float32)
    side = rng.choice([UNDER, UNDER, OPPOSED, PASSING], (count, n)).astype(np.int8)
    guard = Guard.none(n)
    guard.kept[:] = kept = rng.choice([-1, -1, -1, 0], n)
    planes, second = Planes.room_for(n), Planes.room_for(n)
    now, before, had = rng.integers(-1, count, (3, n)).astype(np.int32)
    planes.shape[:], second.shape[:] = now, had
    planes.depth[:] = rng.choice([0.001, np.inf], n, p=[0.8, 0.2])
    sides = Sides(side, np.zeros((0, count), np.bool_))
    bodies = Bodies(
        *(scene.packed, scene.posed, scene.posed, scene.way, sides),
        *(Contacts.room_for(n, count), guard),
    )
    remember_second_planes(x, x_start, bodies, planes, second, before, np.float32(THICKNESS))
    reach = 0.25 * scene.way.inscribed_radius.astype(np.float64)
    found = 0
    for p in range(n):
        is_held = kept[p] >= 0 or (now[p] >= 0 and np.isinf(planes.depth[p]))
        candidate = before[p] if before[p] not in (-1, now[p]) else had[p]
        passes = candidate >= 0 and side[candidate, p] == PASSING
        expected, normal, place = -1, None, None
        if not (is_held or passes):
            expected, normal, place = naive_contact.second_plane(
                *(scene.shapes, x[p].astype(np.float64)),
                *((int(now[p]), int(before[p]), int(had[p])), reach, THICKNESS),
            )
        assert second.shape[p] == expected
        if expected < 0:
            continue
        found += 1
        np.testing.assert_allclose(second.normal[p], normal, atol=1e-4)
        np.testing.assert_allclose(second.place[p], place, atol=1e-5)
        way = naive_contact.moved_with(scene.carry[expected], x_start[p].astype(np.float64))
        np.testing.assert_allclose(second.shift[p], way, atol=1e-6)
    assert found > 3
    assert (second.depth == 0.0).all()
