"""Real bodies keep their volume and stay closed when joints bend."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms, world_from_local
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skinning import METHODS, Skinner


def bent(body, bone, axis, degrees):
    """World transforms with one humanoid bone turned about a world axis."""
    joint = body.rig.index(body.humanoid[bone])
    R = rest_transforms(body.rig)[joint, :3, :3]
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array(axis)).as_matrix()
    T_local = body.rig.T_parent_joint.copy()
    T_local[joint, :3, :3] = T_local[joint, :3, :3] @ R.T @ turn @ R
    return world_from_local(body.rig, T_local)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("file", ["mh_female_young.glb", "CesiumMan.glb"])
@pytest.mark.parametrize(
    ("bone", "axis", "degrees"),
    [
        ("leftLowerLeg", (0.0, 1.0, 0.0), 80.0),
        ("rightLowerArm", (0.0, 0.0, 1.0), 80.0),
        ("leftUpperLeg", (0.0, 1.0, 0.0), -60.0),
        ("rightUpperArm", (1.0, 0.0, 0.0), -45.0),
    ],
)
def test_bent_joint_keeps_the_volume(data_file, file, method, bone, axis, degrees):
    body = load_body(data_file("bodies", file))
    T = bent(body, bone, axis, degrees)
    x = Skinner(body.skin, method, body.rig.parent).vertices(T)
    rest = trimesh.Trimesh(body.skin.vertices, body.skin.triangles, process=False)
    posed = trimesh.Trimesh(x, body.skin.triangles, process=False)
    assert posed.volume == pytest.approx(rest.volume, rel=0.03)
    assert np.linalg.norm(x - body.skin.vertices, axis=1).max() > 0.1  # it did move


def test_normals_point_outwards(data_file):
    body = load_body(data_file("bodies", "mh_female_young.glb"))
    skinner = Skinner(body.skin)
    x = skinner.vertices(rest_transforms(body.rig))
    normal = skinner.normals()
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)
    chest = np.argmax(np.where(np.abs(x[:, 2] - 1.15) < 0.05, x[:, 0], -1.0))
    assert normal[chest, 0] > 0.7
