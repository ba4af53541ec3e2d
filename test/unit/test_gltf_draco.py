"""glTF bodies and garments that Draco has compressed."""

import sys

import numpy as np
import pytest
from hostile.gltf_files import compressed, document

from garment_sim_ros.body.loaders.gltf import load_gltf
from garment_sim_ros.body.loaders.gltf_file import DRACO
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.garment.mesh import load_garment_mesh

pytest.importorskip("DracoPy")


def accessor_of(b, key):
    return b.json["accessors"][b.json["meshes"][0]["primitives"][0]["attributes"][key]]


def extension_of(b):
    return b.json["meshes"][0]["primitives"][0]["extensions"][DRACO]


def upper(body):
    """How much each vertex goes with the upper joint."""
    high = body.rig.index("high")
    return np.where(body.skin.bone == high, body.skin.weight, 0.0).sum(axis=1)


@pytest.mark.parametrize("weight", [("f4", 1.0, False), ("u2", 65535.0, True)])
def test_the_same_body_as_without_compression(tmp_path, weight):
    plain = load_gltf(document(weight=weight).glb(tmp_path / "plain.glb"))
    body = load_gltf(compressed(document(weight=weight)).glb(tmp_path / "small.glb"))
    np.testing.assert_array_equal(body.skin.triangles, plain.skin.triangles)
    np.testing.assert_allclose(body.skin.vertices, plain.skin.vertices, atol=1e-5)
    np.testing.assert_allclose(upper(body), upper(plain), atol=1e-6)
    assert body.rig.joint_names == plain.rig.joint_names


def test_vertices_in_another_order(tmp_path):
    """Draco numbers vertices anew: the triangles are the same ones, weights go with them."""
    plain = load_gltf(document().glb(tmp_path / "plain.glb"))
    body = load_gltf(compressed(document(), keep_order=False).glb(tmp_path / "small.glb"))

    def corners(of):
        x = of.skin.vertices[of.skin.triangles].mean(axis=1)
        w = upper(of)[of.skin.triangles].mean(axis=1)
        return np.column_stack([x, w])[np.lexsort(np.round(x, 3).T)]

    assert not np.allclose(body.skin.vertices, plain.skin.vertices, atol=0.1)
    np.testing.assert_allclose(corners(body), corners(plain), atol=1e-5)


def test_what_is_there_uncompressed_is_read_from_there(tmp_path):
    b = document()
    before = [dict(a) for a in b.json["accessors"]]
    compressed(b)
    b.json["accessors"] = before
    del b.json["extensionsRequired"]
    extension_of(b)["bufferView"] = 99  # not looked at
    plain = load_gltf(document().glb(tmp_path / "plain.glb"))
    body = load_gltf(b.glb(tmp_path / "both.glb"))
    np.testing.assert_array_equal(body.skin.vertices, plain.skin.vertices)


def test_what_is_sparse_is_no_part_of_the_compressed_data(tmp_path):
    """Zeros without data of their own, but for one vertex."""
    b = compressed(document())
    primitive = b.json["meshes"][0]["primitives"][0]
    count = accessor_of(b, "WEIGHTS_0")["count"]
    numbers, weights = (b.accessor(a, d) for a, d in (([0], "u2"), ([[0.5, 0.5, 0, 0]], "f4")))
    views = [b.json["accessors"][a]["bufferView"] for a in (numbers, weights)]
    sparse = {
        "count": 1,
        "indices": {"bufferView": views[0], "componentType": 5123},
        "values": {"bufferView": views[1]},
    }
    entry = {"componentType": 5126, "count": count, "type": "VEC4", "sparse": sparse}
    primitive["attributes"]["WEIGHTS_0"] = b.add("accessors", entry)
    body = load_gltf(b.glb(tmp_path / "sparse.glb"))
    np.testing.assert_allclose(upper(body), 0.5)  # the others are given the nearest one's weights


def test_the_compressed_data_tells_how_many_there_are(tmp_path):
    b = compressed(document())
    accessor_of(b, "POSITION")["count"] = 3
    plain = load_gltf(document().glb(tmp_path / "plain.glb"))
    assert len(load_gltf(b.glb(tmp_path / "less.glb")).skin.vertices) == len(plain.skin.vertices)


def test_a_garment(tmp_path):
    plain = load_garment_mesh(document().glb(tmp_path / "plain.glb"))
    garment = load_garment_mesh(compressed(document()).glb(tmp_path / "small.glb"))
    assert len(garment.triangles) == len(plain.triangles) > 0
    np.testing.assert_allclose(garment.vertices, plain.vertices, atol=1e-5)


def test_without_the_package_the_error_says_what_to_install(tmp_path, monkeypatch):
    path = compressed(document()).glb(tmp_path / "small.glb")
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(InputFileError, match=r"garment_sim_ros\[draco\]"):
        load_gltf(path)


def nonsense(b):
    view = b.json["bufferViews"][extension_of(b)["bufferView"]]
    start = view["byteOffset"]
    b.binary[start : start + view["byteLength"]] = bytes(view["byteLength"])


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (nonsense, "damaged Draco data"),
        (lambda b: accessor_of(b, "JOINTS_0").update(type="VEC3"), "type 'VEC3'"),
        (lambda b: extension_of(b).update(bufferView=99), "bufferView is 99"),
        (lambda b: extension_of(b)["attributes"].pop("JOINTS_0"), "no JOINTS_0"),
        (lambda b: extension_of(b).update(attributes=[]), "no POSITION"),
        (lambda b: extension_of(b)["attributes"].update(WEIGHTS_0=77), "no WEIGHTS_0"),
        (lambda b: b.json["meshes"][0]["primitives"][0].update(mode=5), "other than triangles"),
        (lambda b: b.json["meshes"][0]["primitives"][0].update(extensions=5), "malformed"),
        (lambda b: b.json["meshes"][0]["primitives"][0].pop("extensions"), "no bufferView"),
        (lambda b: extension_of(b)["attributes"].update(POSITION=8), "POSITION has 4"),
    ],
)
def test_damaged_files_are_one_clear_error(tmp_path, damage, problem):
    b = compressed(document())
    damage(b)
    path = b.glb(tmp_path / "bad.glb")
    with pytest.raises(InputFileError, match=problem) as raised:
        load_gltf(path)
    assert str(raised.value).startswith(str(path))
