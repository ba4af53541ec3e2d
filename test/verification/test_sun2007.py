"""The preset sun2007: the first paper's colliders, pins and step, put on and simulated."""

from collections import Counter

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.contact.papers.rays.tables import ray_tables
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment import attachments, dressing
from garment_sim_ros.presets import preset_values

PRESET = "sun2007"


@pytest.fixture(scope="module")
def avatar():
    return gs.Avatar.load("mannequin", preset=PRESET, cache=False)


@pytest.fixture(scope="module")
def outfit(avatar):
    return avatar.dress("tshirt_short_skirt")


def test_shapes_are_fourteen_hulls_and_a_sphere_at_each_of_their_joints(avatar):
    shapes = [c for c in avatar.colliders.colliders if not c.is_frame]
    assert Counter(c.kind for c in shapes) == {"hull": 14, "sphere": 13}
    for c in shapes:
        if c.kind == "hull":
            assert 116 <= len(c.geometry["faces"]) < 120  # four go at a time, down to the floor
        else:
            np.testing.assert_array_equal(c.position, 0.0)  # about the joint
    assert avatar.colliders.thickness == 0.0
    assert len(ray_tables(avatar.colliders).box) == 14


def test_spheres_hold_the_skin_that_bends(avatar):
    body, flexible = avatar.body, preset_values(PRESET, "collider_node")["flexible"]
    elbow = body.rig.index(body.humanoid["leftLowerArm"])
    weight = np.where(body.skin.bone == elbow, body.skin.weight, 0.0).sum(axis=1)
    hand = body.rig.index(body.humanoid["leftHand"])
    weight += np.where(body.skin.bone == hand, body.skin.weight, 0.0).sum(axis=1)
    bends = (weight > flexible) & (weight < 1.0 - flexible)
    assert bends.sum() > 10
    sphere = next(c for c in avatar.colliders.colliders if c.name == "joint_leftLowerArm")
    at = avatar.colliders.colliders.index(sphere)
    away = np.linalg.norm(avatar.skin()[bends] - avatar.poses().position[at], axis=1)
    assert away.max() < sphere.geometry["radius"]


def test_a_shirt_is_put_on_and_held_at_shoulders_and_upper_arms(avatar, outfit):
    shirt = next(g for g in outfit.garments if g.name == "tshirt")
    held = Counter(shirt.frames[f] for f in shirt.pin_frame)
    assert held["leftUpperArm"] >= 2
    assert held["rightUpperArm"] >= 2
    assert held["upperChest"] >= 6
    assert shirt.skin_limits == {}
    usual = gs.Avatar(avatar.body, avatar.colliders).dress("tshirt_short_skirt")
    other = next(g for g in usual.garments if g.name == "tshirt")
    assert len(other.pins) == 6
    assert list(other.skin_limits) == ["max_distance"]


def test_pins_stay_on_a_shirt_that_colliders_lift_off_the_shoulders(avatar, monkeypatch):
    asked = []

    def lifted(measures, mesh):
        asked.append(mesh)
        if len(asked) == 1:
            raise GeometryError("the garment does not lie on the shoulders")
        return np.array([1, 2, 3], np.int32)

    monkeypatch.setattr(attachments, "shoulder_pins", lifted)
    assert attachments.lifted_shoulder_pins(None, "let out", "cut").tolist() == [1, 2, 3]
    assert asked == ["let out", "cut"]
    assert dressing.lifted_shoulder_pins is attachments.lifted_shoulder_pins


def test_the_skin_is_blended_about_the_joints(avatar):
    T = next(avatar.joints("walk", seconds=0.0)).copy()
    body = avatar.body
    expected = Skinner(body.skin, "bone_blend", body.rig.parent).vertices(T)
    np.testing.assert_array_equal(avatar.skin(T), expected)
    assert np.abs(expected - Skinner(body.skin).vertices(T)).max() > 1e-3


def test_steps_are_as_printed_and_nothing_else_acts(avatar, outfit):
    simulation = gs.Simulation(outfit, avatar.colliders, preset=PRESET)
    assert simulation.solver == "relaxation"
    assert simulation.solver_step == 0.033
    settings = simulation.parameters.settings
    assert (settings.sweeps, settings.contact, settings.extras) == (3, "rays", False)
    assert simulation.parameters.environment.root_linear_inertia == 0.0
    hips = avatar.colliders.colliders[avatar.colliders.root]
    assert hips.bone == avatar.body.humanoid["hips"]
    for poses in avatar.play("walk", rate=1 / 0.033, seconds=0.4):
        simulation.step(poses, dt=0.033)
    for name in simulation.names:
        assert np.isfinite(simulation.positions(name)).all()
        health = simulation.health(name)
        assert health.contacts > 100
        assert (health.resets, health.rewound, health.tangled) == (0, 0, 0)


def test_the_step_of_their_fig_10_is_finite(avatar, outfit):
    """0.33 s, ten times their other one: cloth falls by half a metre in it."""
    simulation = gs.Simulation(outfit, avatar.colliders, preset=PRESET, solver_step=0.33)
    for poses in avatar.play("walk", rate=1 / 0.33, seconds=6.6):
        simulation.step(poses, dt=0.33)
        x = np.concatenate([simulation.positions(name) for name in simulation.names])
        assert np.isfinite(x).all()
        assert np.abs(x - poses.position[avatar.colliders.root]).max() < 100.0
    assert all(simulation.health(n).resets == 0 for n in simulation.names)
    assert all(simulation.health(n).recovered == 0 for n in simulation.names)


def test_a_moving_root_leaves_no_trace(avatar, outfit):
    """Relative simulation: the same pose carried along gives the same cloth."""
    places = []
    for way in (0.0, 0.1):
        simulation = gs.Simulation(outfit, avatar.colliders, preset=PRESET)
        T = next(avatar.joints("walk", seconds=0.0)).copy()
        simulation.reset(avatar.poses(T), settle=False)
        for _ in range(5):
            T[:, 0, 3] += way
            simulation.step(avatar.poses(T), dt=0.033)
        places.append(simulation.positions("skirt") - [5 * way, 0.0, 0.0])
    np.testing.assert_allclose(places[0], places[1], atol=1e-3)
