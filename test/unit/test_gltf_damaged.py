"""Damaged glTF files: each is one clear error."""

import json
import struct

import numpy as np
import pytest
from hostile.gltf_files import column, document

from garment_sim_ros.body.loaders.gltf import load_gltf
from garment_sim_ros.errors import InputFileError


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
        (change(lambda b: b.json, extensionsRequired=["EXT_meshopt_compression"]), "meshopt"),
        (change(lambda b: b.json["nodes"][0], children=[99]), "child 99"),
        (change(lambda b: b.json["nodes"][0], scale=[1, 1]), "3 finite numbers"),
        (change(lambda b: b.json["nodes"][0], rotation=[0, 0, 0, 0]), "rotation"),
        (change(lambda b: b.json["nodes"][3], mesh=True), "mesh is True"),
        (change(lambda b: b.json["nodes"][3], skin=7), "skin is 7"),
        (change(lambda b: b.json["skins"][0], joints=[]), "0 joints"),
        (
            change(lambda b: b.json["skins"][0], joints=[1, -2]),
            "skin 0 names the node -2; allowed: 0 to",
        ),
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
