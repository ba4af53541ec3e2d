"""Cloth is shown over the shapes that it lies on, between its particles, too."""

import numpy as np
import pytest
from naive import naive_over
from particles import simulated

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.sim.aside import find_off
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.over_shapes import (
    come_down,
    lift_triangles,
    lift_vertices,
)
from garment_sim_ros.sim.simulation import Simulation

THICK = 0.002
KNEE = 0.05
CLEAR, DEEP = np.float32(0.5 * THICK), np.float32(0.01)


def over_a_knee(cloth, rows=7, spacing=0.03, **options):
    """A sheet of large cells that has fallen over a ball of the size of a knee, and its poses."""
    vertices, triangles = cloth.grid(rows, rows, spacing)
    vertices[:, 2] = KNEE + 0.01
    garment = cloth.garment(vertices, triangles, **{"friction": 1.0, "damping": 3.0, **options})
    ball = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": KNEE})
    simulation = Simulation((garment,), cloth.colliders(ball), solver="xpbd")
    poses = ColliderPoses.identity(2)
    simulation.reset(poses)
    for _ in range(20):
        simulation.advance(poses, poses, 1 / 60)
    return simulation, poses


def middles(simulation, x):
    """How far the middles of triangles are from the ball [m]."""
    return np.linalg.norm(x[simulation["cloth"].triangles].mean(axis=1), axis=1) - KNEE


def test_no_middle_is_seen_in_a_knee(cloth):
    simulation, _ = over_a_knee(cloth)
    assert middles(simulation, simulated(simulation)).min() < -0.002
    assert middles(simulation, simulation.positions("cloth")).min() > 0.0
    # Nothing else is moved, nor anything farther than it takes.
    lift = np.linalg.norm(simulation["cloth"].worn.aside.over.lift, axis=1)
    assert 0 < (lift > 0.0).sum() < 0.6 * len(lift)
    beneath = simulation.positions("cloth") - simulation["cloth"].worn.aside.over.lift
    most = CLEAR - middles(simulation, beneath).min()
    assert lift.max() == pytest.approx(most, abs=1e-5)


def test_what_is_seen_changes_nothing_that_is_simulated(cloth):
    one, poses = over_a_knee(cloth)
    other, _ = over_a_knee(cloth)
    other["cloth"].worn.aside.forget()
    for _ in range(5):
        one.advance(poses, poses, 1 / 60)
        other.advance(poses, poses, 1 / 60)
        one.positions("cloth")
    np.testing.assert_array_equal(one.state("cloth").x, other.state("cloth").x)


def test_the_papers_do_without(cloth):
    vertices, triangles = cloth.grid(7, 7, 0.04)
    vertices[:, 2] = KNEE + 0.01
    ball = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": KNEE})
    for extras in (False, True):
        simulation = Simulation(
            (cloth.garment(vertices, triangles, friction=1.0),),
            cloth.colliders(ball),
            solver="relaxation",
            extras=extras,
        )
        poses = ColliderPoses.identity(2)
        simulation.reset(poses)
        simulation.advance(poses, poses, 0.3)
        off = simulation.positions("cloth") - simulated(simulation)
        assert (np.abs(off).max() > 0.0) == extras


def test_it_comes_down_slowly_where_contact_ends(cloth):
    simulation, poses = over_a_knee(cloth)
    before = np.linalg.norm(simulation["cloth"].worn.aside.over.lift, axis=1)
    away = ColliderPoses(
        position=poses.position - np.array([0.0, 0.0, 1.0]), orientation=poses.orientation
    )
    simulation.advance(poses, away, 1 / 60)
    after = np.linalg.norm(simulation["cloth"].worn.aside.over.lift, axis=1)
    np.testing.assert_allclose(after, np.exp(-1 / 6) * before, rtol=1e-4, atol=1e-9)


def test_it_goes_along_where_cloth_is_taken_along(cloth):
    simulation, poses = over_a_knee(cloth)
    before = simulation.positions("cloth").copy()
    there = ColliderPoses(position=poses.position + 2.0, orientation=poses.orientation)
    simulation.transport(poses, there)
    assert simulation.positions("cloth") == pytest.approx(before + 2.0, abs=1e-5)


def at_origin(collider_set):
    """The shapes as kernels and as the naive twin have them."""
    colliders = ColliderState.of(collider_set)
    colliders.pose()
    shapes = [c for c in collider_set.colliders if not c.is_frame]
    return colliders, [(shape, np.zeros(3), np.eye(3)) for shape in shapes]


@pytest.fixture
def pressed(cloth):
    """A sheet with two pins over a ball and a rod: as worn, and the shapes, see `at_origin`."""
    vertices, triangles = cloth.grid(8, 8, 0.035)
    vertices[:, 2] = KNEE + 0.01
    garment = cloth.garment(vertices, triangles, pins=[0, 35], friction=1.0, damping=3.0)
    shapes = (
        Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": KNEE}),
        Collider(
            name="rod",
            kind="capsule",
            bone="bone",
            geometry={"radius0": 0.04, "radius1": 0.03, "length": 0.2},
        ),
    )
    simulation = Simulation((garment,), cloth.colliders(*shapes), solver="xpbd")
    poses = ColliderPoses.identity(3)
    simulation.reset(poses)
    for _ in range(20):
        simulation.advance(poses, poses, 1 / 60)
    worn = simulation["cloth"].worn
    # One particle is between two shapes, some are deep.
    touching = np.flatnonzero(worn.workspace.contacts.shape >= 0)
    worn.workspace.contacts.depth[touching[0]] = np.inf
    worn.state.x[touching[1]] *= np.float32(0.85)
    assert not simulation.origin.any()
    return worn, *at_origin(simulation.collider_set)


def test_triangles_are_lifted_as_the_twin_lifts_them(pressed):
    worn, colliders, shapes = pressed
    contacts = worn.workspace.contacts
    lift = np.full((len(worn.model), 3), np.nan, np.float32)
    particle, x = worn.model.particle, np.empty_like(lift)
    x[worn.model.vertex] = worn.state.x
    lift_triangles(
        *(x, worn.model.triangles, particle, contacts),
        *(colliders.shapes, colliders.posed, CLEAR, DEEP, lift),
    )
    triangles = worn.model.particle_triangles
    expected = naive_over.lift_triangles(
        *(worn.state.x.astype(float), triangles, contacts.shape, contacts.normal.astype(float)),
        *(contacts.depth, shapes, float(CLEAR), float(DEEP)),
    )
    assert (np.linalg.norm(expected, axis=1) > 1e-3).sum() > 5
    assert not expected[worn.model.free_count :].any()  # pins stay
    np.testing.assert_allclose(lift[worn.model.vertex], expected, atol=2e-6)


def test_vertices_between_are_lifted_as_the_twin_lifts_them(pressed):
    worn, colliders, shapes = pressed
    contacts = worn.workspace.contacts
    corner = np.ascontiguousarray(worn.model.particle_triangles, np.int32)
    x = np.ascontiguousarray(worn.state.x[corner].mean(axis=1))
    lift = np.full(x.shape, np.nan, np.float32)
    lift_vertices(*(x, corner, contacts, colliders.shapes, colliders.posed, CLEAR, DEEP, lift))
    expected = naive_over.lift_vertices(
        *(x.astype(float), corner, contacts.shape, contacts.depth, shapes),
        *(float(CLEAR), float(DEEP)),
    )
    assert (np.linalg.norm(expected, axis=1) > 1e-3).sum() > 5
    np.testing.assert_allclose(lift, expected, atol=2e-6)


def test_the_larger_of_what_is_asked_and_what_is_left_is_shown():
    lift = np.array([[0.0, 0.0, 4.0], [0.0, 3.0, 0.0], [0.0, 0.0, 0.0]], np.float32)
    asked = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 1.0, 0.0]], np.float32)
    come_down(lift, asked, np.float32(0.5))
    np.testing.assert_array_equal(lift, [[0.0, 0.0, 2.0], [0.0, 0.0, 2.0], [0.0, 1.0, 0.0]])


def test_no_edge_is_stretched():
    """0 and 1 are lifted apart, as 3 and 4, whose edge may; 2 goes across its edges.

    An edge of a metre that may have 1.1 m is lengthened by as much.
    """
    place = np.array(
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0], [3.0, 1.0, 0.0]],
        np.float32,
    )
    way = np.array(
        [[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1], [0.0, 0.0, 0.1], [0.0, 0.0, 0.1], [0.2, 0.0, 0.0]],
        np.float32,
    )
    edges = np.array([[0, 1], [0, 2], [1, 2], [1, 3], [2, 3], [2, 4], [3, 4]], np.int32)
    most = np.full(7, 2.5, np.float32)
    most[0] = 1.1
    expected = way.copy()
    expected[:2] *= 0.5
    for _ in range(2):
        # Half of it lies over shapes.
        lift, off = 0.5 * way, np.full_like(way, np.nan)
        find_off(place + 0.5 * way, place, edges, most, np.zeros(5, np.float32), off, lift)
        np.testing.assert_allclose(off, expected, atol=1e-6)
        np.testing.assert_allclose(lift, 0.5 * expected, atol=1e-6)
        most[6] = 1.1
        expected[3:] *= (np.sqrt(0.2**2 + 0.05 * 0.21) - 0.2) / 0.05


def test_no_stretched_edge_is_lengthened():
    """By how little it is more than stretched decides nothing: what is shown hangs on no limit."""
    place = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], np.float32)
    way = np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]], np.float32)
    edges, seen = np.array([[0, 1]], np.int32), []
    for most in (0.9, 0.9999, 1.0001):
        lift, off = np.zeros((2, 3), np.float32), np.empty((2, 3), np.float32)
        given = edges, np.array([most], np.float32), np.empty(2, np.float32), off, lift
        find_off(place + way, place, *given)
        seen.append(off[1, 0])
    np.testing.assert_allclose(seen, [0.0, 0.0, 0.00005], atol=1e-6)


def test_what_edges_leave_of_it_is_that_of_the_twin(cloth):
    rng = np.random.default_rng(3)
    rest, triangles = cloth.grid(12, 12)
    place = (rest * [1.5, 1.2, 1.0] + rng.normal(0.0, 0.002, rest.shape)).astype(np.float32)
    way = rng.normal(0.0, 0.004, rest.shape).astype(np.float32)
    way[rng.random(len(way)) < 0.5] = 0.0
    topology = mesh_topology(triangles)
    most = 1.7 * np.linalg.norm(np.diff(rest[topology.edges], axis=1)[:, 0], axis=1)
    lift, off = way.copy(), np.empty_like(way)
    find_off(
        *(place, place, topology.edges, most.astype(np.float32)),
        *(np.zeros(len(way), np.float32), off, lift),
    )
    expected = naive_over.off(place.astype(float), triangles, way.astype(float), rest, 1.7)
    assert 20 < (expected != way).any(axis=1).sum() < 80
    np.testing.assert_allclose(off, expected, atol=1e-7)
    np.testing.assert_array_equal(lift, off)
