"""Knees are opened where calves would be in thighs."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.knees import FREE, MOST, open_knees
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.mocap.walk import walk

SIDES = ("left", "right")


@pytest.fixture(scope="module", params=["mannequin", "mh_female_young.glb", "CesiumMan.glb"])
def body(request, data_file):
    name = request.param
    return load_body(name if name == "mannequin" else data_file("bodies", name))


@pytest.fixture(scope="module")
def feet(body):
    clip = walk()
    return Retargeter(clip.rig, body, reference=clip.source_reference).feet


def crouching(body, feet, knees, thighs=110.0):
    """The rest pose with thighs turned up and knees bent by so much [degrees], soles level."""
    T = rest_transforms(body.rig).copy()
    knees = knees - np.degrees(bends(T, feet))
    thighs = np.broadcast_to(thighs, 2)
    hips = [T[body.rig.index(body.humanoid[f"{side}UpperLeg"]), :3, 3] for side in SIDES]
    axis = (hips[0] - hips[1]) / np.linalg.norm(hips[0] - hips[1])
    for side, knee, thigh in zip(SIDES, knees, thighs):
        turns = {"UpperLeg": -thigh, "LowerLeg": knee, "Foot": thigh - knee}
        for bone, angle in turns.items():
            joint = body.rig.index(body.humanoid[side + bone])
            below = np.flatnonzero(body.rig.below(joint))
            at = T[joint, :3, 3].copy()
            R = Rotation.from_rotvec(np.radians(angle) * axis).as_matrix()
            T[below, :3, 3] = (T[below, :3, 3] - at) @ R.T + at
            T[below, :3, :3] = R @ T[below, :3, :3]
    return T


def on_the_ground(T, feet):
    T[:, 2, 3] -= soles(T, feet).min()
    return T


def soles(T, feet):
    """Heights of the soles' points."""
    at = T[feet.soles.joint]
    return (at[:, 2, :3] * feet.soles.offset).sum(axis=1) + at[:, 2, 3]


def legs(T, feet):
    """Hips, knees and ankles, shape [2, 3, 3]."""
    return T[feet.legs.joints][:, :, :3, 3]


def bends(T, feet):
    hip, knee, ankle = np.swapaxes(legs(T, feet), 0, 1)
    thigh, shank = knee - hip, ankle - knee
    cosine = (thigh * shank).sum(axis=1)
    cosine /= np.linalg.norm(thigh, axis=1) * np.linalg.norm(shank, axis=1)
    return np.arccos(cosine)


def opened(T, feet, stands):
    T = T.copy()
    open_knees(T, feet.legs, feet.soles, np.array(stands, float))
    return T


@pytest.mark.parametrize("bend", [0.0, 60.0, 120.0])
def test_other_knees_are_left_as_they_are(body, feet, bend):
    T = crouching(body, feet, (bend, bend))
    assert (bends(T, feet) < FREE).all()
    assert (opened(T, feet, (1, 0)) == T).all()


@pytest.mark.parametrize("stands", [(1, 1), (0, 0), (0.5, 0.5), (1, 0)])
@pytest.mark.parametrize("bend", [140.0, 155.0, 165.0])
def test_no_knee_bends_farther_than_flesh_lets_it(body, feet, stands, bend):
    T = on_the_ground(crouching(body, feet, (bend, bend)), feet)
    np.testing.assert_allclose(bends(T, feet), np.radians(bend), atol=0.07)
    got = opened(T, feet, stands)
    assert (bends(got, feet) < MOST + np.radians(1.0)).all()
    bones = np.linalg.norm(np.diff(legs(T, feet), axis=1), axis=2)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(legs(got, feet), axis=1), axis=2), bones, atol=1e-9
    )
    assert soles(got, feet).min() > soles(T, feet).min() - 1e-9


def test_feet_that_stand_stay_and_the_body_rises(body, feet):
    T = on_the_ground(crouching(body, feet, (158.0, 158.0)), feet)
    got = opened(T, feet, (1, 1))
    foot = feet.legs.part.max(axis=0) == 2
    np.testing.assert_allclose(got[foot], T[foot], atol=1e-9)
    hips = body.rig.index(body.humanoid["hips"])
    assert got[hips, 2, 3] > T[hips, 2, 3] + 0.02
    np.testing.assert_allclose(got[hips, :3, :3], T[hips, :3, :3], atol=1e-12)


def test_feet_on_both_sides_of_the_body_do_not_push_it_to_and_fro(body, feet):
    """One foot is ahead of the hips, one behind: what one pushes away it pushes to the other."""
    T = crouching(body, feet, (165.0, 165.0), thighs=(170.0, 20.0))
    behind, ahead = (x[2] - x[0] for x in legs(T, feet)[::-1])
    assert ahead @ behind < 0.0
    assert (bends(opened(T, feet, (1, 1)), feet) < MOST + np.radians(1.0)).all()


@pytest.mark.parametrize("thighs", [170.0, 200.0, 230.0])
def test_the_body_is_not_pushed_down(body, feet, thighs):
    """Feet are over the hips of somebody who lies on the back."""
    T = crouching(body, feet, (160.0, 160.0), thighs=thighs)
    hips = body.rig.index(body.humanoid["hips"])
    assert opened(T, feet, (1, 1))[hips, 2, 3] >= T[hips, 2, 3]


def test_feet_in_the_air_go_away_from_a_body_that_stays(body, feet):
    T = crouching(body, feet, (158.0, 60.0), thighs=20.0)
    T[:, 2, 3] += 1.0
    got = opened(T, feet, (0, 0))
    still = feet.legs.part.max(axis=0) < 0
    assert (got[still] == T[still]).all()
    np.testing.assert_allclose(legs(got, feet)[1], legs(T, feet)[1], atol=1e-9)
    away = [np.linalg.norm(x[0, 2] - x[0, 0]) for x in (legs(T, feet), legs(got, feet))]
    assert away[1] > away[0] + 0.02


def test_it_comes_and_goes_smoothly(body, feet):
    """From one degree to the next a joint is moved by 2 cm more or less at most."""
    before = None
    for bend in np.arange(100.0, 166.0):
        T = on_the_ground(crouching(body, feet, (bend, bend)), feet)
        step = opened(T, feet, (0.7, 0.3)) - T
        if before is not None:
            assert np.linalg.norm((step - before)[:, :3, 3], axis=1).max() < 0.02
        before = step
