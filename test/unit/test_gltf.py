"""glTF skins: what the format allows, and files that are not usable."""

import base64
import json

import numpy as np
import pytest
import trimesh
from hostile.gltf_files import SIZE, column, document
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.gltf import load_gltf
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP


def check_column(body):
    mesh = trimesh.Trimesh(body.skin.vertices, body.skin.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(SIZE.prod(), rel=1e-4)
    np.testing.assert_allclose(mesh.bounds[:, 2], [0.0, 1.8], atol=1e-5)
    np.testing.assert_allclose(mesh.bounds[:, 1], [-0.2, 0.2], atol=1e-5)
    T = rest_transforms(body.rig)
    np.testing.assert_allclose(T[body.rig.index("high"), :3, 3], [0.0, 0.0, 0.9], atol=1e-5)
    np.testing.assert_allclose(
        T[:, :3, :3] @ T[:, :3, :3].transpose(0, 2, 1), [np.eye(3)] * len(T), atol=1e-6
    )
    np.testing.assert_allclose(skin_vertices(body.skin, T), body.skin.vertices, atol=1e-9)
    T[body.rig.index("high"), :3, 3] += (0.0, 0.0, 0.5)
    moved = skin_vertices(body.skin, T)[:, 2] - body.skin.vertices[:, 2]
    np.testing.assert_allclose(moved, 0.5 * body.skin.vertices[:, 2] / 1.8, atol=2e-3)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"seams": True},
        {"weight": ("u1", 255.0, True)},
        {"weight": ("u2", 65535.0, True), "index": "u4"},
        {"root_scale": 0.01},
        {"root_scale": 100.0, "scale": 0.5},
        {"scale": 0.001},
    ],
)
def test_the_same_column_however_it_is_written(tmp_path, options):
    body = load_gltf(document(**options).glb(tmp_path / "column.glb"))
    assert body.rig.joint_names == ("low", "high")
    check_column(body)


def test_extensions_that_say_how_things_look_change_nothing(tmp_path):
    b = document()
    b.json["extensionsRequired"] = ["KHR_materials_clearcoat", "EXT_texture_avif"]
    check_column(load_gltf(b.glb(tmp_path / "shiny.glb")))


def test_text_file_with_embedded_and_with_outer_buffer(tmp_path):
    b = document()
    uri = "data:application/octet-stream;base64," + base64.b64encode(b.binary).decode()
    b.json["buffers"] = [{"byteLength": len(b.binary), "uri": uri}]
    (tmp_path / "a.gltf").write_text(json.dumps(b.json))
    check_column(load_gltf(tmp_path / "a.gltf"))
    b.json["buffers"][0]["uri"] = "my%20data.bin"
    (tmp_path / "my data.bin").write_bytes(b.binary)
    (tmp_path / "b.gltf").write_text(json.dumps(b.json))
    check_column(load_gltf(tmp_path / "b.gltf"))


def test_several_meshes_skins_and_influence_sets_are_one_skin(tmp_path):
    """The column cut in two meshes, the second with a skin of its own and JOINTS_1."""
    b = document()
    primitive = b.json["meshes"][0]["primitives"][0]
    x, faces, upper = column()
    cut = len(faces) // 2
    primitive["indices"] = b.accessor(faces[:cut].reshape(-1), "u2")
    low = np.zeros((len(x), 4))
    low[:, 0] = 1 - upper
    high = np.zeros((len(x), 4))
    high[:, 3] = upper
    zeros, ones = np.zeros((len(x), 4)), np.ones((len(x), 4))
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[0, 1, 3] = -0.9
    b.json["skins"].append(
        {"joints": [2, 1], "inverseBindMatrices": b.accessor(bind.transpose(0, 2, 1), "f4")}
    )
    b.json["meshes"].append(
        {
            "primitives": [
                {
                    "attributes": {
                        "POSITION": b.accessor(x, "f4"),
                        "JOINTS_0": b.accessor(ones, "u1"),
                        "WEIGHTS_0": b.accessor(low, "f4"),
                        "JOINTS_1": b.accessor(zeros, "u2"),
                        "WEIGHTS_1": b.accessor(high, "f4"),
                    },
                    "indices": b.accessor(faces[cut:].reshape(-1), "u2"),
                }
            ]
        }
    )
    b.json["nodes"].append({"mesh": 1, "skin": 1})
    check_column(load_gltf(b.glb(tmp_path / "two.glb")))


def test_bind_pose_is_the_rest_pose_where_nodes_are_animated(tmp_path):
    b = document()
    turn = Rotation.from_euler("x", 80, degrees=True).as_quat().tolist()
    b.json["nodes"][2]["rotation"] = turn
    b.json["nodes"][1]["rotation"] = Rotation.from_euler("y", 20, degrees=True).as_quat().tolist()
    body = load_gltf(b.glb(tmp_path / "posed.glb"))
    check_column(body)
    assert "bind pose taken" in body.notes[0]


def test_rest_pose_of_scaled_bones_is_baked(tmp_path):
    b = document()
    b.json["nodes"][2]["translation"] = [0.0, 1.0, 0.0]
    body = load_gltf(b.glb(tmp_path / "stretched.glb"))
    assert "bone lengths" in body.notes[0]
    assert body.skin.vertices[:, 2].max() == pytest.approx(1.9, abs=1e-5)
    T = rest_transforms(body.rig)
    np.testing.assert_allclose(skin_vertices(body.skin, T), body.skin.vertices, atol=1e-9)


def test_mirrored_skeleton_keeps_normals_outwards(tmp_path):
    b = document()
    b.json["nodes"][0]["scale"] = [-1.0, 1.0, 1.0]
    body = load_gltf(b.glb(tmp_path / "mirrored.glb"))
    mesh = trimesh.Trimesh(body.skin.vertices, body.skin.triangles, process=False)
    assert mesh.volume == pytest.approx(SIZE.prod(), rel=1e-4)


def test_rigid_mesh_on_a_joint_joins_the_skin_and_a_loose_one_is_named(tmp_path):
    b = document()
    hat = trimesh.creation.box(extents=(0.1, 0.1, 0.1))
    attributes = {"POSITION": b.accessor(hat.vertices, "f4")}
    indices = b.accessor(hat.faces.reshape(-1), "u1")
    b.json["meshes"].append({"primitives": [{"attributes": attributes, "indices": indices}]})
    b.json["nodes"] += [
        {"name": "hat", "mesh": 1, "translation": [0.0, 1.0, 0.0]},
        {"name": "chair", "mesh": 1},
    ]
    b.json["nodes"][2]["children"] = [4]
    body = load_gltf(b.glb(tmp_path / "hat.glb"))
    assert body.skin.vertices[:, 2].max() == pytest.approx(1.95, abs=1e-5)
    assert any("node 5" in note for note in body.notes)


def test_sparse_accessors(tmp_path):
    b = document()
    x, _, _ = column()
    position = b.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    accessor = b.json["accessors"][position]
    top = np.argmax(x @ [1.0, 1.0, 1.0])
    accessor["sparse"] = {
        "count": 1,
        "indices": {"bufferView": b.view(np.array([top], "<u2").tobytes()), "componentType": 5123},
        "values": {"bufferView": b.view(np.array([[0.2, 2.0, 0.1]], "<f4").tobytes())},
    }
    body = load_gltf(b.glb(tmp_path / "sparse.glb"))
    assert body.skin.vertices[:, 2].max() == pytest.approx(2.0)


def test_joints_without_names_or_with_the_same_get_unique_ones(tmp_path):
    b = document()
    del b.json["nodes"][1]["name"]
    b.json["nodes"][2]["name"] = ""
    assert load_gltf(b.glb(tmp_path / "a.glb")).rig.joint_names == ("joint_1", "joint_2")
    b.json["nodes"][1]["name"] = b.json["nodes"][2]["name"] = "x"
    assert load_gltf(b.glb(tmp_path / "b.glb")).rig.joint_names == ("x", "x_2")


def test_two_roots_keep_their_common_ancestor(tmp_path):
    b = document()
    b.json["nodes"][0]["children"] = [1, 2]
    b.json["nodes"][1]["children"] = []
    rig = load_gltf(b.glb(tmp_path / "a.glb")).rig
    assert rig.joint_names == ("armature", "low", "high")
    assert rig.parent.tolist() == [-1, 0, 0]


@pytest.mark.parametrize("version", [0, 1])
def test_vrm_names_its_bones_and_turns_to_face_x(tmp_path, version):
    """A VRM 0.x model faces -z, so that its left leg has a negative x."""
    b = document()
    side = -1.0 if version == 0 else 1.0
    b.json["nodes"] += [
        {"name": "a", "translation": [0.1 * side, -0.1, 0.0]},
        {"name": "b", "translation": [-0.1 * side, -0.1, 0.0]},
    ]
    b.json["nodes"][1]["children"] = [2, 4, 5]
    names = {"hips": 1, "head": 2, "leftUpperLeg": 4, "rightUpperLeg": 5}
    if version == 0:
        bones = [{"bone": bone, "node": node} for bone, node in names.items()]
        b.json["extensions"] = {"VRM": {"humanoid": {"humanBones": bones}}}
    else:
        bones = {bone: {"node": node} for bone, node in names.items()}
        b.json["extensions"] = {"VRMC_vrm": {"humanoid": {"humanBones": bones}}}
    b.json["skins"][0]["joints"] = [1, 2, 4, 5]
    bind = np.tile(np.eye(4), (4, 1, 1))
    bind[1:, :3, 3] = [[0, -0.9, 0], [-0.1 * side, 0.1, 0], [0.1 * side, 0.1, 0]]
    b.json["skins"][0]["inverseBindMatrices"] = b.accessor(bind.transpose(0, 2, 1), "f4")
    body = load_gltf(b.glb(tmp_path / "model.vrm"))
    assert body.humanoid == {
        "hips": "low",
        "head": "high",
        "leftUpperLeg": "a",
        "rightUpperLeg": "b",
    }
    T = rest_transforms(body.rig)
    np.testing.assert_allclose(T[body.rig.index("a"), :3, 3], [0.0, 0.1, -0.1], atol=1e-6)
    assert bool(body.notes) == (version == 0)
    if version == 1:
        np.testing.assert_allclose(T[0, :3, :3], AXES_FROM_Y_UP)
