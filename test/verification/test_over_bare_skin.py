"""Skin that a rig hangs on bones far away is found, and cloth is seen over it."""

from dataclasses import replace

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.bare_skin import bare_triangles, with_bare_skin
from garment_sim_ros.colliders.description import from_json, to_json
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.random_poses import random_poses
from garment_sim_ros.colliders.skin_from_poses import SkinFromPoses
from garment_sim_ros.contact.mesh.skinned import SkinnedMesh
from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh

FLANKS = (0.55, 0.75)
"""Part of the body's height between which skin of the trunk is hung on the upper arms."""


def badly_rigged(body):
    """The same body with skin of its flanks half on its upper arms."""
    skin = body.skin
    x, bone, weight = skin.vertices, skin.bone.copy(), skin.weight.copy()
    low, high = (part * np.ptp(x[:, 2]) + x[:, 2].min() for part in FLANKS)
    trunk = {body.rig.index(body.humanoid[b]) for b in ("hips", "spine", "chest", "upperChest")}
    strongest = np.take_along_axis(bone, weight.argmax(axis=1)[:, None], axis=1)[:, 0]
    flank = (x[:, 2] > low) & (x[:, 2] < high) & np.isin(strongest, list(trunk))
    for side, where in (("left", x[:, 1] > 0.05), ("right", x[:, 1] < -0.05)):
        moved = np.flatnonzero(flank & where)
        bone[moved, 0], bone[moved, 1:] = strongest[moved], 0
        bone[moved, 1] = body.rig.index(body.humanoid[f"{side}UpperArm"])
        weight[moved] = 0.0
        weight[moved, :2] = 0.5
    return replace(body, skin=replace(skin, bone=bone, weight=weight))


@pytest.fixture(scope="module")
def good():
    return load_body("mannequin")


def test_a_good_rig_has_none(good):
    assert not fit_colliders(good).has_bare_skin


def test_a_bad_rig_has_the_skin_that_it_pulls_away(good):
    bad = badly_rigged(good)
    # The fit of the good one: what arms pull away is in none of its shapes.
    colliders = with_bare_skin(bad, fit_colliders(good))
    assert colliders.has_bare_skin
    read = from_json(to_json(colliders))
    assert read.revision == colliders.revision
    patch = colliders.colliders[-1]
    mesh = SkinnedMesh(read, read.colliders[-1])
    # All bare triangles are in it, and not much beside.
    bare = bad.skin.triangles[bare_triangles(bad, fit_colliders(good))]
    rows = {tuple(p) for p in np.round(patch.geometry["vertices"], 9)}
    corners = np.round(bad.skin.vertices, 9)
    assert all(tuple(corners[v]) in rows for v in np.unique(bare))
    assert len(bare) < len(mesh.triangles) < 0.3 * len(bad.skin.triangles)
    # It goes as the skin does of which only the poses of colliders are known.
    poser, skin = ColliderPoser(read, bad), SkinFromPoses(read, bad)
    whole = {tuple(p): v for v, p in enumerate(corners)}
    same = [whole[tuple(p)] for p in np.round(patch.geometry["vertices"], 9)]
    for joints in random_poses(bad, 3, seed=3):
        poses = poser.poses(joints)
        np.testing.assert_allclose(mesh.vertices(poses), skin.vertices(poses)[same], atol=1e-6)


@pytest.mark.parametrize("preset", ["balanced", "fast"])
def test_skin_of_a_bad_rig_does_not_show(data_file, preset):
    avatar = gs.Avatar.load(str(data_file("bodies", "CesiumMan.glb")), preset=preset)
    assert avatar.colliders.has_bare_skin
    outfit = avatar.dress("tshirt_short_skirt")
    simulation = gs.Simulation(outfit, avatar.colliders, preset=preset)
    skin = SkinFromPoses(avatar.colliders, avatar.body)
    meshes = {g.name: GarmentMesh.of(g) for g in outfit.garments}
    body = avatar.body.skin.vertices, avatar.body.skin.triangles
    over, under = (ClothMeter(*body, meshes) for _ in range(2))
    clip = gs.load_clip(data_file("mocap", "deepmimic_dance_a.bvh"))
    longest, longest_under = 0.0, 0.0
    for n, poses in enumerate(avatar.play(clip, rate=60, seconds=2.2)):
        simulation.step(poses, dt=1 / 60)
        if n % 6:
            continue
        x = {name: simulation.positions(name).astype(np.float64) for name in meshes}
        plain = {name: x[name] - simulation[name].worn.aside.over_skin.lift for name in meshes}
        vertices = skin.vertices(poses)
        over.add(vertices, x)
        under.add(vertices, plain)
        for name, mesh in meshes.items():
            longest = max(longest, float(mesh.strain(x[name]).max()))
            longest_under = max(longest_under, float(mesh.strain(plain[name]).max()))
    shown, before = over.result(), under.result()
    assert before["skin_shows_p99"] > 0.04
    assert shown["skin_shows_p99"] < 0.7 * before["skin_shows_p99"]
    assert shown["inside_p99"] < 0.75 * before["inside_p99"]
    assert shown["inside_median"] < 0.4 * before["inside_median"]
    assert longest < longest_under + 0.1
