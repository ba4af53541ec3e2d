"""A limb at 10 m/s, a third of a metre in a frame of 30 Hz, carries a curtain along."""

import numpy as np
import pytest
import trimesh

from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.sim.simulation import Simulation

RADIUS, LENGTH, SPEED, STEP = 0.03, 0.8, 10.0, 1 / 180
ACROSS = np.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""Turns z to y."""


def limb(kind):
    if kind == "capsule":
        geometry = {"radius0": RADIUS, "radius1": RADIUS, "length": LENGTH}
    elif kind == "sphere":
        geometry = {"radius": RADIUS}
    elif kind == "ellipsoid":
        geometry = {"radii": [RADIUS, RADIUS, 3.0]}
    elif kind == "sdf":
        cell, shape = 0.008, np.array([13, 13, 113])
        at = np.abs(cell * (np.indices(shape).reshape(3, -1).T - (shape - 1) / 2))
        beyond = np.stack([np.hypot(at[:, 0], at[:, 1]) - RADIUS, at[:, 2] - LENGTH / 2])
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=0)
        distance = outside + np.minimum(beyond.max(axis=0), 0.0)
        geometry = DistanceGrid.sampled(cell, distance.reshape(shape)).geometry()
    else:
        mesh = trimesh.creation.cylinder(radius=RADIUS, height=LENGTH, sections=12)
        geometry = {"vertices": mesh.vertices.tolist(), "faces": mesh.faces.tolist()}
    return Collider(name="limb", kind=kind, bone="bone", geometry=geometry)


def poses(kind, x):
    result = ColliderPoses.identity(2)
    result.position[1] = [x, -LENGTH / 2 if kind == "capsule" else 0.0, 0.0]
    result.orientation[1] = ACROSS
    return result


def layers_ahead(x, triangles, at, y):
    """How often the cloth is met on the way forward from the limb's axis at y."""
    a, b, c = (x[triangles[:, k]] for k in range(3))

    def turn(p, q):
        return (q[:, 1] - p[:, 1]) * -p[:, 2] - (q[:, 2] - p[:, 2]) * (y - p[:, 1])

    sign = np.stack([turn(a, b), turn(b, c), turn(c, a)])
    hit = (sign > 0.0).all(axis=0) | (sign < 0.0).all(axis=0)
    share = sign[:, hit] / sign[:, hit].sum(axis=0)
    met = share[1] * a[hit, 0] + share[2] * b[hit, 0] + share[0] * c[hit, 0]
    return int((met > at).sum())


def wound(x, at, column):
    """Angle by which a column of the curtain goes round the limb's axis, from its pin down."""
    x, _, z = x.reshape(24, 16, 3)[:, column].T
    angle = np.diff(np.arctan2(z, x - at))
    return float(((angle + np.pi) % (2.0 * np.pi) - np.pi).sum())


def curtain(cloth, kind, solver, step):
    """A curtain in the plane of y and z, and a limb along y."""
    vertices, triangles = cloth.grid(24, 16, 0.025)
    hung = np.stack([0.0 * vertices[:, 0], vertices[:, 1], -vertices[:, 0]], axis=1)
    simulation = Simulation(
        (cloth.garment(hung, triangles, pins=range(16), friction=0.3),),
        cloth.colliders(limb(kind)),
        solver=solver,
        solver_step=step,
    )
    return simulation, triangles


@pytest.mark.parametrize(
    ("kind", "solver", "step"),
    [
        ("capsule", "relaxation", STEP),
        pytest.param("sphere", "relaxation", STEP, marks=pytest.mark.slow),
        pytest.param("hull", "relaxation", STEP, marks=pytest.mark.slow),
        pytest.param("ellipsoid", "relaxation", STEP, marks=pytest.mark.slow),
        ("capsule", "xpbd", STEP),
        pytest.param("capsule", "implicit", STEP, marks=pytest.mark.slow),
        pytest.param("capsule", "implicit", 3 * STEP, marks=pytest.mark.slow),
        pytest.param("sphere", "implicit", STEP, marks=pytest.mark.slow),
    ],
)
def test_a_fast_limb_does_not_pass_through_a_curtain(cloth, kind, solver, step):
    """It meets the curtain and takes it along: there is cloth in front of it, never behind."""
    simulation, triangles = curtain(cloth, kind, solver, step)
    at = -0.2
    across = (0.0013,) if kind == "sphere" else (-0.1013, 0.0013, 0.1013)
    for _ in range(round(0.05 / step)):
        simulation.advance(poses(kind, at), poses(kind, at + SPEED * step), step)
        at += SPEED * step
        x = simulation.positions("cloth")
        assert all(layers_ahead(x, triangles, at, y) % 2 == 1 for y in across)
    assert at > 0.29
    assert simulation.health("cloth").resets == 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["capsule", "hull", "sdf"])
@pytest.mark.parametrize(
    ("solver", "step"), [("implicit", STEP), ("implicit", 1 / 30), ("xpbd", STEP)]
)
def test_a_limb_that_a_frame_of_30_hz_puts_behind_the_curtain_took_it_along(
    cloth, kind, solver, step
):
    """The limb then stands still: the curtain lies over it and swings on, or comes round."""
    simulation, _ = curtain(cloth, kind, solver, step)
    start, end = poses(kind, -0.2), poses(kind, -0.2 + SPEED / 30)
    simulation.reset(start)
    for _ in range(6):
        simulation.advance(start, end, 1 / 30)
        start = end
        # Behind the limb it would go round it the other way, by some 130 degrees.
        x = simulation.positions("cloth")
        assert max(wound(x, end.position[1, 0], k) for k in (4, 8, 11)) < np.radians(60.0)
    assert simulation.health("cloth").resets == 0


@pytest.mark.parametrize(
    "solver", ["relaxation", "xpbd", pytest.param("implicit", marks=pytest.mark.slow)]
)
def test_what_is_behind_a_slow_limb_is_pulled_back(cloth, solver):
    """A few particles that an armpit spat out behind the arm are not kept there, stretched."""
    vertices, triangles = cloth.grid(12, 8, 0.025)
    hung = np.stack([0.0 * vertices[:, 0] + 0.04, vertices[:, 1], -vertices[:, 0]], axis=1)
    simulation = Simulation(
        (cloth.garment(hung, triangles, pins=[*range(8), *range(88, 96)]),),
        cloth.colliders(limb("capsule")),
        solver=solver,
        solver_step=STEP,
    )
    at = poses("capsule", 0.0)
    at.position[1, 2] = -0.0125
    simulation.reset(at)
    state, model = simulation.state("cloth"), simulation.model("cloth")
    spat = np.isin(model.vertex, 8 * np.array([[5], [6], [7]]) + np.arange(2, 6))
    state.x[spat, 0] = -0.035 - simulation.origin[0]
    for _ in range(10):
        simulation.advance(at, at, 1 / 60)
    assert simulation.positions("cloth")[:, 0].min() > 0.0
    assert simulation.health("cloth").resets == 0
