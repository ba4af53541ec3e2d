"""Files of sewn garments: what is written is read, what is damaged is refused."""

import json
import struct

import numpy as np
import pytest
from simple_patterns import tube

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.garment.mesh import load_garment_mesh
from garment_sim_ros.garment.patterns.pieces import cut
from garment_sim_ros.garment.sewn_file import read_sewn, write_sewn


@pytest.fixture
def sewn(tmp_path):
    pieces = cut(tube(other=0.5), 0.06)
    x = pieces.joined(pieces.placed())
    panel = pieces.panel[pieces.triangles[:, 0]]
    path = tmp_path / "tube.glb"
    write_sewn(path, x, pieces.sewn_triangles, pieces.corners, panel, ("front", "back"))
    return path, pieces, x


def test_what_is_written_is_read(sewn):
    path, pieces, x = sewn
    mesh = load_garment_mesh(path, edge_length=0.01)
    assert mesh.vertices == pytest.approx(x, abs=1e-6)
    assert np.array_equal(mesh.triangles, pieces.sewn_triangles)
    assert mesh.flat == pytest.approx(pieces.corners, abs=1e-6)


def test_other_viewers_see_it_too(sewn):
    trimesh = pytest.importorskip("trimesh")
    path, pieces, _ = sewn
    scene = trimesh.load(path)
    (shown,) = scene.geometry.values()
    assert len(shown.faces) == len(pieces.triangles)
    assert shown.extents[1] == pytest.approx(0.5, abs=1e-5)  # y up
    uv = shown.visual.uv
    assert uv.min() >= -1e-6
    assert uv.max() <= 1.0 + 1e-6


def changed(path, change):
    data = path.read_bytes()
    size = struct.unpack("<I", data[12:16])[0]
    content = json.loads(data[20 : 20 + size])
    binary = bytearray(data[28 + size :])
    change(content, binary)
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    total = 20 + len(text) + 8 + len(binary)
    path.write_bytes(
        struct.pack("<4sII", b"glTF", 2, total)
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(binary), b"BIN\0")
        + binary
    )


def attribute(content, binary, name, value):
    k = content["meshes"][0]["primitives"][0]["attributes"][name]
    at = content["bufferViews"][content["accessors"][k]["bufferView"]]["byteOffset"]
    struct.pack_into("<f", binary, at, value)


@pytest.mark.parametrize(
    "change",
    [
        lambda c, b: attribute(c, b, "POSITION", np.nan),
        lambda c, b: attribute(c, b, "_THREADS", 1e9),
        lambda c, b: attribute(c, b, "_VERTEX", 1e9),
        lambda c, b: attribute(c, b, "_VERTEX", np.nan),
        lambda c, b: c["meshes"][0]["primitives"][0]["attributes"].pop("_VERTEX"),
        lambda c, b: c["accessors"][3].update(count=3),
        lambda c, b: c["meshes"][0].update(primitives=[]),
    ],
)
def test_damaged_files_are_refused_in_one_line(sewn, change):
    path, _, _ = sewn
    changed(path, change)
    with pytest.raises(InputFileError) as caught:
        read_sewn(path)
    assert "\n" not in str(caught.value)


def test_other_gltf_files_are_none_of_these(sewn):
    path, _, _ = sewn
    changed(path, lambda c, b: c["meshes"][0].pop("extras"))
    assert read_sewn(path) is None
