"""Trunks are bent back off thighs that are pressed into them."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.body.tucks import Tucks
from garment_sim_ros.mocap.clip_poses import retargeter
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from test.bodies import scaled

TRUNK = ("spine", "chest", "upperChest")
SIDES = ("left", "right")
DEEP = {"mannequin": 140.0, "mh_female_young": 125.0}
"""How far thighs are turned up that are deep in the trunk [degrees]."""


@pytest.fixture(scope="module", params=["mannequin", "mh_female_young.glb"])
def body(request, data_file):
    name = request.param
    return load_body(name if name == "mannequin" else data_file("bodies", name))


def joint(body, bone):
    return body.rig.index(body.humanoid[bone])


def of_legs(body):
    """Which joints are those of legs."""
    left, right = (body.rig.below(joint(body, f"{side}UpperLeg")) for side in SIDES)
    return left | right


def tucked(body, degrees):
    """The rest pose with both thighs turned up about the line between the hips."""
    T = rest_transforms(body.rig).copy()
    left, right = (joint(body, f"{side}UpperLeg") for side in SIDES)
    axis = T[left, :3, 3] - T[right, :3, 3]
    R = Rotation.from_rotvec(-np.radians(degrees) * axis / np.linalg.norm(axis)).as_matrix()
    for hip in (left, right):
        below = np.flatnonzero(body.rig.below(hip))
        at = T[hip, :3, 3].copy()
        T[below, :3, 3] = (T[below, :3, 3] - at) @ R.T + at
        T[below, :3, :3] = R @ T[below, :3, :3]
    return T


def depth(body, T):
    """How far the thighs' skin, but near the hips, is in convex hulls of the trunk's [m]."""
    bones = major_bones(body)
    main = body.skin.bone[np.arange(len(body.skin.vertices)), body.skin.weight.argmax(axis=1)]
    owner = np.array([bones.names[k] for k in bones.owner[main]])
    x = Skinner(body.skin).vertices(T)
    rest = np.asarray(body.skin.vertices, np.float64)
    R = rest_transforms(body.rig)
    thighs = []
    for side in SIDES:
        hip, knee = (R[joint(body, f"{side}{b}"), :3, 3] for b in ("UpperLeg", "LowerLeg"))
        share = (rest - hip) @ (knee - hip) / ((knee - hip) @ (knee - hip))
        thighs.append((owner == body.humanoid[f"{side}UpperLeg"]) & (share > 0.35))
    found = -np.inf
    for bone in TRUNK:
        group = owner == body.humanoid.get(bone)
        if np.count_nonzero(group) > 8:
            planes = ConvexHull(x[group]).equations
            inside = -(x[thighs[0] | thighs[1]] @ planes[:, :3].T + planes[:, 3]).max(axis=1)
            found = max(found, inside.max())
    return found


def test_thighs_end_up_as_deep_as_flesh_gives(body):
    tucks = Tucks(body)
    T = tucked(body, DEEP[body.name])
    assert depth(body, T) > 0.04
    before = T.copy()
    tucks.clear(T)
    assert 0.05 < tucks.bend < np.radians(30.0)
    # Spheres have 3 cm at most; they are about as thick as the thighs. The mannequin's are in its
    # hips, too, and come farther out of the trunk for that.
    assert depth(body, T) < 0.03
    assert depth(body, T) > 0.015 or body.name == "mannequin"
    # Legs are where they were; the head went backwards.
    legs = of_legs(body)
    below = ~legs & (before != T).any(axis=(1, 2))
    assert below[joint(body, "head")]
    assert (T[legs] == before[legs]).all()
    knee = T[joint(body, "leftLowerLeg"), :3, 3]
    head = joint(body, "head")
    assert np.linalg.norm(T[head, :3, 3] - knee) > np.linalg.norm(before[head, :3, 3] - knee)
    R = T[below, :3, :3]
    np.testing.assert_allclose(
        R @ np.swapaxes(R, 1, 2), np.tile(np.eye(3), (len(R), 1, 1)), atol=1e-9
    )


def middle_in_hips(body, T):
    """How far the line from hip joint to knee, but near the joint, is in the hips' hull [m]."""
    bones = major_bones(body)
    main = body.skin.bone[np.arange(len(body.skin.vertices)), body.skin.weight.argmax(axis=1)]
    owner = np.array([bones.names[k] for k in bones.owner[main]])
    x = Skinner(body.skin).vertices(T)
    planes = ConvexHull(x[owner == body.humanoid["hips"]]).equations
    found = -np.inf
    for side in SIDES:
        hip, knee = (T[joint(body, f"{side}{b}"), :3, 3] for b in ("UpperLeg", "LowerLeg"))
        way = hip + np.linspace(0.3, 1.0, 15)[:, None] * (knee - hip)
        found = max(found, -(way @ planes[:, :3].T + planes[:, 3]).max(axis=1).min())
    return found


def test_no_thigh_has_its_middle_in_the_hips(body):
    """No cloth fits between them then: the trunk alone may be bent, and they stay in the hips."""
    tucks = Tucks(body)
    before, after = [], []
    for degrees in np.arange(0.0, 146.0, 5.0):
        T = tucked(body, degrees)
        before.append(middle_in_hips(body, T))
        tucks.clear(T)
        after.append(middle_in_hips(body, T))
    assert max(after) < 0.0
    assert max(before) > 0.02 or body.name != "mannequin"


@pytest.mark.parametrize("degrees", [-30.0, -75.0, -110.0])
def test_thighs_behind_the_body_are_left_alone(body, degrees):
    """As in a split: bent back, the trunk would meet them."""
    tucks = Tucks(body)
    T = tucked(body, degrees)
    before = T.copy()
    tucks.clear(T)
    assert (before == T).all()


@pytest.mark.parametrize("factor", [0.05, 1e3])
def test_it_is_the_same_at_any_size(body, factor):
    large = scaled(body, factor)
    for degrees in (DEEP[body.name], -110.0):
        bends = []
        for one in (body, large):
            tucks = Tucks(one)
            tucks.clear(tucked(one, degrees))
            bends.append(tucks.bend)
        assert bends[0] == pytest.approx(bends[1], abs=1e-6)


def test_a_body_bends_by_60_degrees_at_most(body):
    tucks = Tucks(body)
    tucks.clear(tucked(body, 175.0))
    assert np.radians(45.0) < tucks.bend <= np.radians(60.0) + 1e-12


def test_the_bend_comes_and_goes_evenly(body):
    tucks = Tucks(body)
    bends = []
    for degrees in np.arange(60.0, 136.0, 1.0):
        tucks.clear(tucked(body, degrees))
        bends.append(np.degrees(tucks.bend))
    assert bends[0] == 0.0
    assert np.abs(np.diff(bends)).max() < 4.0
    assert np.diff(bends).min() > -0.5


def test_it_is_the_same_wherever_the_body_is(body):
    tucks = Tucks(body)
    T = tucked(body, DEEP[body.name])
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec([1.0, -2.0, 0.7]).as_matrix()
    turn[:3, 3] = 10.0, -20.0, 3.0
    moved = turn @ T
    tucks.clear(T)
    bend = tucks.bend
    tucks.clear(moved)
    assert tucks.bend == pytest.approx(bend, abs=1e-9)
    np.testing.assert_allclose(moved, turn @ T, atol=1e-9)


@pytest.mark.parametrize(
    "clip", ["deepmimic_walk.bvh", "deepmimic_run.bvh", "rokoko_jesse_dance.bvh"]
)
def test_other_motions_stay_as_they_are(body, clip, data_file):
    clip = load_clip(data_file("mocap", clip))
    sampler = ClipSampler(clip)
    one, other = retargeter(clip, body), retargeter(clip, body)
    for time in np.arange(0.0, min(clip.duration, 3.0), 1 / 30):
        q = sampler.sample(clip.times[0] + time)
        with_it = one.world_joints(q, time)
        assert one.tucks.bend == 0.0
        assert (with_it == other.world_joints(q, time, clear_thighs=False)).all()


def test_a_body_without_thighs_is_left_alone():
    body = load_body("mannequin")
    bones = {bone: name for bone, name in body.humanoid.items() if "UpperLeg" not in bone}
    lame = Body(name="lame", rig=body.rig, skin=body.skin, humanoid=bones)
    T = tucked(body, 140.0)
    before = T.copy()
    Tucks(lame).clear(T)
    assert (before == T).all()


def test_legs_that_hang_on_the_spine_are_left_alone():
    body = load_body("mannequin")
    parent = body.rig.parent.copy()
    for side in SIDES:
        parent[joint(body, f"{side}UpperLeg")] = joint(body, "spine")
    below = dataclasses.replace(body.rig, parent=parent)
    hung = dataclasses.replace(body, rig=below)
    T = tucked(body, 140.0)
    before = T.copy()
    Tucks(hung).clear(T)
    assert (before == T).all()


def test_on_a_trunk_that_lies_the_legs_go(body):
    """Bent back, it would be in the ground; the pose is the same but for how it is turned."""
    stands, lies, half = (tucked(body, DEEP[body.name]) for _ in range(3))
    before = stands.copy()
    tucks = Tucks(body)
    tucks.clear(stands)
    assert tucks.bend > 0.05
    tucks.clear(lies, 1.0)
    head, knee = joint(body, "head"), joint(body, "leftLowerLeg")
    np.testing.assert_allclose(lies[head, :3, :3], before[head, :3, :3], atol=1e-9)
    assert np.abs(stands[head, :3, :3] - before[head, :3, :3]).max() > 0.05
    assert np.abs(lies[knee, :3, :3] - before[knee, :3, :3]).max() > 0.05
    turn = lies[head] @ np.linalg.inv(stands[head])
    np.testing.assert_allclose(lies, turn @ stands, atol=1e-9)
    # About the hip joints, which stay, and half as far for half as much.
    hips = [joint(body, f"{side}UpperLeg") for side in SIDES]
    np.testing.assert_allclose(lies[hips, :3, 3], before[hips, :3, 3], atol=1e-9)
    tucks.clear(half, 0.5)
    turn = half[head] @ np.linalg.inv(stands[head])
    angle = np.arccos((np.trace(turn[:3, :3]) - 1.0) / 2.0)
    assert angle == pytest.approx(0.5 * tucks.bend, abs=1e-6)
