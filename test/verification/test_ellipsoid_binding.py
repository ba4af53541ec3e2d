"""Ellipsoids on a moving body, refitted at its joints."""

import numpy as np
import pytest

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.colliders.ellipsoid_binding import EllipsoidBinding, distance_outside
from garment_sim_ros.colliders.ellipsoids import ellipsoids_around
from garment_sim_ros.geometry.ellipsoid_poses import PosedEllipsoids
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import sample


def test_rest_pose_holds_the_skin_where_it_was_fitted():
    body = load_body("mannequin:vertices=2000")
    fit = ellipsoids_around(body, max_ellipsoids=40)
    binding = EllipsoidBinding(fit, body)
    T = rest_transforms(body.rig)
    for posed in (binding.static(T), binding.refitted(T)):
        # To first order, for rounding of centres that went through two frames.
        assert distance_outside(posed, body.skin.vertices).max() < 1e-6
    assert 0 < len(binding.at_joint) < 40


def test_refitting_leaves_the_binding_as_it_was():
    body = load_body("mannequin:vertices=1500")
    binding = EllipsoidBinding(ellipsoids_around(body, max_ellipsoids=30), body)
    T = rest_transforms(body.rig)
    before = binding.static(T)
    refitted = binding.refitted(T, 1.5 * body.skin.vertices)
    after = binding.static(T)
    assert not np.array_equal(refitted.radii, before.radii)
    assert np.array_equal(after.radii, before.radii)


def test_distance_outside_of_a_sphere():
    ball = PosedEllipsoids(np.zeros((1, 3)), np.eye(3)[None], np.ones((1, 3)))
    points = np.array([[0.0, 0, 0], [0.5, 0, 0], [0, 3.0, 0]])
    assert distance_outside(ball, points) == pytest.approx([0.0, 0.0, 2.0])


@pytest.mark.parametrize(
    "case",
    [
        ("mannequin", "walk"),
        ("mh_female_young.glb", "deepmimic_spinkick.bvh"),
        ("CesiumMan.glb", "deepmimic_dance_a.bvh"),
    ],
)
def test_refitting_at_joints_beats_one_bone_over_a_clip(case, data_file):
    name, motion = case
    body = load_body(name if name == "mannequin" else data_file("bodies", name))
    clip = load_clip(motion if motion == "walk" else data_file("mocap", motion))
    retarget = Retargeter(
        clip.rig, body, T_world_source=clip.T_world_file, reference=clip.source_reference
    )
    binding = EllipsoidBinding(ellipsoids_around(body, max_ellipsoids=60), body)
    outside = {"static": [], "refitted": []}
    for t in np.linspace(0.0, clip.times[-1], 6):
        T = retarget.world_joints(sample(clip, t)).copy()
        x = skin_vertices(body.skin, T).astype(np.float64)
        outside["static"].append(distance_outside(binding.static(T), x))
        outside["refitted"].append(distance_outside(binding.refitted(T), x))
        given = binding.refitted(T, x)
        assert distance_outside(given, x).max() == pytest.approx(
            outside["refitted"][-1].max(), abs=1e-3
        )
    static, refitted = (np.concatenate(v) for v in outside.values())
    assert static.max() > 0.003
    assert refitted.mean() < 0.5 * static.mean()
    assert refitted.max() < static.max()
