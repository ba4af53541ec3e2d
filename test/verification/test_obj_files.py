"""Real OBJ bodies load as their makers made them."""

import numpy as np
import pytest
import trimesh

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.major_bones import major_bones


def surface(body):
    return trimesh.Trimesh(body.skin.vertices, body.skin.triangles, process=False)


@pytest.mark.parametrize(
    ("file", "vertices", "triangles", "height", "volume", "closed"),
    [
        ("f_smpl_average_A40.obj", 6890, 13776, 1.658, 0.0683, True),
        ("m_smpl_average_A40.obj", 6890, 13776, 1.791, 0.0822, True),
        ("mh_proxy_female1605.obj", 1605, 3168, 1.604, None, False),
    ],
)
def test_static_bodies(data_file, file, vertices, triangles, height, volume, closed):
    body = load_body(data_file("bodies", file))
    mesh = surface(body)
    assert mesh.vertices.shape == (vertices, 3)
    assert mesh.faces.shape == (triangles, 3)
    assert mesh.is_watertight == closed
    np.testing.assert_allclose(mesh.bounds[:, 2], [0.0, height], atol=1e-3)
    if volume is not None:
        assert mesh.volume == pytest.approx(volume, abs=1e-4)
    hands = mesh.vertices[np.abs(mesh.vertices[:, 1]) > 0.4]
    assert {1.0, -1.0} == set(np.sign(hands[:, 1]))
    assert any("facing +z" in note for note in body.notes)


def test_makehuman_base_mesh(data_file):
    body = load_body(data_file("bodies", "makehuman", "base.obj"))
    mesh = surface(body)
    assert mesh.vertices.shape == (13380, 3)
    assert mesh.faces.shape == (26756, 3)
    assert mesh.is_watertight
    assert len(body.rig) == 163
    assert (body.skin.weight > 0).sum(axis=1).max() == 9
    assert len(major_bones(body)) == 18
    assert any("0.954..1.063" in note for note in body.notes)
    # The same rig as in the glTF file made from it, on another shape.
    other = load_body(data_file("bodies", "mh_female_young.glb"))
    assert set(other.rig.joint_names) == set(body.rig.joint_names)
    assert other.humanoid == body.humanoid
    T, T_other = rest_transforms(body.rig), rest_transforms(other.rig)
    for name in ("head", "wrist.L", "foot.R", "root"):
        a, b = T[body.rig.index(name)], T_other[other.rig.index(name)]
        np.testing.assert_allclose(a[:3, :3], b[:3, :3], atol=1e-6)
        np.testing.assert_allclose(a[:3, 3], b[:3, 3], atol=0.1)
