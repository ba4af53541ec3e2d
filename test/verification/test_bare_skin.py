"""Skin stays in the default colliders while real bodies move: what sticks out shows in cloth."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.report.motion_report import motion_report, range_report
from garment_sim_ros.mocap.clip_poses import clip_poses
from garment_sim_ros.mocap.clips import load_clip


def turned(body, *turns):
    """World transforms with bones turned from rest: (bone, rotation vector [degrees])."""
    T, parent = rest_transforms(body.rig), body.rig.parent
    for bone, vector in turns:
        joint = body.rig.index(body.humanoid[bone])
        below = {joint}
        for j in range(joint + 1, len(parent)):
            if int(parent[j]) in below:
                below.add(j)
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_rotvec(vector, degrees=True).as_matrix()
        turn[:3, 3] = T[joint, :3, 3] - turn[:3, :3] @ T[joint, :3, 3]
        T[sorted(below)] = turn @ T[sorted(below)]
    return T


def arms(body, up, forward=0.0, inward=0.0):
    """Both upper arms at an angle over the horizontal, then swung [degrees]."""
    T = rest_transforms(body.rig)
    turns = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder, elbow = (
            T[body.rig.index(body.humanoid[side + part]), :3, 3]
            for part in ("UpperArm", "LowerArm")
        )
        way = elbow - shoulder
        at_rest = np.degrees(np.arctan2(way[2], np.hypot(way[0], way[1])))
        swing = (
            Rotation.from_rotvec([0.0, 0.0, -sign * inward], degrees=True)
            * Rotation.from_rotvec([0.0, -forward, 0.0], degrees=True)
            * Rotation.from_rotvec([sign * (up - at_rest), 0.0, 0.0], degrees=True)
        )
        turns.append((side + "UpperArm", swing.as_rotvec(degrees=True)))
    return turns


def poses(body):
    """Arms raised, hanging and crossed, and a deep squat."""
    yield turned(body, *arms(body, 75.0))
    yield turned(body, *arms(body, -82.0))
    elbows = ("leftLowerArm", [0.0, 0.0, -95.0]), ("rightLowerArm", [0.0, 0.0, 95.0])
    yield turned(body, *arms(body, -75.0, 55.0, 25.0), *elbows)
    thighs = (("leftUpperLeg", [0.0, -100.0, 0.0]), ("rightUpperLeg", [0.0, -100.0, 0.0]))
    knees = (("leftLowerLeg", [0.0, 125.0, 0.0]), ("rightLowerLeg", [0.0, 125.0, 0.0]))
    yield turned(body, *thighs, *knees, ("spine", [0.0, 25.0, 0.0]))


@pytest.mark.parametrize(
    ("source", "most"),
    [
        ("mannequin", 0.002),
        pytest.param("mannequin:height=1.5", 0.002, marks=pytest.mark.slow),
        pytest.param("mannequin:height=1.95", 0.002, marks=pytest.mark.slow),
        ("mh_female_young.glb", 0.004),
        # A rig whose skin follows two bones 25 cm from both.
        ("CesiumMan.glb", 0.022),
    ],
)
def test_little_skin_is_out_of_all_shapes(data_file, source, most):
    body = load_body(source if "mannequin" in source else data_file("bodies", source))
    colliders = fit_colliders(body)
    assert motion_report(body, colliders, [rest_transforms(body.rig)])["bare_share"] == 0.0
    moving = list(poses(body))
    for clip in ("deepmimic_spinkick", "rokoko_jesse_dance", "deepmimic_cartwheel"):
        moving += clip_poses(load_clip(data_file("mocap", f"{clip}.bvh")), body, 4)
    report = motion_report(body, colliders, moving)
    assert 0.0 < report["bare_share"] < most
    # The fit's own report, over poses that the fit did not see, is as strict.
    assert range_report(body, colliders)["bare_share"] > 0.25 * report["bare_share"]
