"""glTF skins: what the format allows, and files that are not usable."""

import base64
import json
import struct

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.gltf import load_gltf
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP

COMPONENT = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125, "i2": 5122, "i1": 5120}
KIND = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Builder:
    """A glTF document under construction; tests change `json` before it is written."""

    def __init__(self):
        self.binary = b""
        self.json = {
            "asset": {"version": "2.0"},
            "nodes": [],
            "meshes": [],
            "skins": [],
            "accessors": [],
            "bufferViews": [],
        }

    def view(self, data):
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        )
        self.binary += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, array, dtype, normalized=False):
        array = np.asarray(array, dtype="<" + dtype)
        accessor = {
            "bufferView": self.view(array.tobytes()),
            "componentType": COMPONENT[dtype],
            "count": len(array),
            "type": KIND[array.size // len(array)],
        }
        if normalized:
            accessor["normalized"] = True
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def glb(self, path):
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        total = 12 + 8 + len(text) + 8 + len(binary)
        path.write_bytes(
            struct.pack("<4sII", b"glTF", 2, total)
            + struct.pack("<I4s", len(text), b"JSON")
            + text
            + struct.pack("<I4s", len(binary), b"BIN\0")
            + binary
        )
        return path


SIZE = np.array([0.4, 1.8, 0.2])


def column(seams=False):
    """A closed box 1.8 m high standing on y = 0, its weights shared by two joints by height."""
    box = trimesh.creation.box(extents=SIZE).subdivide().subdivide()
    box.apply_translation([0.0, SIZE[1] / 2, 0.0])
    if seams:
        box.unmerge_vertices()
    upper = np.clip(box.vertices[:, 1] / SIZE[1], 0.0, 1.0)
    return np.asarray(box.vertices), np.asarray(box.faces), upper


def document(*, seams=False, weight=("f4", 1.0, False), scale=1.0, root_scale=1.0, index="u2"):
    """Nodes: 0 armature, 1 'low', 2 'high' at half height, 3 the mesh.

    The mesh is `scale` times as large as the armature's nodes show it after `root_scale`.
    """
    b = Builder()
    x, faces, upper = column(seams)
    dtype, factor, normalized = weight
    w = np.zeros((len(x), 4))
    w[:, 0], w[:, 1] = (1 - upper) * factor, upper * factor
    joints = np.zeros((len(x), 4))
    joints[:, 1] = 1
    half = SIZE[1] / 2 / root_scale
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, 1, 3] = -half
    bind = bind @ np.diag([scale / root_scale] * 3 + [1.0])
    b.json["nodes"] = [
        {"name": "armature", "children": [1], "scale": [root_scale] * 3},
        {"name": "low", "children": [2]},
        {"name": "high", "translation": [0.0, half, 0.0]},
        {"name": "mesh", "mesh": 0, "skin": 0},
    ]
    b.json["skins"] = [
        {"joints": [1, 2], "inverseBindMatrices": b.accessor(bind.transpose(0, 2, 1), "f4")}
    ]
    b.json["meshes"] = [
        {
            "primitives": [
                {
                    "attributes": {
                        "POSITION": b.accessor(x / scale, "f4"),
                        "JOINTS_0": b.accessor(joints, "u1"),
                        "WEIGHTS_0": b.accessor(w, dtype, normalized),
                    },
                    "indices": b.accessor(faces.reshape(-1), index),
                }
            ]
        }
    ]
    return b


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


def test_repairable_weights_are_repaired_and_noted(tmp_path):
    b = document()
    x, _, upper = column()
    w = np.zeros((len(x), 4))
    w[:, 0], w[:, 1] = 2 * (1 - upper), 2 * upper
    w[7] = 0.0
    attributes = b.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["WEIGHTS_0"] = b.accessor(w, "f4")
    body = load_gltf(b.glb(tmp_path / "w.glb"))
    np.testing.assert_allclose(body.skin.weight.sum(axis=1), 1.0)
    assert any("1 vertices without weights" in note for note in body.notes)
    assert any("summed to" in note for note in body.notes)


def accessor_of(b, name):
    return b.json["accessors"][b.json["meshes"][0]["primitives"][0]["attributes"][name]]


def no_skin(b):
    del b.json["nodes"][3]["skin"]


def cycle(b):
    b.json["nodes"][2]["children"] = [1]
    b.json["nodes"][0]["children"] = []


def two_parents(b):
    b.json["nodes"][0]["children"] = [1, 2]


def nan_vertex(b):
    offset = b.json["bufferViews"][accessor_of(b, "POSITION")["bufferView"]]["byteOffset"]
    b.binary = b.binary[:offset] + struct.pack("<f", np.nan) + b.binary[offset + 4 :]


def all_weights_zero(b):
    attributes = b.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["WEIGHTS_0"] = b.accessor(np.zeros((accessor_of(b, "POSITION")["count"], 4)), "f4")


def negative_weights(b):
    attributes = b.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["WEIGHTS_0"] = b.accessor(-np.ones((accessor_of(b, "POSITION")["count"], 4)), "f4")


def joint_out_of_range(b):
    attributes = b.json["meshes"][0]["primitives"][0]["attributes"]
    count = accessor_of(b, "POSITION")["count"]
    attributes["JOINTS_0"] = b.accessor(np.full((count, 4), 9), "u1")


def index_out_of_range(b):
    b.json["meshes"][0]["primitives"][0]["indices"] = b.accessor([0, 1, 60000], "u2")


def singular_bind(b):
    b.json["skins"][0]["inverseBindMatrices"] = b.accessor(np.zeros((2, 16)), "f4")


def change(target, **values):
    return lambda b: (target(b) if callable(target) else b.json[target]).update(values)


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (no_skin, "no skinned mesh"),
        (cycle, "own ancestors"),
        (two_parents, "two parents"),
        (nan_vertex, "not finite"),
        (all_weights_zero, "no vertex has a skin weight"),
        (negative_weights, "not negative"),
        (joint_out_of_range, "joint 9"),
        (index_out_of_range, "vertex 60000"),
        (singular_bind, "."),
        (change("asset", version="1.0"), "version '1.0'"),
        (change(lambda b: b.json, nodes=5), "nodes is malformed"),
        (change(lambda b: b.json, nodes=[]), "0 nodes"),
        (change(lambda b: b.json, extensionsRequired=["KHR_draco_mesh_compression"]), "draco"),
        (change(lambda b: b.json["nodes"][0], children=[99]), "child 99"),
        (change(lambda b: b.json["nodes"][0], scale=[1, 1]), "3 finite numbers"),
        (change(lambda b: b.json["nodes"][0], rotation=[0, 0, 0, 0]), "rotation"),
        (change(lambda b: b.json["nodes"][3], mesh=True), "mesh is True"),
        (change(lambda b: b.json["nodes"][3], skin=7), "skin is 7"),
        (change(lambda b: b.json["skins"][0], joints=[]), "0 joints"),
        (change(lambda b: b.json["skins"][0], joints=[1, -2]), "not there"),
        (change(lambda b: accessor_of(b, "POSITION"), count=10**15), "declares"),
        (change(lambda b: accessor_of(b, "POSITION"), count=10**7), "ends at byte"),
        (change(lambda b: accessor_of(b, "POSITION"), byteOffset=10**12), "ends at byte"),
        (change(lambda b: accessor_of(b, "POSITION"), byteOffset=-4), "byteOffset is -4"),
        (change(lambda b: accessor_of(b, "POSITION"), type="VEC2"), "type 'VEC2'"),
        (change(lambda b: accessor_of(b, "POSITION"), componentType=1), "componentType 1"),
        (change(lambda b: accessor_of(b, "JOINTS_0"), count=3), "3 JOINTS_0"),
        (change(lambda b: b.json["bufferViews"][0], byteLength=10**12), "buffer"),
        (change(lambda b: b.json["bufferViews"][0], byteStride=1), "ends at byte"),
    ],
)
def test_damaged_files_are_one_clear_error(tmp_path, damage, problem):
    b = document()
    damage(b)
    path = b.glb(tmp_path / "bad.glb")
    with pytest.raises(InputFileError, match=problem) as raised:
        load_gltf(path)
    assert str(raised.value).startswith(str(path))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"glTF",
        b"hello",
        b"{}",
        b"[]",
        b"null",
        b'{"asset": {"version": "2.0"}, "x": NaN}',
        b"[" * 100_000,
        b"\xff\xfe\x00\x00",
        b"glTF" + struct.pack("<II", 2, 2**32 - 1) + b"\0" * 40,
    ],
)
def test_other_content_is_one_clear_error(tmp_path, content):
    path = tmp_path / "bad.glb"
    path.write_bytes(content)
    with pytest.raises(InputFileError):
        load_gltf(path)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(InputFileError, match="does not exist"):
        load_gltf(tmp_path / "no.glb")
    with pytest.raises(InputFileError, match="allowed: a regular file"):
        load_gltf(tmp_path)


def test_every_truncation_is_one_clear_error(tmp_path):
    whole = document().glb(tmp_path / "a.glb").read_bytes()
    for length in range(0, len(whole), 97):
        (tmp_path / "cut.glb").write_bytes(whole[:length])
        with pytest.raises(InputFileError):
            load_gltf(tmp_path / "cut.glb")


def test_buffers_outside_the_folder_are_refused(tmp_path):
    b = document()
    for uri in ("../secret.bin", "/etc/passwd", "https://example.org/a.bin", "data:,x"):
        b.json["buffers"] = [{"byteLength": len(b.binary), "uri": uri}]
        (tmp_path / "a.gltf").write_text(json.dumps(b.json))
        with pytest.raises(InputFileError):
            load_gltf(tmp_path / "a.gltf")


def test_random_damage_never_raises_anything_else(tmp_path):
    whole = document().glb(tmp_path / "a.glb").read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(150):
        damaged = bytearray(whole)
        for at in rng.integers(12, len(whole), size=rng.integers(1, 6)):
            damaged[at] = rng.integers(256)
        (tmp_path / "b.glb").write_bytes(damaged)
        try:
            body = load_gltf(tmp_path / "b.glb")
        except InputFileError:
            continue
        assert np.isfinite(body.skin.vertices).all()
