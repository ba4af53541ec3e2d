"""Grounding of feet against its naive twin, from random poses."""

import itertools

import numpy as np
import pytest
from naive import naive_feet
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.feet_lock import hold, touch
from garment_sim_ros.body.feet_pass import ground, missed, watch
from garment_sim_ros.body.knees import open_knees
from garment_sim_ros.body.leg_reach import bend_leg
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.mocap.walk import walk


@pytest.fixture(scope="module", params=["mannequin:vertices=1500", "CesiumMan.glb"])
def feet(request, data_file):
    """The feet of a body, a pose of it, one of the source, and random numbers."""
    name = request.param
    body = load_body(name if name.startswith("mannequin") else data_file("bodies", name))
    clip = walk()
    retargeter = Retargeter(clip.rig, body, reference=clip.source_reference)
    return retargeter, clip


def poses_of(feet, seed):
    retargeter, clip = feet
    rng = np.random.default_rng(seed)
    q = clip.values[rng.integers(len(clip.values))] + rng.normal(
        scale=0.2, size=clip.values.shape[1]
    )
    T = retargeter.world_joints(q).copy()
    return retargeter.feet, retargeter._kinematics.from_dofs(q).copy(), T, rng


@pytest.mark.parametrize("seed", range(8))
def test_a_leg_is_bent_alike_and_reaches_its_goal(feet, seed):
    f, _, T, rng = poses_of(feet, seed)
    for i, joints in enumerate(f.legs.joints):
        goal = T[joints[2], :3, 3] + rng.normal(scale=0.1, size=3)
        expected = naive_feet.bend_leg(T, joints, f.legs.part[i], f.legs.hinge[i], goal)
        got = T.copy()
        bend_leg(got, joints, f.legs.part[i], f.legs.hinge[i], goal)
        np.testing.assert_allclose(got, expected, atol=1e-9)
        away = np.linalg.norm(goal - T[joints[0], :3, 3])
        if away < 0.999 * f.legs.reach[i]:
            np.testing.assert_allclose(got[joints[2], :3, 3], goal, atol=1e-9)
        np.testing.assert_allclose(got[joints[2], :3, :3], T[joints[2], :3, :3], atol=1e-12)
        R = got[:, :3, :3]
        np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.eye(3)[None] + 0 * R, atol=1e-9)
        for j, k in itertools.pairwise(joints):
            bone = [np.linalg.norm(P[k, :3, 3] - P[j, :3, 3]) for P in (got, T)]
            assert bone[0] == pytest.approx(bone[1], abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_knees_are_opened_alike(feet, seed):
    f, _, T, rng = poses_of(feet, seed)
    for i, joints in enumerate(f.legs.joints):
        hip, ankle = T[joints[0], :3, 3], T[joints[2], :3, 3]
        goal = hip + rng.uniform(0.1, 0.6) * (ankle - hip) + rng.normal(scale=0.02, size=3)
        T = naive_feet.bend_leg(T, joints, f.legs.part[i], f.legs.hinge[i], goal)
    for stands in (rng.uniform(size=2), np.zeros(2), np.ones(2)):
        got = T.copy()
        open_knees(got, f.legs, f.soles, stands)
        expected = naive_feet.open_knees(T, f.legs, f.soles, stands)
        np.testing.assert_allclose(got, expected, atol=1e-8)


@pytest.mark.parametrize("seed", range(8))
def test_contact_and_grounding_are_alike(feet, seed):
    f, T_source, T, rng = poses_of(feet, seed)
    joint, offset = f._joint.ravel(), f._offset.reshape(-1, 3)
    before = rng.normal(scale=0.01, size=(4, 3)) + T_source[joint, :3, 3]
    faded, standing = rng.uniform(size=4), f._standing.ravel() + rng.normal(scale=0.05, size=4)
    for dt in (-1.0, 0.0, 1 / 60):
        expected = naive_feet.watch(
            T_source, joint, offset, standing, dt, f._limits, before, faded
        )
        got = before.copy(), faded.copy(), np.zeros(4), np.zeros(4)
        watch(T_source, joint, offset, standing, dt, f._limits, *got)
        for a, b in zip(got, expected):
            np.testing.assert_allclose(a, b, atol=1e-9)
    weight = rng.uniform(size=(2, 2))
    arguments = (
        *(T_source, T, f._joint, f._offset, f.legs.joints[:, 2], f._target_offset, f.legs.ahead),
        *(f._stretch, f._scale, weight),
    )
    place = np.zeros((2, 2))
    missed(*arguments, place)
    np.testing.assert_allclose(place, naive_feet.missed(*arguments), atol=1e-12)
    for weights in (rng.uniform(size=(2, 4)), np.zeros((2, 4)), np.ones((2, 4))):
        arguments = (
            *(*f.legs, weights, place),
            *f.soles,
        )
        got = T.copy()
        ground(got, f.legs, f.soles, weights, place)
        np.testing.assert_allclose(got, naive_feet.ground(T, *arguments), atol=1e-8)


@pytest.mark.parametrize("seed", range(8))
def test_soles_are_held_alike_and_stay_where_they_were(feet, seed):
    f, T_source, T, rng = poses_of(feet, seed)
    places = np.array([T_source[j, :3, 3] for j in f._joint.ravel()]).reshape(2, 2, 3)
    places += rng.normal(scale=0.01, size=(2, 2, 3))
    for dt in (-1.0, 0.0, 1 / 60):
        state = places.copy(), rng.integers(2, size=(2, 2)).astype(float)
        contact = (T_source, f._joint, f._offset, f._standing, dt, f._touch_limits)
        expected = naive_feet.touch(*contact, *state)
        touch(*contact, *state)
        for a, b in zip(state, expected):
            np.testing.assert_allclose(a, b, atol=1e-12)
    for i in range(2):  # on the ground, for soles above it are not held
        points = slice(f.soles.start[i], f.soles.start[i + 1])
        at = T[f.soles.joint[points]]
        low = (at[:, 2, :3] * f.soles.offset[points]).sum(axis=1) + at[:, 2, 3]
        T[f.legs.part[i] >= 0, 2, 3] -= low.min()
    at = T[f.soles.joint]
    now = ((at[:, :3, :3] @ f.soles.offset[..., None])[..., 0] + at[:, :3, 3])[:, :2]
    for dt in (-1.0, 0.0, 1 / 120, 1 / 15):
        for held in (np.ones((2, 2)), rng.integers(2, size=(2, 2)).astype(float)):
            joints, part, hinge, _, reach = f.legs
            state = (
                now + rng.normal(scale=0.005, size=(2,)),
                rng.uniform(size=2),
                rng.normal(scale=0.03, size=(2, 2)),
            )
            *expected, slipped = naive_feet.hold(
                T, joints, part, hinge, reach, held, dt, *f.soles, *state
            )
            got = T.copy(), *(x.copy() for x in state)
            assert hold(got[0], f.legs, f.soles, held, dt, *got[1:]) == slipped
            for a, b in zip(got, expected):
                np.testing.assert_allclose(a, b, atol=1e-8)


def test_opposite_directions_do_not_break_a_leg(feet):
    f, _, T, _ = poses_of(feet, 0)
    upper = f.legs.joints[0, 0]
    for turn in Rotation.random(50, random_state=1):
        goal = T[upper, :3, 3] + turn.apply([0.0, 0.0, 0.3])
        got = T.copy()
        bend_leg(got, f.legs.joints[0], f.legs.part[0], f.legs.hinge[0], goal)
        assert np.isfinite(got).all()
