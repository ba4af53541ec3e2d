"""The skin divided among bones."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.regions import bone_weights, skin_regions
from garment_sim_ros.contact.cores import Cores


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin")


def with_a_strip(body):
    """The trunk's left side, down to the waist, moves with the arm more than with the trunk."""
    x = body.skin.vertices
    arm = body.rig.index(body.humanoid["leftUpperArm"])
    shoulder = np.linalg.inv(body.skin.T_bone_bind[arm])[:3, 3]
    below = shoulder[2] - x[:, 2]
    trunk = [body.rig.index(body.humanoid[b]) for b in ("hips", "spine", "chest", "upperChest")]
    on_trunk = np.isin(body.skin.bone[np.arange(len(x)), body.skin.weight.argmax(axis=1)], trunk)
    strip = on_trunk & (x[:, 1] > 0.5 * shoulder[1]) & (below > 0.15) & (below < 0.35)
    bone, weight = body.skin.bone.copy(), body.skin.weight.copy()
    weight[strip] *= 0.3 / weight[strip].sum(axis=1, keepdims=True)
    last = weight.argmin(axis=1)
    rows = np.flatnonzero(strip)
    bone[rows, last[rows]] = arm
    weight[rows, last[rows]] = 0.7
    weight /= weight.sum(axis=1, keepdims=True)
    skin = dataclasses.replace(body.skin, bone=bone, weight=weight)
    return dataclasses.replace(body, skin=skin), strip


def test_limbs_keep_what_is_near_to_them(body):
    """Nothing changes on a body whose limbs carry their own skin."""
    regions, bones = skin_regions(body), major_bones(body, also=("leftToes", "rightToes"))
    assert regions.names == bones.names
    np.testing.assert_array_equal(regions.weight, bone_weights(body.skin, bones))


def test_a_strip_of_the_trunk_on_an_arm_is_the_trunks(body):
    striped, strip = with_a_strip(body)
    assert strip.sum() > 40
    arm = skin_regions(striped).names.index(striped.humanoid["leftUpperArm"])
    given = bone_weights(striped.skin, major_bones(striped))
    assert (given.argmax(axis=1) == arm)[strip].all()
    regions = skin_regions(striped)
    assert not (regions.owner == arm)[strip].any()
    assert regions.weight[strip, arm].max() < 0.05
    np.testing.assert_allclose(regions.weight.sum(axis=1), given.sum(axis=1), rtol=1e-6)
    # Away from the strip all is as it was.
    np.testing.assert_allclose(
        regions.weight[~strip], skin_regions(body).weight[~strip], atol=1e-12
    )


def test_no_core_of_an_arm_runs_down_the_trunk(body):
    def farthest(body):
        """Of the cores that the left upper arm carries, from its joint [m]."""
        colliders = fit_colliders(body)
        cores, arm = Cores.of(colliders), body.humanoid["leftUpperArm"]
        mine = [k for k, bone in enumerate(cores.bone) if bone == arm]
        place = [colliders.colliders[cores.collider[k]].position for k in mine]
        return np.linalg.norm(cores.ends[mine] + np.array(place)[:, None], axis=-1).max()

    striped, _ = with_a_strip(body)
    assert farthest(striped) < farthest(body) + 0.02
