"""Whether garments are worn, looked at while they move: cases of known answer."""

import numpy as np
import pytest
import trimesh

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.skin_from_poses import SkinFromPoses
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.recording import worn_watch
from garment_sim_ros.recording.worn_watch import WornWatch


@pytest.fixture(scope="module")
def dressed():
    body = load_body("mannequin")
    colliders = fit_colliders(body)
    garments = load_outfit("tshirt_short_skirt", body, colliders=colliders).garments
    return body, colliders, garments, ColliderPoser(colliders, body)


def bent(body, seed=3):
    """World transforms of the joints with every bone that carries colliders turned a little."""
    rig, random = body.rig, np.random.default_rng(seed)
    T = rest_transforms(rig)
    for joint in range(1, len(rig.parent)):
        turn = trimesh.transformations.rotation_matrix(
            0.3 * random.normal(), random.normal(size=3), T[joint, :3, 3]
        )
        below = {joint}
        for child, parent in enumerate(rig.parent):
            if int(parent) in below:
                below.add(child)
        T[sorted(below)] = turn @ T[sorted(below)]
    return T


def test_the_skin_is_found_again_from_the_poses_of_the_colliders(dressed):
    body, colliders, _, poser = dressed
    T = bent(body)
    found = SkinFromPoses(colliders, body).vertices(poser.poses(T))
    away = np.linalg.norm(found - Skinner(body.skin).vertices(T), axis=1)
    assert np.percentile(away, 80.0) < 1e-6
    assert away.max() < 5e-3  # near the collar bones, which carry no colliders


def test_bones_without_colliders_go_with_those_above_them(dressed):
    body, colliders = dressed[:2]
    kept = {body.humanoid[n] for n in ("hips", "spine", "leftUpperLeg")}
    some = ColliderSet(colliders=tuple(c for c in colliders.colliders if c.bone in kept))
    T = rest_transforms(body.rig)
    legs = [body.rig.index(body.humanoid[f"left{n}"]) for n in ("UpperLeg", "LowerLeg", "Foot")]
    turn = trimesh.transformations.rotation_matrix(0.7, [0, 1, 0], T[legs[0], :3, 3])
    T[legs] = turn @ T[legs]
    poses = ColliderPoser(some, body).poses(T)
    np.testing.assert_allclose(SkinFromPoses(some, body).joints(poses)[legs], T[legs], atol=1e-9)
    with pytest.raises(GeometryError, match="no collider"):
        SkinFromPoses(ColliderSet(colliders=()), body)


def test_a_garment_in_its_place_and_one_that_was_pushed_through_the_body(dressed, monkeypatch):
    body, colliders, garments, poser = dressed
    monkeypatch.setattr(worn_watch, "_PERIOD", 0.0)
    monkeypatch.setattr(worn_watch, "_REST", 0.0)
    watch = WornWatch(colliders, body, garments)
    assert watch.figures() == (0.0, 0.0, 0.0)
    poses = poser.poses(rest_transforms(body.rig)).copy()
    worn = {g.name: g.vertices.astype(np.float32) for g in garments}
    shifted = {**worn, "skirt": worn["skirt"] + np.float32([0.0, 0.12, 0.0])}
    for x in (worn, worn, shifted):
        watch.look(poses, x)
        watch.wait()
    assert watch.pierced_by("tshirt") == ()
    assert set(watch.pierced_by("skirt")) >= {body.humanoid["rightUpperLeg"]}
    assert watch.figures("tshirt").pierced == 0.0
    assert watch.figures("skirt").pierced == watch.figures().pierced == 1 / 3
    assert watch.inside("tshirt") < 0.02
    assert 0.1 < watch.inside("skirt") < 0.6
    assert watch.figures("skirt").inside_p99 == pytest.approx(watch.inside("skirt"), abs=1e-4)
    assert watch.figures("skirt").inside_median < 0.02
    assert watch.figures().inside_p99 == watch.figures("skirt").inside_p99
    # Another body moves with its poses: nothing changes with the place in the world.
    poses.position += [50.0, -20.0, 1.0]
    moved = {n: x + np.float32([50.0, -20.0, 1.0]) for n, x in shifted.items()}
    before = watch.inside("skirt")
    watch.look(poses, moved)
    watch.wait()
    assert watch.inside("skirt") == pytest.approx(before, abs=2e-3)


def test_what_is_not_finite_is_not_measured_and_stops_nothing(dressed, monkeypatch):
    body, colliders, garments, poser = dressed
    monkeypatch.setattr(worn_watch, "_PERIOD", 0.0)
    monkeypatch.setattr(worn_watch, "_REST", 0.0)
    watch = WornWatch(colliders, body, garments)
    poses = poser.poses(rest_transforms(body.rig))
    x = {g.name: np.full(g.vertices.shape, np.nan, np.float32) for g in garments}
    watch.look(poses, x)
    watch.wait()
    assert watch.figures() == (0.0, 0.0, 0.0)
    watch.look(poses, {g.name: g.vertices.astype(np.float32) for g in garments})
    watch.wait()
    assert watch.figures("tshirt").inside_p99 < 0.02
