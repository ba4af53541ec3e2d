"""The collider that moves as the body as a whole does is that of the hips, whatever the shapes."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.collider_params import EllipsoidSettings
from garment_sim_ros.colliders.description import from_json, to_json
from garment_sim_ros.colliders.ellipsoids.ellipsoid_binding import fit_ellipsoids
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.params import ColliderOptions
from garment_sim_ros.sim.world.root_motion import TakenOut
from garment_sim_ros.sim.world.teleport import has_jumped


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin:vertices=1500")


@pytest.mark.parametrize("method", ["hulls", "capsules", "spheres", "sdf", "mesh"])
def test_root_is_on_the_hips(body, method):
    colliders = from_json(to_json(fit_colliders(body, ColliderOptions(method=method, voxel=0.05))))
    root = colliders.colliders[colliders.root]
    assert (root.kind, root.bone) == ("frame", body.humanoid["hips"])


def without_skin_on_the_hips(body):
    """The same body, all that its hips carried now on the thigh."""
    hips, thigh = (body.rig.index(body.humanoid[b]) for b in ("hips", "leftUpperLeg"))
    skin = dataclasses.replace(
        body.skin, bone=np.where(body.skin.bone == hips, thigh, body.skin.bone).astype(np.int32)
    )
    return dataclasses.replace(body, skin=skin)


def test_hips_that_carry_nothing_are_the_root_all_the_same(body):
    bare = without_skin_on_the_hips(body)
    bones = major_bones(bare)
    assert bones.root == body.humanoid["hips"]
    assert bones.root not in bones.names
    settings = EllipsoidSettings(max_ellipsoids=15)
    for colliders in (
        fit_colliders(bare, ColliderOptions(method="capsules")),
        fit_colliders(bare, ColliderOptions(method="mesh")),
        fit_ellipsoids(bare, settings)[0],
    ):
        assert colliders.colliders[colliders.root].bone == bones.root
    # Ellipsoids at joints find their frames by their place in the set: their own bone is there.
    refitted = [c for c in colliders.colliders if "points" in c.geometry]
    assert refitted
    for c in refitted:
        frames = [colliders.colliders[i] for i in c.geometry["frames"]]
        assert all(frame.kind == "frame" for frame in frames)
        assert c.bone in {frame.bone for frame in frames}


def test_what_is_taken_out_is_the_motion_of_the_root_not_of_the_first_shape():
    sphere = Collider(name="chest", kind="sphere", bone="chest", geometry={"radius": 0.1})
    hips = Collider(name="frame_hips", kind="frame", bone="hips")
    colliders = ColliderSet(colliders=(sphere, hips))
    start, end = ColliderPoses.identity(2), ColliderPoses.identity(2)
    end.position[:] = [[0.0, 0.5, 0.0], [0.1, 0.0, 0.0]]
    end.orientation[0] = [0.0, 0.0, 1.0, 0.0]
    assert not has_jumped(start, end, 0.1, root=colliders.root, speed=30.0, turn_rate=1.0)
    assert has_jumped(start, end, 0.1, root=0, speed=30.0, turn_rate=1.0)
    taken = TakenOut(0.0, 0.0, colliders.root)
    assert taken.begin_step(start, end, 1.0)
    np.testing.assert_allclose(taken.way, [0.1, 0.0, 0.0])
    np.testing.assert_allclose(taken.turn, [0.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(start.position[0], [0.1, 0.0, 0.0])
