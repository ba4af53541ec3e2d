"""Feet that stand in the source stand on the ground, in one place, at any rate."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.body.feet import PAST
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.leg_reach import FOOT
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler


@pytest.fixture(scope="module", params=["mannequin:height=1.9", "CesiumMan.glb"])
def body(request, data_file):
    name = request.param
    return load_body(name if name.startswith("mannequin") else data_file("bodies", name))


def retargeter_of(clip, body):
    return Retargeter(
        clip.rig, body, T_world_source=clip.T_world_file, reference=clip.source_reference
    )


def soles(retargeter, body):
    """Vertices of each foot."""
    main = body.skin.bone[np.arange(len(body.skin.bone)), body.skin.weight.argmax(axis=1)]
    return [np.flatnonzero(part[main] == FOOT) for part in retargeter.feet.legs.part]


def standing_feet(clip, retargeter, times):
    """Whether each foot of the source stands at each time: low and slow, with hysteresis."""
    feet, kinematics = retargeter.feet, ForwardKinematics(clip.rig)
    sample = ClipSampler(clip).sample
    points = []
    for t in times:
        T = kinematics.from_dofs(sample(float(t)), clip.T_world_file)[feet._joint]
        points.append((T[..., :3, :3] @ feet._offset[..., None])[..., 0] + T[..., :3, 3])
    points = np.array(points)
    speed = np.full(points.shape[:3], np.inf)
    speed[1:-1] = np.linalg.norm(points[2:] - points[:-2], axis=-1) / (times[2] - times[0])
    away = np.abs(points[..., 2] - feet._standing)
    stands, stays = (away < 0.03) & (speed < 0.1), (away < 0.04) & (speed < 0.15)
    for k in range(1, len(times)):
        stands[k] |= stands[k - 1] & stays[k]
    return stands.any(axis=2)


CLIPS = [
    "walk",
    "cmu_14_14_jumping_jacks_30fps.bvh",
    "deepmimic_walk.bvh",
    "fair_wave_hello.bvh",
]


@pytest.mark.parametrize("name", CLIPS)
def test_soles_are_on_the_ground_in_one_place_while_they_stand(body, data_file, name):
    clip = load_clip(name if name == "walk" else data_file("mocap", name))
    retargeter, skinner = retargeter_of(clip, body), Skinner(body.skin)
    sample = ClipSampler(clip).sample
    times = np.arange(clip.times[0], min(clip.times[0] + 3.0, clip.times[-1]), 1 / 60)
    standing = standing_feet(clip, retargeter, times)
    assert standing.sum() > 30
    feet = soles(retargeter, body)
    heights, slides = {}, {}
    for grounded in (False, True):
        skins = []
        for t in times:
            T = retargeter.world_joints(sample(float(t)), float(t) if grounded else None)
            x = skinner.vertices(T)
            skins.append([x[sole].copy() for sole in feet])
        heights[grounded] = np.array([skins[k][i][:, 2].min() for k, i in np.argwhere(standing)])
        slides[grounded] = []
        for k, i in np.argwhere(standing[1:] & standing[:-1]):
            before, x = skins[k][i], skins[k + 1][i]
            near = x[:, 2] < x[:, 2].min() + 0.02  # a foot that rolls off does not slide
            slides[grounded].append(np.linalg.norm((x - before)[near, :2], axis=1).min() * 60)
    before, after = (np.percentile(np.abs(heights[g]), 95) for g in (False, True))
    assert after < 0.012
    assert after < 0.8 * before
    assert np.median(slides[True]) < 0.01
    assert np.percentile(slides[True], 95) < 0.03
    assert retargeter.feet.slipped <= 0.1 * standing.sum()


@pytest.mark.parametrize("rate", [15, 30, 120])
def test_soles_stay_in_one_place_at_any_rate(body, rate):
    clip = load_clip("walk")
    retargeter, skinner = retargeter_of(clip, body), Skinner(body.skin)
    sample = ClipSampler(clip).sample
    times = np.arange(0.0, 3.0, 1 / rate)
    standing = standing_feet(clip, retargeter, times)
    feet = soles(retargeter, body)
    slides = []
    last = None
    for k, t in enumerate(times):
        x = skinner.vertices(retargeter.world_joints(sample(float(t)), float(t))).copy()
        for i in np.flatnonzero(standing[k] & standing[k - 1]) if k else ():
            sole = feet[i]
            near = sole[x[sole, 2] < x[sole, 2].min() + 0.02]
            slides.append(np.linalg.norm((x - last)[near, :2], axis=1).min() * rate)
        last = x
    assert np.median(slides) < 0.01
    assert np.percentile(slides, 90) < 0.03


def test_without_a_time_nothing_is_grounded(body):
    clip = load_clip("walk")
    retargeter = retargeter_of(clip, body)
    q = clip.values[30]
    plain = retargeter.world_joints(q).copy()
    assert np.abs(retargeter.world_joints(q, 0.5) - plain).max() > 1e-3
    np.testing.assert_array_equal(retargeter.world_joints(q), plain)


def test_a_body_in_its_own_motion_keeps_its_pose():
    """Its own skeleton standing, walking: the clip's figure is the mannequin."""
    clip = load_clip("walk")
    body = load_body("mannequin")
    retargeter = retargeter_of(clip, body)
    for k in range(0, 120, 3):
        plain = retargeter.world_joints(clip.values[k]).copy()
        grounded = retargeter.world_joints(clip.values[k], float(clip.times[k]))
        assert np.abs(grounded[:, :3, 3] - plain[:, :3, 3]).max() < 0.03


def test_the_rate_does_not_matter(body):
    clip = load_clip("walk")
    sample = ClipSampler(clip).sample
    end = 1.5
    found = {}
    for rate in (30, 60, 120, 1000):
        retargeter = retargeter_of(clip, body)
        poses = {}
        for k in range(round(end * rate) + 1):
            T = retargeter.world_joints(sample(k / rate), k / rate)
            if k * 10 % rate == 0 and k >= PAST * rate:
                poses[k * 10 // rate] = T[:, :3, 3].copy()
        found[rate] = np.array([poses[k] for k in sorted(poses)])
    for rate, most in ((30, 0.03), (60, 0.02), (120, 0.01)):
        away = np.linalg.norm(found[rate] - found[1000], axis=-1)
        assert away.max() < most
        assert away.mean() < 0.2 * most


def test_what_was_before_does_not_matter_after_some_steps(body):
    clip = load_clip("walk")
    watched, late = retargeter_of(clip, body), retargeter_of(clip, body)
    sample = ClipSampler(clip).sample
    for k in range(210):
        q, t = sample(k / 60), k / 60
        T = watched.world_joints(q, t).copy()
        if k >= 40:
            other = late.world_joints(q, t)
        if k >= 180:
            np.testing.assert_allclose(T, other, atol=2e-3)
    # Going back in time, or far ahead, is a new beginning.
    for t in (0.0, 1e6):
        np.testing.assert_array_equal(
            watched.world_joints(q, t).copy(), retargeter_of(clip, body).world_joints(q, t)
        )


def test_poses_go_on_without_a_jerk(body):
    """Joints' accelerations stay those of a body: no joint leaves its place within a sample."""
    clip = load_clip("walk")
    retargeter = retargeter_of(clip, body)
    sample = ClipSampler(clip).sample
    times = np.arange(0.0, 3.0, 1 / 60)
    x = {
        grounded: np.array(
            [
                retargeter.world_joints(sample(t), float(t) if grounded else None)[:, :3, 3].copy()
                for t in times
            ]
        )
        for grounded in (False, True)
    }
    jerk = {g: np.abs(np.diff(places, 2, axis=0)).max() * 3600 for g, places in x.items()}
    assert jerk[True] < 2.0 * jerk[False] + 35.0


def test_bodies_without_feet_or_legs_are_posed_all_the_same():
    clip = load_clip("walk")
    body = load_body("mannequin:vertices=1500")
    skin = body.skin
    feet = np.isin(
        skin.bone[np.arange(len(skin.bone)), skin.weight.argmax(axis=1)],
        [body.rig.index(b) for b in ("leftFoot", "rightFoot", "leftToes", "rightToes")],
    )
    kept = skin.triangles[~feet[skin.triangles].any(axis=1)]
    used, triangles = np.unique(kept, return_inverse=True)
    cut = dataclasses.replace(
        body,
        skin=dataclasses.replace(
            skin,
            vertices=skin.vertices[used],
            triangles=triangles.reshape(-1, 3).astype(np.int32),
            bone=skin.bone[used],
            weight=skin.weight[used],
        ),
    )
    T = retargeter_of(clip, cut).world_joints(clip.values[0], 0.0)
    assert np.isfinite(T).all()
    legless = dataclasses.replace(
        body, humanoid={b: j for b, j in body.humanoid.items() if "Foot" not in b}
    )
    retargeter = retargeter_of(clip, legless)
    plain = retargeter.world_joints(clip.values[0]).copy()
    np.testing.assert_array_equal(retargeter.world_joints(clip.values[0], 0.0), plain)
