"""A real avatar whose file has an animation moves as its file says."""

import numpy as np
import pytest
from gltf_figure import nodes_at
from scipy.spatial.transform import Rotation

import garment_sim_ros as gs
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.mocap.clip_poses import retargeter
from garment_sim_ros.mocap.sampling import ClipSampler


@pytest.fixture(scope="module")
def path(data_file):
    return data_file("bodies", "CesiumMan.glb")


@pytest.fixture(scope="module")
def told(path):
    """Affine transforms of the joints by name at a time of the animation, the plain way."""
    file = GltfFile(path)
    (animation,) = file.list_of("animations")
    begins = min(file.accessor(s, "input", "SCALAR")[0] for s in animation["samplers"])
    names = [node.get("name", "") for node in file.list_of("nodes")]
    return lambda t: dict(zip(names, nodes_at(file, animation, begins + t)))


def times(clip):
    return np.linspace(0.0, clip.duration, 29)


def test_joints_are_where_the_nodes_are(path, told):
    clip = gs.load_clip(path)
    kinematics, sampler = ForwardKinematics(clip.rig), ClipSampler(clip)
    for t in times(clip):
        T, wanted = kinematics.from_dofs(sampler.sample(t)), told(t)
        at = np.array([wanted[name][:3, 3] for name in clip.rig.joint_names])
        np.testing.assert_allclose(T[:, :3, 3], at, atol=2e-6)


def test_its_own_body_turns_as_the_file_has_it(path, told):
    """Also about the bones, which only the file knows: nothing is compared by anatomy."""
    clip, body = gs.load_clip(path), gs.Avatar.load(path).body
    to_body, sampler = retargeter(clip, body), ClipSampler(clip)
    shifts = []
    for t in times(clip):
        T, wanted = to_body.world_joints(sampler.sample(t)), told(t)
        for name, T_joint in zip(body.rig.joint_names, T):
            U, _, Vt = np.linalg.svd(AXES_FROM_Y_UP @ wanted[name][:3, :3])
            turn = Rotation.from_matrix(T_joint[:3, :3].T @ U @ Vt).magnitude()
            assert np.degrees(turn) < 1e-3, name
            shifts.append(T_joint[:3, 3] - AXES_FROM_Y_UP @ wanted[name][:3, 3])
    # Its soles are 1.6 cm in the ground in its own file; here they are on it. Its motion has
    # shoulders that are up to 4 mm from where they are at rest.
    assert np.ptp(shifts, axis=0).max() < 0.008
    assert np.abs(np.mean(shifts, axis=0))[:2].max() < 0.003


def test_another_body_walks_by_it(path, data_file):
    """Two steps: each leg swings by what the file's does, and the feet take turns."""
    clip = gs.load_clip(path)
    swings = {}
    for body in ("mannequin", data_file("bodies", "mh_female_young.glb"), path):
        avatar = gs.Avatar.load(body)
        rig, bones = avatar.body.rig, avatar.body.humanoid
        thigh = {}
        for side in ("left", "right"):
            ends = [rig.index(bones[f"{side}{part}"]) for part in ("UpperLeg", "LowerLeg")]
            line = [np.subtract(*T[ends[::-1], :3, 3]) for T in avatar.joints(clip, 60.0)]
            thigh[side] = np.array([np.degrees(np.arctan2(x, -z)) for x, _, z in line])
        swings[str(body)] = thigh
    own = swings.pop(str(path))
    assert np.ptp(own["left"]) > 30.0
    for body, thigh in swings.items():
        for side, angle in thigh.items():
            centred = angle - angle.mean()
            difference = centred - (own[side] - own[side].mean())
            assert np.median(np.abs(difference)) < 3.0, (body, side)
            assert np.abs(difference).max() < 20.0, (body, side)  # as feet are put on the ground
