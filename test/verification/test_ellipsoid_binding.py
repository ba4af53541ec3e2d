"""Ellipsoids on a moving body, fitted again at its joints."""

from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.collider_params import EllipsoidSettings
from garment_sim_ros.colliders.description import from_json, to_json
from garment_sim_ros.colliders.ellipsoids.ellipsoid_binding import fit_ellipsoids
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.report.fatness import Union
from garment_sim_ros.colliders.report.motion_report import motion_report
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError, MessageError
from garment_sim_ros.geometry.mvee import mvee
from garment_sim_ros.geometry.transforms import transform_from, transform_points
from garment_sim_ros.mocap.clip_poses import clip_poses
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.sim.colliders import ColliderState


@pytest.fixture(scope="module")
def worn():
    body = load_body("mannequin:vertices=2000")
    return body, fit_ellipsoids(body, EllipsoidSettings(max_ellipsoids=40))[0]


def state_at(colliders: ColliderSet, poses: ColliderPoses) -> ColliderState:
    state = ColliderState.of(colliders)
    state.start = state.end = poses
    state.pose()
    return state


def test_rest_pose_holds_the_skin(worn):
    body, colliders = worn
    union = Union(colliders, ColliderPoser(colliders, body).poses(rest_transforms(body.rig)))
    # Vertices that are left out may be out by the share of the radii that was allowed for.
    assert union.distance(body.skin.vertices).max() < 1e-3
    state = ColliderState.of(colliders)
    assert 5 < len(state.refit) < 40


def test_plain_twin(worn):
    body, colliders = worn
    origin = np.array([0.5, -0.25, 1.0])
    for T_world_joint in clip_poses(load_clip("walk"), body, [0.1, 0.4]):
        poses = ColliderPoser(colliders, body).poses(T_world_joint)
        state = ColliderState.of(colliders)
        state.start = state.end = poses
        state.origin[:] = origin
        state.pose()
        T = transform_from(poses.position, poses.orientation)
        for k, i in enumerate(state.shapes.collider):
            g = colliders.colliders[i].geometry
            if "points" not in g:
                assert np.allclose(state.shapes.radii[k], g["radii"], rtol=1e-6)
                continue
            x = sum(
                w[:, None] * transform_points(T[f], p)
                for f, p, w in zip(g["frames"], g["points"], g["weights"])
            )
            expected = mvee(x, tolerance=1e-4)
            local = (x - origin - state.posed.centre[k]) @ state.posed.rotation[k]
            zeta = ((local / state.shapes.radii[k]) ** 2).sum(axis=1)
            assert zeta.max() == pytest.approx(1.0, abs=1e-4)  # single precision
            # Volumes are within their tolerance of the smallest.
            assert np.prod(state.shapes.radii[k]) < 1.02 * np.prod(expected.radii)
            half = np.diag(state.shapes.radii[k]) @ state.posed.rotation[k].T
            corners = state.posed.centre[k] + np.concatenate([half, -half])
            assert (corners >= state.posed.box[k, :3] - 1e-5).all()
            assert (corners <= state.posed.box[k, 3:] + 1e-5).all()


def test_moves_with_the_body_and_forgets(worn):
    body, colliders = worn
    T = rest_transforms(body.rig)
    first = state_at(colliders, ColliderPoser(colliders, body).poses(T))
    moved = T.copy()
    moved[:, :3, 3] += [3.0, -2.0, 0.5]
    there = state_at(colliders, ColliderPoser(colliders, body).poses(moved))
    assert np.allclose(there.posed.centre - first.posed.centre, [3.0, -2.0, 0.5], atol=1e-5)
    there.start = there.end = ColliderPoser(colliders, body).poses(T)
    there.refit.forget()
    there.pose()
    assert np.array_equal(there.shapes.radii, first.shapes.radii)
    assert np.array_equal(there.posed.rotation, first.posed.rotation)


def test_the_description_carries_it(worn):
    _, colliders = worn
    again = from_json(to_json(colliders))
    assert again.revision == colliders.revision
    assert len(ColliderState.of(again).refit) == len(ColliderState.of(colliders).refit)


def bad_set(colliders: ColliderSet, key: str, value) -> ColliderSet:
    def changed(c: Collider) -> Collider:
        if "points" not in c.geometry:
            return c
        geometry = {k: g for k, g in c.geometry.items() if k != key}
        return replace(c, geometry=geometry if value is None else geometry | {key: value})

    return replace(colliders, colliders=tuple(changed(c) for c in colliders.colliders))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("frames", [0]),
        ("frames", [10**6]),
        ("frames", [0.5]),
        ("frames", None),
        ("weights", [[2.0]]),
        ("weights", [[-1.0, 1.0]]),
        ("points", [[[0.0, 0.0]]]),
        ("points", np.zeros((1, 5000, 3))),
        ("inflation", -1.0),
        ("inflation", [0.1, 0.1]),
    ],
)
def test_bad_entries(worn, key, value):
    colliders = bad_set(worn[1], key, value)
    with pytest.raises(GeometryError, match="collider"):
        ColliderState.of(colliders)
    with pytest.raises(MessageError, match="collider"):
        from_json(to_json(colliders))


def test_inflation_is_added(worn):
    body, colliders = worn
    poses = ColliderPoser(colliders, body).poses(rest_transforms(body.rig))
    settings = EllipsoidSettings(max_ellipsoids=40)
    fatter, _ = fit_ellipsoids(body, settings, delta=0.01)
    a, b = (state_at(s, poses).shapes.radii for s in (colliders, fatter))
    assert np.allclose(b - a, 0.01, atol=1e-6)


@pytest.mark.parametrize(
    "case",
    [
        ("mannequin", "walk"),
        ("mh_female_young.glb", "deepmimic_spinkick.bvh"),
        ("CesiumMan.glb", "deepmimic_dance_a.bvh"),
    ],
)
def test_less_skin_outside_than_without_over_a_clip(case, data_file):
    name, motion = case
    body = load_body(name if name == "mannequin" else data_file("bodies", name))
    clip = load_clip(motion if motion == "walk" else data_file("mocap", motion))
    colliders, _ = fit_ellipsoids(body, EllipsoidSettings(max_ellipsoids=60))
    report = motion_report(body, colliders, clip_poses(clip, body, 6))
    static = report["static"]
    assert static["outside_mm_max"] > 3.0
    assert report["outside_mm_mean"] < 0.6 * static["outside_mm_mean"]
    assert report["outside_mm_max"] < static["outside_mm_max"]
    assert report["outside_mm_p99"] <= static["outside_mm_p99"]
