"""Real glTF bodies load as their makers made them."""

import numpy as np
import pytest
import trimesh

from garment_sim_ros.body.loaders.load import load_body


@pytest.mark.parametrize(
    ("file", "joints", "vertices", "triangles", "volume", "height"),
    [
        ("mh_female_young.glb", 163, 13380, 26756, 0.0480, 1.590),
        ("CesiumMan.glb", 19, 2338, 4672, 0.0537, 1.507),
    ],
)
def test_counts_and_volume(data_file, file, joints, vertices, triangles, volume, height):
    body = load_body(data_file("bodies", file))
    mesh = trimesh.Trimesh(body.skin.vertices, body.skin.triangles, process=False)
    assert len(body.rig) == joints
    assert body.skin.vertices.shape == (vertices, 3)
    assert body.skin.triangles.shape == (triangles, 3)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(volume, abs=1e-4)
    assert mesh.bounds[1, 2] == pytest.approx(height, abs=1e-3)
    assert mesh.bounds[0, 2] == pytest.approx(0.0, abs=1e-3)
    assert body.notes == ()


@pytest.mark.parametrize("file", ["mh_female_young.glb", "CesiumMan.glb"])
def test_faces_x_with_left_along_y(data_file, file):
    body = load_body(data_file("bodies", file))
    at = {
        bone: np.linalg.inv(body.skin.T_bone_bind[body.rig.index(joint)])[:3, 3]
        for bone, joint in body.humanoid.items()
    }
    assert at["leftHand"][1] > 0.2
    assert at["rightHand"][1] < -0.2
    toes = body.skin.vertices[body.skin.vertices[:, 2] < 0.03]
    assert toes[:, 0].max() > at["leftFoot"][0] + 0.05  # feet point forwards
