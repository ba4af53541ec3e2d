"""The motion capture files of the data set: unit, axes, bones, sampling."""

import numpy as np
import pytest

from garment_sim_ros.body.humanoid import humanoid_map
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.mocap.bvh import load_bvh
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.mocap.source_urdf import reference_from_urdf, urdf_from_clip

DEEPMIMIC = ("walk", "run", "jump", "cartwheel", "spinkick", "dance_a")
# name: frames, duration, unit, up axis, joints, reference pose needed
FILES = {
    "deepmimic_walk": (39, 38 * 0.033332, "metre", "+Y", 13, False),
    "deepmimic_run": (25, 24 * 0.033332, "metre", "+Y", 13, False),
    "deepmimic_jump": (107, 106 * 0.016666, "metre", "+Y", 13, False),
    "deepmimic_cartwheel": (164, 163 * 0.016666, "metre", "+Y", 13, False),
    "deepmimic_spinkick": (78, 77 * 0.016666, "metre", "+Y", 13, False),
    "deepmimic_dance_a": (98, 97 * 0.016666, "metre", "+Y", 13, False),
    "cmu_131_03_hop_spin": (1102, 1101 * 0.0083333, "CMU unit", "+Y", 31, False),
    "cmu_14_14_jumping_jacks_30fps": (125, 124 * 0.03333, "CMU unit", "+Y", 31, False),
    "fair_wave_hello": (839, 838 * 0.008342, "inch", "+Z", 27, False),
    "rokoko_jesse_dance": (1007, 1006 * 0.01, "centimetre", "+Y", 60, True),
}


def _sided(parts):
    return {
        side + bone: joint.format(S=side.capitalize(), s=side)
        for side in ("left", "right")
        for bone, joint in parts.items()
    }


CMU = {
    **{"hips": "Hips", "spine": "lowerback", "chest": "Chest", "upperChest": "Chest2"},
    **{"neck": "lowerneck", "head": "Head"},
    **_sided(
        {
            **{"Shoulder": "{S}Collar", "UpperArm": "{S}Shoulder", "LowerArm": "{S}Elbow"},
            **{"Hand": "{S}Wrist", "UpperLeg": "{S}Hip", "LowerLeg": "{S}Knee"},
            **{"Foot": "{S}Ankle", "Toes": "{S}Toe"},
        }
    ),
}
MIXAMO_LIMBS = _sided(
    {
        **{"Shoulder": "{S}Shoulder", "UpperArm": "{S}Arm", "LowerArm": "{S}ForeArm"},
        **{"Hand": "{S}Hand", "UpperLeg": "{S}UpLeg", "LowerLeg": "{S}Leg"},
        **{"Foot": "{S}Foot", "Toes": "{S}ToeBase"},
    }
)
BONES = {
    **{
        f"deepmimic_{name}": {
            **{"hips": "root", "chest": "chest", "neck": "neck"},
            **_sided(
                {
                    **{"UpperArm": "{s}_shoulder", "LowerArm": "{s}_elbow"},
                    **{"UpperLeg": "{s}_hip", "LowerLeg": "{s}_knee", "Foot": "{s}_ankle"},
                }
            ),
        }
        for name in DEEPMIMIC
    },
    "cmu_131_03_hop_spin": CMU,
    "cmu_14_14_jumping_jacks_30fps": CMU,
    "fair_wave_hello": {
        **{"hips": "Hips", "spine": "Spine", "chest": "Spine2", "upperChest": "Spine3"},
        **{"neck": "Neck", "head": "Head"},
        **MIXAMO_LIMBS,
    },
    "rokoko_jesse_dance": {
        **{"hips": "Hips", "spine": "Spine", "chest": "Spine1", "upperChest": "Spine2"},
        **{"neck": "Neck", "head": "Head"},
        **MIXAMO_LIMBS,
    },
}


@pytest.fixture(params=FILES)
def clip(request, data_file):
    return load_bvh(data_file("mocap", f"{request.param}.bvh"))


def test_file(clip):
    frames, duration, unit, up, joints, needs_reference = FILES[clip.name]
    assert len(clip.times) == frames  # none has an inserted pose
    assert clip.duration == pytest.approx(duration)
    assert len(clip.rig) == joints
    notes = " ".join(clip.notes)
    assert f"Unit taken as {unit} " in notes
    assert f"Up is {up}," in notes
    assert (clip.reference is not None) == needs_reference
    R = clip.T_world_file[:3, :3]
    np.testing.assert_array_equal(np.abs(R).sum(axis=0), 1.0)  # axes to axes
    assert np.linalg.det(R) == pytest.approx(1.0)


def test_bones(clip):
    assert humanoid_map(clip.rig.joint_names, clip.rig.parent) == BONES[clip.name]


def test_bones_after_the_way_through_a_urdf(clip):
    rig = parse_urdf(urdf_from_clip(clip))
    assert humanoid_map(rig.joint_names, rig.parent) == BONES[clip.name]
    assert rig.dofs.names == clip.rig.dofs.names
    ours, theirs = ForwardKinematics(clip.rig), ForwardKinematics(rig)
    index = [rig.index(name) for name in clip.rig.joint_names]
    for q in clip.values[:: max(1, len(clip.values) // 7)]:
        np.testing.assert_allclose(
            theirs.from_dofs(q)[index], ours.from_dofs(q, clip.T_world_file), atol=1e-12
        )
    found = reference_from_urdf(urdf_from_clip(clip))
    assert found.values == clip.source_reference.values


def test_body_is_upright_and_on_the_ground(clip):
    """Hips and head where a person's are; the hip heights are those that the data set states."""
    kinematics = ForwardKinematics(clip.rig)
    bones = BONES[clip.name]
    T = np.array([kinematics.from_dofs(q, clip.T_world_file).copy() for q in clip.values])
    hips = T[:, clip.rig.index(bones["hips"]), 2, 3]
    stated = {
        "deepmimic_jump": (0.60, 1.13),
        "cmu_131_03_hop_spin": (14.21 * 0.056444, 19.63 * 0.056444),
        "cmu_14_14_jumping_jacks_30fps": (15.56 * 0.056444, 19.97 * 0.056444),
        "fair_wave_hello": (23.59 * 0.0254, 23.65 * 0.0254),
        "rokoko_jesse_dance": (0.868, 1.299),
    }
    if clip.name in stated:
        low, high = stated[clip.name]
        assert hips.min() == pytest.approx(low, abs=0.02)
        assert hips.max() == pytest.approx(high, abs=0.02)
    neck = T[:, clip.rig.index(bones["neck"]), 2, 3]
    if clip.name == "deepmimic_cartwheel":
        assert (neck - hips).min() == pytest.approx(-0.35, abs=0.02)
    else:
        assert (neck - hips).min() > 0.2
    feet = T[:, [clip.rig.index(bones[f"{side}Foot"]) for side in ("left", "right")], 2, 3]
    assert -0.05 < feet.min() < 0.15
    assert clip.ankle_height == pytest.approx(np.percentile(feet.min(axis=1), 2), abs=0.01)


def test_sampling_between_frames_stays_between_them(clip):
    """Every joint's world rotation half way lies half way: no flips, no wrong-way turns."""
    sampler = ClipSampler(clip)
    kinematics = ForwardKinematics(clip.rig)
    for i in range(0, len(clip.times) - 1, max(1, len(clip.times) // 60)):
        a, m, b = (
            kinematics.from_dofs(q).copy()[:, :3, :3]
            for q in (
                clip.values[i],
                sampler.sample(0.5 * (clip.times[i] + clip.times[i + 1])),
                clip.values[i + 1],
            )
        )
        whole, first = _angle(a, b), _angle(a, m)
        assert (first <= 0.75 * whole + 0.03).all()


def _angle(a, b):
    trace = np.einsum("kij,kij->k", a, b)
    return np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))


def test_walk_is_carried_on(data_file):
    clip = load_bvh(data_file("mocap", "deepmimic_walk.bvh"))
    sampler = ClipSampler(clip, "carry")
    kinematics = ForwardKinematics(clip.rig)
    times = np.arange(0.0, 5.0 * clip.duration, 0.002)
    T = np.array(
        [kinematics.from_dofs(sampler.sample(t), clip.T_world_file).copy() for t in times]
    )
    speed = np.linalg.norm(np.diff(T[:, :, :3, 3], axis=0), axis=2) / 0.002
    assert speed[:, 0].max() < 1.6  # the root: no jump at a seam
    assert speed.max() < 6.5  # any joint
    way = np.linalg.norm(T[-1, 0, :2, 3] - T[0, 0, :2, 3])
    assert way > 4.5
