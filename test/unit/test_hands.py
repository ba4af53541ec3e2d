"""Hands that are leaned on bend at the wrist, and forearms are lifted out of the ground."""

import dataclasses
import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.hands import Hands
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.mocap.walk import walk

SIDES = ("left", "right")
ARM = ("UpperArm", "LowerArm", "Hand")
WALK = walk()


@pytest.fixture(scope="module", params=["mannequin", "mh_female_young.glb", "CesiumMan.glb"])
def body(request, data_file):
    name = request.param
    return load_body(name if name == "mannequin" else data_file("bodies", name))


@pytest.fixture(scope="module")
def retargeter(body):
    return Retargeter(WALK.rig, body, reference=WALK.source_reference)


def joint(body, bone):
    return body.rig.index(body.humanoid[bone])


def turned(T, joints, at, a, b):
    """Joints turned about a place by the smallest rotation from one direction to another."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    v = np.cross(a, b)
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    R = np.eye(3) + skew + skew @ skew / (1.0 + a @ b)
    T[joints, :3, 3] = (T[joints, :3, 3] - at) @ R.T + at
    T[joints, :3, :3] = R @ T[joints, :3, :3]


def leaning(body, wrists, bend=20.0):
    """Arms straight down but for a bend of the elbows, and the wrists at a height [m]."""
    T = rest_transforms(body.rig).copy()
    for side in SIDES:
        upper, lower, hand = (joint(body, side + bone) for bone in ARM)
        ahead = np.radians(bend)
        for j, end, way in (
            (upper, lower, [0.0, 0.0, -1.0]),
            (lower, hand, [np.sin(ahead), 0.0, -np.cos(ahead)]),
        ):
            below = np.flatnonzero(body.rig.below(j))
            turned(T, below, T[j, :3, 3].copy(), T[end, :3, 3] - T[j, :3, 3], np.array(way))
    T[:, 2, 3] += wrists - T[joint(body, "leftHand"), 2, 3]
    return T


def lifted(retargeter, T, elbows=0.3):
    """With a source whose elbows are at a height [m]."""
    T, T_source = T.copy(), np.tile(np.eye(4), (len(WALK.rig), 1, 1))
    T_source[:, 2, 3] = elbows
    retargeter.hands.lift(T_source, T)
    return T


def lowest(body, T, bone):
    """Height of the lowest skin that one bone and what is beyond it move [m]."""
    skin = body.skin
    main = skin.bone[np.arange(len(skin.bone)), skin.weight.argmax(axis=1)]
    mine = body.rig.below(joint(body, bone))[main]
    if bone.endswith("LowerArm"):
        mine &= ~body.rig.below(joint(body, bone.replace("LowerArm", "Hand")))[main]
    return Skinner(skin).vertices(T)[mine, 2].min()


def fingers(body, T, side):
    """Unit vector from a wrist to the middle of the hand's skin."""
    skin = body.skin
    main = skin.bone[np.arange(len(skin.bone)), skin.weight.argmax(axis=1)]
    hand = joint(body, f"{side}Hand")
    mine = body.rig.below(hand)[main]
    way = Skinner(skin).vertices(T)[mine].mean(axis=0) - T[hand, :3, 3]
    return way / np.linalg.norm(way)


def test_arms_over_the_ground_are_left_as_they_are(body, retargeter):
    T = leaning(body, 0.4)
    assert (lifted(retargeter, T) == T).all()


@pytest.mark.parametrize("wrists", [0.12, 0.08, 0.05])
def test_hands_come_out_of_the_ground(body, retargeter, wrists):
    T = leaning(body, wrists)
    assert lowest(body, T, "leftHand") < -0.01
    got = lifted(retargeter, T)
    hands = [joint(body, f"{side}Hand") for side in SIDES]
    for side in SIDES:
        assert lowest(body, got, f"{side}Hand") > -0.01
        # It bends towards its back: the fingers do not come under the arm.
        before, after = fingers(body, T, side), fingers(body, got, side)
        assert before @ after < np.cos(np.radians(10.0))
        out = 1.0 if side == "left" else -1.0
        ahead_or_out = np.array([1.0, out, 0.0])
        assert (after - before) @ ahead_or_out > 0.05
    far = np.setdiff1d(np.arange(len(T)), np.flatnonzero(retargeter.hands._arms.part.max(0) >= 0))
    assert (got[far] == T[far]).all()
    if lowest(body, T, "leftLowerArm") > 0.02 and lowest(body, T, "rightLowerArm") > 0.02:
        np.testing.assert_allclose(got[hands, :3, 3], T[hands, :3, 3], atol=6e-3)


@pytest.mark.parametrize("wrists", [0.0, -0.08])
def test_elbows_bend_for_wrists_that_are_in_the_ground(body, retargeter, wrists):
    T = leaning(body, wrists)
    got = lifted(retargeter, T)
    for side in SIDES:
        assert lowest(body, got, f"{side}LowerArm") > -0.015
        arm = [joint(body, side + bone) for bone in ARM]
        lengths = [np.linalg.norm(np.diff(P[arm, :3, 3], axis=0), axis=1) for P in (T, got)]
        np.testing.assert_allclose(*lengths, atol=1e-9)
        # The hand stays over its place.
        np.testing.assert_allclose(got[arm[2], :2, 3], T[arm[2], :2, 3], atol=1e-6)
    R = got[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.eye(3) + 0 * R, atol=1e-9)


def test_a_deep_source_is_somewhere_else(body, retargeter):
    T = leaning(body, -0.05)
    assert (lifted(retargeter, T, elbows=-1.0) == T).all()


def test_a_hand_turns_as_it_goes_down(body, retargeter):
    """A millimetre deeper turns it by some degrees at most, but where it first touches the ground
    straight: fingers that point down come up by a millimetre only as they turn by more."""
    ways = [
        fingers(body, lifted(retargeter, leaning(body, wrists)), "left")
        for wrists in np.arange(0.3, 0.02, -0.001)
    ]
    cosines = [np.clip(a @ b, -1.0, 1.0) for a, b in itertools.pairwise(ways)]
    steps = np.sort(np.degrees(np.arccos(cosines)))
    assert steps[-1] < 20.0
    assert steps[-3] < 6.0
    assert np.degrees(np.arccos(ways[0] @ ways[-1])) > 40.0


def test_a_hand_on_its_edge_does_not_whip(body, retargeter):
    """Level, at 4 cm, and rolled about the forearm: from palm down over its edge to palm up."""
    T = leaning(body, 0.04, bend=90.0)
    hand = joint(body, "leftHand")
    below = np.flatnonzero(body.rig.below(hand))
    way = fingers(body, T, "left")
    ways = []
    for roll in np.radians(np.arange(0.0, 360.0, 2.0)):
        P = T.copy()
        R = Rotation.from_rotvec(roll * way).as_matrix()
        P[below, :3, 3] = (P[below, :3, 3] - P[hand, :3, 3]) @ R.T + P[hand, :3, 3]
        P[below, :3, :3] = R @ P[below, :3, :3]
        got = lifted(retargeter, P)
        assert lowest(body, got, "leftHand") > -0.01
        ways.append(fingers(body, got, "left"))
        assert ways[-1] @ way > -0.2  # not folded back over the arm
    cosines = [np.clip(a @ b, -1.0, 1.0) for a, b in itertools.pairwise(ways)]
    assert np.degrees(np.arccos(cosines)).max() < 20.0


def test_a_body_without_hands_is_left_as_it_is(body):
    humanoid = {b: j for b, j in body.humanoid.items() if not b.endswith("Hand")}
    cut = dataclasses.replace(body, humanoid=humanoid)
    retargeter = Retargeter(WALK.rig, cut, reference=WALK.source_reference)
    assert isinstance(retargeter.hands, Hands)
    T = leaning(body, -0.05)
    assert (lifted(retargeter, T) == T).all()
