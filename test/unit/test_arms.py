"""Arms that a source's motion puts into the trunk are turned out of it."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.arms import Arms
from garment_sim_ros.body.kinematics import rest_transforms, world_from_local
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.mocap.clip_poses import retargeter
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler

TRUNK = ("hips", "spine", "chest", "upperChest", "leftUpperLeg", "rightUpperLeg")


class Depth:
    """How far the bones of the arms are in convex hulls of the posed skin, made anew each time."""

    def __init__(self, body):
        bones = major_bones(body)
        main = body.skin.bone[np.arange(len(body.skin.vertices)), body.skin.weight.argmax(axis=1)]
        owner = [bones.names[k] for k in bones.owner[main]]
        self.body, self.skinner = body, Skinner(body.skin)
        self.groups = [
            np.flatnonzero([name == body.humanoid.get(bone) for name in owner]) for bone in TRUNK
        ]

    def of(self, T):
        """The deepest point of both lower arms and hands [m]; negative where all are outside."""
        skin = self.skinner.vertices(T)
        joint = {b: T[self.body.rig.index(j), :3, 3] for b, j in self.body.humanoid.items()}
        share = np.linspace(0.0, 1.3, 9)[:, None]
        points = np.concatenate(
            [
                (1.0 - share) * joint[f"{side}LowerArm"] + share * joint[f"{side}Hand"]
                for side in ("left", "right")
            ]
        )
        depths = [-np.inf]
        for group in self.groups:
            if len(group) > 8:
                planes = ConvexHull(skin[group]).equations
                depths.append(-(points @ planes[:, :3].T + planes[:, 3]).max(axis=1).min())
        return max(depths)


@pytest.mark.parametrize("name", ["mannequin", "mh_female_young.glb", "CesiumMan.glb"])
def test_forearms_beside_the_hips_stay_beside_them(name, data_file):
    body = load_body(name if name == "mannequin" else data_file("bodies", name))
    clip = load_clip(data_file("mocap", "cmu_131_03_hop_spin.bvh"))
    to_body, sampler, depth = retargeter(clip, body), ClipSampler(clip), Depth(body)
    before, after, turns = [], [], []
    for k in range(180):
        q = sampler.sample(k / 60.0)
        T = to_body.world_joints(q, k / 60.0).copy()
        turns.append(to_body.arms.turn.copy())
        if k % 15 == 0:
            after.append(depth.of(T))
            before.append(depth.of(to_body.world_joints(q, k / 60.0, clear_arms=False)))
    assert max(before) > 0.01  # bones, that is, not only skin
    assert max(after) < 0.0
    change = np.linalg.norm(np.diff(turns, axis=0), axis=2)
    assert change.max() <= 20.0 / 60.0 + 1e-9
    assert np.linalg.norm(turns, axis=2).max() < np.radians(40.0)


@pytest.mark.parametrize("name", ["mannequin", "mh_female_young.glb", "CesiumMan.glb"])
def test_fingers_and_thumbs_leave_room_for_cloth(name, data_file):
    # Spread fingers pass the hips of this walk; the line from wrist to tip is far from some.
    body = load_body(name if name == "mannequin" else data_file("bodies", name))
    clip = load_clip(data_file("mocap", "deepmimic_walk.bvh"))
    to_body, sampler, skinner = retargeter(clip, body), ClipSampler(clip), Skinner(body.skin)
    main = body.skin.bone[np.arange(len(body.skin.vertices)), body.skin.weight.argmax(axis=1)]

    def moved_by(bone):
        return body.rig.below(body.rig.index(body.humanoid[bone]))[main]

    arms = moved_by("leftUpperArm") | moved_by("rightUpperArm")
    hands = moved_by("leftHand") | moved_by("rightHand")
    trunk = body.skin.triangles[~arms[body.skin.triangles].any(axis=1)]
    least = {True: np.inf, False: np.inf}
    for k in range(0, 74, 4):
        for clears in least:
            T = to_body.world_joints(sampler.sample(k / 60.0), k / 60.0, clear_arms=clears)
            skin = skinner.vertices(T)
            away = MeshDistance(skin, trunk).signed_distance(skin[hands])[0]
            least[clears] = min(least[clears], float(away.min()))
    assert least[True] > 0.02
    assert least[True] >= least[False]


def test_arms_that_are_clear_stay_as_they_are(data_file):
    body = load_body("mannequin")
    clip = load_clip(data_file("mocap", "deepmimic_run.bvh"))
    to_body = retargeter(clip, body)
    for k in range(0, 45, 5):
        q = ClipSampler(clip).sample(k / 60.0)
        T = to_body.world_joints(q, k / 60.0, ground_feet=False).copy()
        np.testing.assert_array_equal(T, to_body.world_joints(q))


@pytest.fixture(scope="module")
def mannequin():
    return load_body("mannequin")


def hand_in_hip(body, degrees):
    """The rest pose with the left arm turned towards the trunk."""
    T_local = body.rig.T_parent_joint.copy()
    joint = body.rig.index(body.humanoid["leftUpperArm"])
    R = rest_transforms(body.rig)[joint, :3, :3]
    turn = Rotation.from_euler("x", -degrees, degrees=True).as_matrix()
    T_local[joint, :3, :3] @= R.T @ turn @ R
    return world_from_local(body.rig, T_local)


def test_only_the_arm_that_is_inside_turns_and_only_as_far_as_it_must(mannequin):
    depth = Depth(mannequin)
    rig = mannequin.rig
    left = rig.index(mannequin.humanoid["leftUpperArm"])
    below = rig.below(left)
    turned = []
    for degrees in np.arange(20.0, 61.0, 2.0):
        T = hand_in_hip(mannequin, degrees)
        before, arms = T.copy(), Arms(mannequin)
        arms.clear(T, 0.0)
        np.testing.assert_array_equal(T[~below], before[~below])
        turned.append(np.degrees(np.linalg.norm(arms.turn[0])))
        assert depth.of(T) < 0.0
        # The arm keeps its shape, and the shoulder its place.
        np.testing.assert_allclose(T[left, :3, 3], before[left, :3, 3], atol=1e-12)
        was, now = (np.linalg.inv(x[left]) @ x[below] for x in (before, T))
        np.testing.assert_allclose(now, was, atol=1e-9)
    # An arm that goes in by two degrees more is turned by about as much more.
    assert turned[0] == 0.0
    assert turned[-1] > 15.0
    assert np.abs(np.diff(turned)).max() < 6.0


def test_what_was_before_is_forgotten(mannequin):
    known, new = Arms(mannequin), Arms(mannequin)
    known.clear(hand_in_hip(mannequin, 60.0), 0.0)
    known.forget()
    for time in (0.01, 5.0, 4.0):  # after a while, and back in time, too
        known.clear(a := hand_in_hip(mannequin, 50.0), time)
        new.clear(b := hand_in_hip(mannequin, 50.0), time)
        np.testing.assert_array_equal(a, b)
    new.clear(hand_in_hip(mannequin, 0.0), 4.01)
    assert np.linalg.norm(new.turn[0]) > 0.0  # on its way back


@pytest.mark.parametrize("name", ["mannequin", "mh_female_young.glb", "CesiumMan.glb"])
def test_a_thigh_that_is_kicked_up_takes_the_hand_along(name, data_file):
    # The left hand of this dancer is in the thigh by centimetres, in kicks of a tenth of a second.
    body = load_body(name if name == "mannequin" else data_file("bodies", name))
    clip = load_clip(data_file("mocap", "rokoko_jesse_dance.bvh"))
    to_body, sampler, depth = retargeter(clip, body), ClipSampler(clip), Depth(body)
    before, after, turns = [], [], []
    for k in range(180):
        q = sampler.sample(k / 60.0)
        after.append(depth.of(to_body.world_joints(q, k / 60.0).copy()))
        turns.append(to_body.arms.turn.copy())
        before.append(depth.of(to_body.world_joints(q, k / 60.0, clear_arms=False)))
    assert max(before) > 0.03
    assert max(after) < 0.0
    # It is moved smoothly: what the turn changes by changes by little.
    jerk = np.linalg.norm(np.diff(turns, 2, axis=0), axis=2)
    assert np.percentile(jerk, 99.0) < np.radians(3.0)


def test_the_turn_goes_with_the_trunk(mannequin):
    def turned(angle):
        """The whole body about the vertical."""
        T = np.eye(4)
        T[:3, :3] = Rotation.from_euler("z", angle).as_matrix()
        return T

    arms, steady = Arms(mannequin), Arms(mannequin)
    pose = hand_in_hip(mannequin, 55.0)
    for k in range(30):
        spun, stands = turned(0.2 * k) @ pose, pose.copy()
        arms.clear(spun, k / 60.0)
        steady.clear(stands, k / 60.0)
        np.testing.assert_allclose(np.linalg.inv(turned(0.2 * k)) @ spun, stands, atol=1e-9)


def test_an_arm_comes_home_and_slowly_begins_to(mannequin):
    arms = Arms(mannequin)
    arms.clear(hand_in_hip(mannequin, 60.0), 0.0)
    turns = [np.linalg.norm(arms.turn[0])]
    for k in range(1, 30):
        arms.clear(hand_in_hip(mannequin, 0.0), k / 60.0)
        turns.append(np.linalg.norm(arms.turn[0]))
    assert turns[0] > np.radians(15.0)
    assert turns[-1] == 0.0
    steps = -np.diff(turns)
    assert (steps >= 0.0).all()
    assert steps[0] < np.radians(0.5)
    assert steps.max() <= 4.0 / 60.0 + 1e-9
