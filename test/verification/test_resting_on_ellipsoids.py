"""Garments on ellipsoids, which are thin and lie in the skin: they begin outside, and rest."""

import numpy as np
import pytest

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.collider_params import ELLIPSOIDS
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.union import union_distance
from garment_sim_ros.garment import letting_out
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.params import ColliderOptions
from garment_sim_ros.sim.simulation import Simulation
from test.particles import simulated

FRAME = 1 / 60


@pytest.fixture(scope="module")
def ellipsoids():
    body = load_body("mannequin")
    colliders = fit_colliders(body, ColliderOptions(method=ELLIPSOIDS))
    return body, colliders, ColliderPoser(colliders, body).poses(rest_transforms(body.rig)).copy()


def skirt_on(body, colliders):
    outfit = load_outfit("tshirt_short_skirt", body, colliders=colliders)
    return next(g for g in outfit.garments if g.name == "skirt")


def depths(garment, colliders, poses):
    """Distances of its vertices from the union of the shapes [m]."""
    shapes = pack(colliders)
    posed = PosedShapes.room_for(shapes)
    pose(shapes, poses, poses, np.zeros(3), posed)
    distance = np.empty(len(garment.vertices), np.float32)
    points = garment.vertices.astype(np.float32)
    union_distance(shapes, posed, points, -1, np.float32(0.1), distance)
    return distance


def speed(garment, colliders, poses):
    """RMS speed in the third second [m/s]."""
    simulation = Simulation(garment, colliders)
    simulation.reset(poses)
    squares, before = [], None
    for n in range(180):
        simulation.step(poses, FRAME)
        x = simulated(simulation, garment.name)
        if n >= 120:
            squares.append((np.linalg.norm(x - before, axis=1) ** 2).mean())
        before = x
    return np.sqrt(np.mean(squares)) / FRAME


def test_a_skirt_begins_outside_of_thin_shapes_and_rests(ellipsoids, monkeypatch):
    skirt = skirt_on(*ellipsoids[:2])
    assert (depths(skirt, *ellipsoids[1:]) < -0.001).sum() <= 3
    assert speed(skirt, *ellipsoids[1:]) < 0.005

    # By the short way out of the nearest shape alone it is left in them, and shakes: by 12 to
    # 55 mm/s from starts that differ by micrometres, instead of 0.1.
    monkeypatch.setattr(letting_out, "_STEPS", 0)
    inside = skirt_on(*ellipsoids[:2])
    assert (depths(inside, *ellipsoids[1:]) < -0.001).sum() > 20
    assert speed(inside, *ellipsoids[1:]) > 0.005


def test_what_does_not_get_out_that_way_stays_where_it_is(ellipsoids, monkeypatch):
    """As between the legs: a few steps lead nowhere, and nothing ends half-way."""
    body, colliders, poses = ellipsoids
    monkeypatch.setattr(letting_out, "_STEPS", 0)
    before = skirt_on(body, colliders)
    monkeypatch.setattr(letting_out, "_STEPS", 1)
    after = skirt_on(body, colliders)
    inside = depths(before, colliders, poses) < -0.005
    assert inside.any()
    moved = np.linalg.norm(after.vertices - before.vertices, axis=1)[inside]
    assert moved == pytest.approx(0.0, abs=1e-3)
