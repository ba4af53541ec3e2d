"""Garment meshes from files: what is read, repaired and refused."""

import json
import struct

import numpy as np
import pytest

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.garment import polygon_files
from garment_sim_ros.garment.mesh import load_garment_mesh

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"


def obj(tmp_path, text):
    path = tmp_path / "cloth.obj"
    path.write_text(text)
    return path


def area(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def test_axes_and_units(tmp_path):
    path = obj(tmp_path, QUAD.replace("v 1 1 0", "v 1 1 3"))
    turned = load_garment_mesh(path, unit="cm")
    # y up, facing +z becomes z up, facing +x.
    assert turned.vertices[2] == pytest.approx([0.03, 0.01, 0.01])
    kept = load_garment_mesh(path, unit="mm", up="z")
    assert kept.vertices[2] == pytest.approx([0.001, 0.001, 0.003])


def test_quads_split_along_the_shorter_diagonal(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 3 1 0\nv 0 1 0\nf 1 2 3 4\n"
    mesh = load_garment_mesh(obj(tmp_path, text), up="z")
    edges = {frozenset(pair) for t in mesh.triangles.tolist() for pair in zip(t, t[1:] + t[:1])}
    assert frozenset((1, 3)) in edges
    assert frozenset((0, 2)) not in edges


def test_concave_quad_splits_at_its_inner_corner(tmp_path):
    # An arrow head: its shorter diagonal lies outside.
    text = "v 0 0 0\nv 2 -1 0\nv 0.6 0 0\nv 2 1 0\nf 2 3 4 1\n"
    mesh = load_garment_mesh(obj(tmp_path, text), up="z")
    x = mesh.vertices[mesh.triangles]
    assert (np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])[:, 2] > 0.0).all()
    assert area(mesh) == pytest.approx(2.0 - 1.4)


def test_polygons_indices_and_comments(tmp_path):
    text = (
        "# cloth\r\nv 0 0 0 1 1 1\r\nv 2 0 0\r\nv 3 1 0\r\nv 2 2 0 # corner\r\nv 0 2 0\r\n"
        "vt 0 0\r\nf -5/1/1 -4//2 -3 \\\r\n -2 -1\r\n"
    )
    mesh = load_garment_mesh(obj(tmp_path, text), up="z")
    assert len(mesh.triangles) == 3
    assert area(mesh) == pytest.approx(5.0)


def test_repairs_are_named(tmp_path):
    text = (
        "v 9 9 9\n"  # nothing uses it
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
        "v 1 0 0\n"  # at the place of another
        "f 2 3 4\nf 4 6 2\n"  # one triangle twice, by the second name of a corner
        "f 2 5 4\n"  # turned against its neighbour
        "f 2 2 3\n"  # no area
        "v 5 0 0\nv 6 0 0\nv 5 1 0\nf 7 8 9\n"  # a part of its own
    )
    mesh = load_garment_mesh(obj(tmp_path, text), up="z")
    notes = " | ".join(mesh.notes)
    assert "1 vertices at the place of another were welded" in notes
    assert "1 vertices that no triangle uses were dropped" in notes
    assert "1 degenerate triangles were dropped" in notes
    assert "1 repeated triangles were dropped" in notes
    assert "1 triangles were turned" in notes
    assert "2 separate parts" in notes
    assert mesh.vertices[:4] == pytest.approx(
        np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    )
    assert len(mesh.triangles) == 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("v 0 0 0\nv 1 0 0\n", "no polygons"),
        (QUAD.replace("v 1 1 0", "v 1 nan 0"), "vertex 2 is not finite"),
        (QUAD.replace("v 1 1 0", "v 1 inf 0"), "vertex 2 is not finite"),
        (QUAD + "f 1 2 9\n", "vertex 8; allowed: 0 to 3"),
        (QUAD + "f 1 2 -9\n", "vertex -5"),
        (QUAD + "f 0 1 2\n", "line 6 reads 'f 0 1 2'"),
        (QUAD + "f 1 2\n", "line 6 reads 'f 1 2'"),
        (QUAD + "f a b c\n", "line 6 reads 'f a b c'"),
        ("v 0 0\n" + QUAD, "line 1 reads 'v 0 0'"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no triangle with an area"),
        (QUAD + "v 0 0 1\nf 1 3 5\n", "1 edges have more than 2 triangles"),
        (QUAD + "v -1 0 0\nv -1 -1 0\nf 1 5 6\n", "1 vertices join fans"),
    ],
)
def test_refused(tmp_path, text, message):
    path = obj(tmp_path, text)
    with pytest.raises(InputFileError) as error:
        load_garment_mesh(path, up="z")
    assert message in str(error.value)
    assert str(error.value).startswith(str(path))


def test_one_sided_surface_is_refused(tmp_path):
    n = 8
    lines = []
    for i in range(n):
        angle, twist = 2 * np.pi * i / n, np.pi * i / n
        for side in (-0.3, 0.3):
            r = 1 + side * np.cos(twist)
            p = (r * np.cos(angle), r * np.sin(angle), side * np.sin(twist))
            lines.append("v {:.9f} {:.9f} {:.9f}".format(*p))
    for i in range(n):
        a, b, c, d = 2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2
        if i == n - 1:
            c, d = 0, 1  # joined with a half turn
        lines.append(f"f {a + 1} {b + 1} {c + 1}\nf {a + 1} {c + 1} {d + 1}")
    with pytest.raises(InputFileError, match="one side"):
        load_garment_mesh(obj(tmp_path, "\n".join(lines)), up="z")


def test_missing_folder_and_type(tmp_path):
    with pytest.raises(InputFileError, match="does not exist"):
        load_garment_mesh(tmp_path / "no.obj")
    with pytest.raises(InputFileError, match=r"type '\.txt'; allowed: \.obj, \.ply, \.glb"):
        load_garment_mesh(tmp_path / "cloth.txt")
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(InputFileError, match="allowed: a regular file"):
        load_garment_mesh(tmp_path / "folder.obj")
    binary = tmp_path / "binary.obj"
    binary.write_bytes(b"v 0 0 \xff\xfe\n")
    with pytest.raises(InputFileError, match="not UTF-8"):
        load_garment_mesh(binary)


PLY_HEADER = (
    "ply\nformat {}\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
    "property uchar red\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n"
)


def ply(tmp_path, form, vertices=4, faces=1, cut=None):
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    if form == "ascii 1.0":
        body = "".join(f"{x} {y} {z} 7\n" for x, y, z in points) + "4 0 1 2 3\n"
        data = body.encode()
    else:
        order = "<" if "little" in form else ">"
        data = b"".join(struct.pack(order + "3fB", *p, 7) for p in points)
        data += struct.pack(order + "B4i", 4, 0, 1, 2, 3)
    path = tmp_path / "cloth.ply"
    path.write_bytes(PLY_HEADER.format(form, vertices, faces).encode() + data[:cut])
    return path


@pytest.mark.parametrize(
    "form", ["ascii 1.0", "binary_little_endian 1.0", "binary_big_endian 1.0"]
)
def test_ply(tmp_path, form):
    mesh = load_garment_mesh(ply(tmp_path, form), up="z")
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert len(mesh.triangles) == 2
    with pytest.raises(InputFileError, match="malformed or truncated"):
        load_garment_mesh(ply(tmp_path, form, cut=-3))
    for vertices, faces in ((10**12, 1), (4, 10**12), (-1, 1)):
        with pytest.raises(InputFileError, match=r"declares .* elements"):
            load_garment_mesh(ply(tmp_path, form, vertices, faces))


def test_not_ply(tmp_path):
    path = tmp_path / "cloth.ply"
    for data in (b"solid", b"ply\nformat ascii 1.0\n", b"ply\nend_header\n", b"ply\nformat x 1\n"):
        path.write_bytes(data)
        with pytest.raises(InputFileError):
            load_garment_mesh(path)


def glb(tmp_path, nodes, accessor_count=4, positions=None):
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 0, 0]], np.float32)
    points = points if positions is None else np.asarray(positions, np.float32)
    index = np.array([0, 1, 2, 0, 2, 3], np.uint16)
    blob = points.tobytes() + index.tobytes()
    content = {
        "asset": {"version": "2.0"},
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": accessor_count, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(points.tobytes())},
            {"buffer": 0, "byteOffset": len(points.tobytes()), "byteLength": 12},
        ],
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(blob), b"BIN\0") + blob
    path = tmp_path / "cloth.glb"
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


def test_glb_nodes_and_seams(tmp_path):
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    half = 0.5**0.5
    nodes = [
        {"children": [1], "translation": [0, 0, 5], "scale": [2, 2, 2]},
        {"mesh": 0, "rotation": [0, 0, half, half]},  # a quarter turn about z
        {"mesh": 0, "translation": [7, 0, 0]},
    ]
    mesh = load_garment_mesh(glb(tmp_path, nodes, positions=square), up="z")
    assert mesh.vertices[:4] == pytest.approx(
        np.array([[0, 0, 5], [0, 2, 5], [-2, 2, 5], [-2, 0, 5]])
    )
    assert mesh.vertices[4:] == pytest.approx(np.add(square, [7, 0, 0]))
    # Two nodes that show one mesh at one place are one surface.
    twice = load_garment_mesh(glb(tmp_path, [{"mesh": 0}, {"mesh": 0}], positions=square), up="z")
    assert len(twice.vertices) == 4
    assert "4 vertices at the place of another" in twice.notes[0]


def test_bad_glb(tmp_path):
    path = glb(tmp_path, [{"mesh": 0}])
    whole = path.read_bytes()
    for size in (0, 10, 25, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(InputFileError):
            load_garment_mesh(path)
    for nodes in ([{"mesh": 3}], [{"children": [0], "mesh": 0}], [{"children": [9]}], []):
        with pytest.raises(InputFileError):
            load_garment_mesh(glb(tmp_path, nodes))
    with pytest.raises(InputFileError):
        load_garment_mesh(glb(tmp_path, [{"mesh": 0}], accessor_count=2**31))


def test_edge_length(tmp_path):
    mesh = load_garment_mesh(obj(tmp_path, QUAD), up="z", edge_length=0.1)
    x = mesh.vertices[mesh.triangles]
    longest = max(np.linalg.norm(x[:, k] - x[:, k - 1], axis=1).max() for k in range(3))
    assert longest <= 4 / 3 * 0.1
    assert area(mesh) == pytest.approx(1.0)
    # The file's vertices come first, in its order.
    assert mesh.vertices[:4].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    with pytest.raises(InputFileError, match="triangles; allowed: a longer edge"):
        load_garment_mesh(obj(tmp_path, QUAD), edge_length=1e-4)


def test_polygons_count_as_the_triangles_that_they_become(tmp_path, monkeypatch):
    """What is written afterwards, in triangles, can be read again."""
    monkeypatch.setattr(polygon_files, "MAX_VERTICES", 5)
    path = tmp_path / "fan.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nf 1 2 3 4\nf 1 2 5\nf 2 3 5\nf 3 4 5\n"
    )
    assert len(polygon_files.read_polygons(path).sizes) == 4
    path.write_text(path.read_text() + "f 4 1 5\n")
    with pytest.raises(InputFileError, match="5 vertices and 6 triangles; allowed: up to 5 each"):
        polygon_files.read_polygons(path)
