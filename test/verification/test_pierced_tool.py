"""`pierced` beside another implementation of the same rule, which knows nothing of this one."""

import importlib.util
import json

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.colliders.description import to_json
from garment_sim_ros.contact.pierced import PiercedMeter


@pytest.fixture(scope="module")
def tool(data_file):
    """The other implementation: a program beside the data, not part of this project."""
    spec = importlib.util.spec_from_file_location(
        "pierced_tool", data_file("..", "tools", "pierced.py")
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("body", "options", "clip"),
    [
        ("mannequin", {}, "rokoko_jesse_dance.bvh"),
        ("mh_female_young.glb", {}, "fair_wave_hello.bvh"),
        ("mannequin", {"method": "capsules"}, "deepmimic_cartwheel.bvh"),
    ],
)
def test_both_count_the_same_frames_by_garment_and_bone(tool, data_file, body, options, clip):
    """Garments go with the hips alone, so that limbs run through them, and hands into the body."""
    source = body if body == "mannequin" else data_file("bodies", body)
    avatar = gs.Avatar.load(source, **options)
    garments = avatar.dress("tshirt_long_skirt").garments
    ours = PiercedMeter(avatar.colliders)
    theirs = tool.Pierced(json.loads(to_json(avatar.colliders))["colliders"])
    hips = avatar.body.rig.index(avatar.body.humanoid["hips"])
    back = np.linalg.inv(rest_transforms(avatar.body.rig)[hips])
    for n, joints in enumerate(
        avatar.joints(gs.load_clip(data_file("mocap", clip)), 4, seconds=9)
    ):
        poses = avatar.poses(joints)
        moved = joints[hips] @ back
        x = {g.name: g.vertices @ moved[:3, :3].T + moved[:3, 3] for g in garments}
        ours.add(poses, {g.name: (x[g.name], g.triangles) for g in garments})
        theirs.add(
            n,
            np.concatenate([poses.position, poses.orientation], axis=1),
            {g.name: x[g.name][g.triangles] for g in garments},
        )
    mine, other = ours.result(), theirs.result()
    assert mine.frames == other["frames"]
    assert mine.share > 0.1
    assert mine.pierced == other["pierced"]
    assert mine.by_bone == other["frames_by_garment_and_bone"]
    excused = sum(bool(excuses) for *_, excuses in theirs.found)
    assert options or excused > 0
