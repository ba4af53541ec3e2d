"""Cloth that a distance limit pulls against a body rests; contacts hold from step to step."""

import dataclasses
import itertools

import numpy as np
import pytest
from naive import naive
from particles import simulated
from scipy.spatial.transform import Rotation

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.sim.simulation import Simulation

FRAME = 1 / 60
GEOMETRY = {
    "sphere": {"radius": 0.08},
    "capsule": {"radius0": 0.08, "radius1": 0.08, "length": 0.5},
}

TILT = Rotation.from_quat([0.5, -0.3, 0.7, 0.2])


def dressed(cloth, kind, sheets):
    """Sheets, the inner one first, and one shape; `xpbd`."""
    shape = Collider(name="body", kind=kind, bone="body", geometry=GEOMETRY[kind])
    return Simulation(sheets, cloth.colliders(shape), solver="xpbd", solver_step=FRAME)


def sheet(cloth, n, height, limit=None, pins=(), **options):
    vertices, triangles = cloth.grid(n, n)
    vertices[:, 2] = height
    garment = cloth.garment(vertices, triangles, pins, **options)
    distance = None if limit is None else np.full(len(vertices), limit)
    return dataclasses.replace(
        garment, skin_limits={} if distance is None else {"max_distance": distance}
    )


@pytest.mark.parametrize(
    ("kind", "limit", "deep", "friction"),
    [
        ("sphere", 0.0, 0.05, 0.5),
        ("sphere", 0.02, 0.02, 0.5),
        ("sphere", 0.02, 0.05, 0.0),
        ("capsule", 0.02, 0.05, 0.0),
        ("capsule", 0.02, 0.02, 0.5),
        ("sphere", 0.02, 0.05, 0.5),
        ("capsule", 0.02, 0.05, 0.5),
    ],
)
def test_cloth_whose_places_are_in_a_body_rests_on_it(cloth, kind, limit, deep, friction):
    """The body is `deep` through the plane that the sheet's places are in, out of reach."""
    garment = sheet(cloth, 9, 0.0, limit, friction=friction, damping=1.0, air_drag=0.05)
    simulation = dressed(cloth, kind, (garment,))
    poses = ColliderPoses.identity(2)
    poses.position[1] = [0.0, 0.0, deep - 0.08]
    if kind == "capsule":
        poses.position[1, 1] = 0.25
        poses.orientation[1] = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
    simulation.reset(poses)
    speeds = []
    for _ in range(150):
        before = simulated(simulation)
        simulation.advance(poses, poses)
        x = simulated(simulation)
        # Pulled into the body, particles have a velocity within a step, and get nowhere.
        speeds.append(np.sqrt(((x - before) ** 2).sum(axis=1).mean()) / FRAME)
    assert max(speeds[-20:]) < 1e-3
    body = simulation.collider_set.colliders[1]
    shape = body, poses.position[1], matrix_from_quaternion(poses.orientation[1:])[0]
    # Contact wins: nothing is nearer than its thickness, to rounding, nor lifted off.
    nearest = min(naive.signed_distance(shape, p)[0] for p in x)
    assert nearest == pytest.approx(garment.material.thickness, abs=2e-5)
    # The limit is tight, and overstretched where the body is in the way.
    assert simulation.health("cloth").held > 0
    away = np.linalg.norm(x - garment.vertices, axis=1)
    assert away.max() == pytest.approx(deep + garment.material.thickness, abs=1e-3)


@pytest.mark.parametrize(
    ("speed", "rate"), [(0.0, 0.0), (0.4, 0.0), (0.4, 0.7)], ids=["rest", "moves", "turns"]
)
@pytest.mark.parametrize(
    ("layers", "limit"), [(1, None), (1, 0.01), (2, None)], ids=["alone", "limited", "layers"]
)
def test_contacts_of_the_step_before_are_known(cloth, speed, rate, layers, limit):
    """A turned body, whose poses are rounded; steps of a frame, and several in one call."""
    options = {"pins": range(7), "friction": 0.5, "damping": 1.0}
    garments = [
        sheet(cloth, 7, 0.085 + 0.003 * k, limit, name=f"sheet {k}", **options)
        for k in range(layers)
    ]
    garments = [dataclasses.replace(g, layer=k) for k, g in enumerate(garments)]
    simulation = dressed(cloth, "capsule", garments)

    def at(time):
        poses = ColliderPoses.identity(2)
        poses.position[:] = np.array([0.1234, 0.3, 0.777]) + speed * time * np.array([0.8, 0.6, 0])
        turn = Rotation.from_rotvec([0.0, 0.0, rate * time])
        poses.orientation[:] = turn.as_quat(), (turn * TILT).as_quat()
        return poses

    simulation.reset(at(0.0))
    simulation.advance(at(0.0), at(FRAME))
    contacts = []
    # Single steps, and two or three in one call.
    for start, end in itertools.pairwise([1, 2, 3, 4, 5, 7, 9, 12, 13]):
        simulation.advance(at(start * FRAME), at(end * FRAME), (end - start) * FRAME)
        for garment in simulation:
            assert garment.worn.workspace.known
        contacts.append(simulation.health("sheet 0").contacts)
    assert max(contacts) > 0
    # Sheets meet, and meet in the last sub-step, which is what could hide the contacts.
    assert all(pair.touch for pair in simulation.over(garments[-1].name))
    # What is put elsewhere knows nothing.
    simulation.transport(at(13 * FRAME), at(20 * FRAME))
    simulation.advance(at(20 * FRAME), at(21 * FRAME))
    known = [garment.worn.workspace.known for garment in simulation]
    assert any(known) == (speed == 0.0)
