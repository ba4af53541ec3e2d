"""Bodies in the poses of a clip."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from conftest import REPOSITORY

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.colliders.hulls.hulls import fit_hulls
from garment_sim_ros.colliders.regions import bone_weights, skin_regions
from garment_sim_ros.colliders.report.motion_report import motion_report
from garment_sim_ros.mocap.clip_poses import clip_poses
from garment_sim_ros.mocap.clips import load_clip


def test_poses_are_spread_over_the_clip_and_independent():
    body = load_body("mannequin:vertices=1500")
    poses = clip_poses(load_clip("walk"), body, 4)
    assert len(poses) == 4
    hips = body.rig.index(body.humanoid["hips"])
    ways = np.linalg.norm(np.diff([T[hips, :3, 3] for T in poses], axis=0), axis=1)
    assert (ways > 0.1).all()
    np.testing.assert_allclose([T[:, 3] for T in poses], [[[0, 0, 0, 1]] * len(body.rig)] * 4)


def upright(body, T_world_joint):
    """How far up the head is over the hips, over their distance."""
    place = {b: T_world_joint[body.rig.index(body.humanoid[b]), :3, 3] for b in ("hips", "head")}
    way = place["head"] - place["hips"]
    return way[2] / np.linalg.norm(way)


def test_poses_at_times_have_the_clips_own_axes(data_file):
    body = load_body("mannequin:vertices=1000")
    clip = load_clip(data_file("mocap", "rokoko_jesse_dance.bvh"))
    assert not np.allclose(clip.T_world_file[:3, :3], np.eye(3))  # y is up in the file
    poses = clip_poses(clip, body, [0.5, 1.0])
    assert min(upright(body, T) for T in poses) > 0.7
    np.testing.assert_array_equal(poses[1], clip_poses(clip, body, [1.0])[0])


def test_bodies_of_the_trade_off_stand_on_the_ground(data_file, monkeypatch):
    monkeypatch.syspath_prepend(REPOSITORY / "bench")
    tradeoff = pytest.importorskip("tradeoff")
    clip = data_file("mocap", "rokoko_jesse_dance.bvh")
    walk = tradeoff.Walk("mannequin:vertices=1000", str(clip), 0.1)
    for module in ("tradeoff", "drape", "hulls"):
        sys.modules.pop(module, None)
    hips = walk.body.rig.index(walk.body.humanoid["hips"])
    assert min(T[hips, 2, 3] for T in walk.joints) > 0.5


@pytest.mark.parametrize("clip", ["rokoko_jesse_dance", "deepmimic_dance_a"])
def test_hulls_of_widely_spread_weights_follow_the_skin(data_file, clip):
    """Weights that change over a long way need more than a half-turning shape; toes their own.

    1 % of the area was 20 and 30 mm outside without them. A strip of the trunk that moves with the
    left arm is left to the trunk: an arm's collider there went through garments.
    """
    body = load_body(data_file("bodies", "CesiumMan.glb"))
    poses = clip_poses(load_clip(data_file("mocap", f"{clip}.bvh")), body, 10)
    fitted = fit_hulls(body)
    assert motion_report(body, fitted.colliders, poses)["outside_mm_p99"] < 20.0
    bones = major_bones(body, also=("leftToes", "rightToes"))
    own = np.abs(skin_regions(body).weight - bone_weights(body.skin, bones)).max(axis=1) < 0.02
    kept = body.skin.triangles[own[body.skin.triangles].all(axis=1)]
    assert len(kept) > 0.9 * len(body.skin.triangles)
    limbs = replace(body, skin=replace(body.skin, triangles=kept))
    assert motion_report(limbs, fitted.colliders, poses)["outside_mm_p99"] < 10.0
