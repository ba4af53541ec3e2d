"""Capsule and sphere fits: distances against brute force, known shapes, real bodies."""

import numpy as np
import pytest

from garment_sim_ros.colliders.capsules.capsule_fit import (
    capsule_distance,
    refine,
    slabs,
    union_distance,
)
from garment_sim_ros.geometry.transforms import matrix_from_quaternion, transform_points


def ball_distance(capsule, points, count=20001):
    """Brute force: the union of many balls."""
    t = np.linspace(0, 1, count)[:, None]
    centres = capsule[:3] + t * (capsule[3:6] - capsule[:3])
    radii = capsule[6] + t[:, 0] * (capsule[7] - capsule[6])
    return np.array([(np.linalg.norm(p - centres, axis=1) - radii).min() for p in points])


@pytest.mark.parametrize(
    "capsule",
    [
        [0, 0, 0, 0, 0, 1, 0.3, 0.1],
        [0, 0, 0, 0.5, 0.2, 1, 0.2, 0.2],
        [0, 0, 0, 0.1, 0, 0, 0.1, 0.5],
        [0, 0, 0, 0, 0, 0, 0.2, 0.2],
        [0, 0, 0, 0, 0, 0.4, 0.0, 0.3],
    ],
)
def test_distance_is_that_of_the_union_of_balls(capsule):
    capsule = np.array(capsule, float)
    points = np.random.default_rng(0).uniform(-1, 2, (300, 3))
    got = [capsule_distance(capsule, *p)[0] for p in points]
    np.testing.assert_allclose(got, ball_distance(capsule, points), atol=1e-7)


def test_a_tapered_capsule_is_found_again():
    rng = np.random.default_rng(1)
    true = np.array([0.1, 0.2, 0.3, 0.2, 0.5, 0.4, 0.08, 0.05])
    sphere = rng.normal(size=(2000, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    t = rng.uniform(size=(2000, 1))
    points = true[:3] + t * (true[3:6] - true[:3]) + sphere * (true[6] + t * (true[7] - true[6]))
    points = points[np.abs(ball_distance(true, points, 501)) < 1e-4]
    weight = np.full(len(points), 1 / len(points))
    start = slabs(points, weight, 0, 1, 1)
    fit, cost = refine(start, points, weight, np.zeros(len(points), bool), iterations=200)
    assert np.sqrt(cost) < 2e-3
    np.testing.assert_allclose(fit[0, [6, 7]].sum(), 0.13, atol=3e-3)


@pytest.mark.parametrize("name", ["mh_female_young.glb", "CesiumMan.glb"])
@pytest.mark.parametrize("method", ["capsules", "spheres"])
def test_real_bodies_are_contained_and_posed_in_their_bones(data_file, name, method):
    pytest.importorskip("garment_sim_ros.body.major_bones")
    from garment_sim_ros.body.loaders.load import load_body
    from garment_sim_ros.body.major_bones import major_bones
    from garment_sim_ros.colliders.capsules.capsules import fit_capsules, fit_spheres
    from garment_sim_ros.colliders.description import from_json, to_json
    from garment_sim_ros.geometry.transforms import invert_transform
    from garment_sim_ros.geometry.triangles import vertex_areas

    body = load_body(data_file("bodies", name))
    delta = 0.002
    fit = fit_capsules if method == "capsules" else fit_spheres
    colliders = fit(body, delta=delta, thickness=0.003)
    assert colliders.thickness == 0.003
    bones = major_bones(body)
    shapes = [c for c in colliders.colliders if c.kind != "frame"]
    frames = [c for c in colliders.colliders if c.kind == "frame"]
    assert [c.name for c in frames] == [f"frame_{b}" for b in bones.names]
    assert [c.bone for c in frames] == list(bones.names)
    rows = []
    for c in shapes:
        T_bind_bone = invert_transform(body.skin.T_bone_bind[body.rig.index(c.bone)])
        axis = matrix_from_quaternion(c.orientation)[:, 2]
        ends = c.position + np.array([[0.0], [c.geometry.get("length", 0.0)]]) * axis
        radii = [c.geometry.get(k, c.geometry.get("radius")) for k in ("radius0", "radius1")]
        rows.append([*transform_points(T_bind_bone, ends).ravel(), *radii])
    x = body.skin.vertices
    distance, nearest = np.empty(len(x)), np.zeros(len(x), np.int32)
    union_distance(np.array(rows), x, distance, nearest)
    areas = (
        vertex_areas(body.skin.vertices, body.skin.triangles)
        / vertex_areas(body.skin.vertices, body.skin.triangles).sum()
    )
    assert areas[distance <= 0].sum() > 0.95
    assert distance.max() < 0.03
    assert areas @ np.abs(distance) < 0.025  # not by being fat
    assert from_json(to_json(colliders)).revision == colliders.revision
