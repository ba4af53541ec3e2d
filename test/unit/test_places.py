"""Where attachments and elastic bands are: by number, rule, open edge, height, colour, group."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.garment.holds_file import holds_of
from garment_sim_ros.garment.mesh import load_garment_mesh
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import outfit_from
from garment_sim_ros.geometry.topology import boundary_loops
from garment_sim_ros.recording.outfit_pictures import outfit_picture


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin:vertices=1500")


def made(tmp_path, body, more, generator="short_skirt"):
    path = tmp_path / "mine.yaml"
    path.write_text(f"version: 1\ngarments:\n  - name: it\n    generator: {generator}\n{more}")
    return load_outfit(path, body).garments[0]


def test_the_waist_by_rule_loop_and_by_itself_is_the_same(tmp_path, body):
    usual = made(tmp_path, body, "")
    for where in ("rule: waist", "loop: 0"):
        told = made(tmp_path, body, f"    attachments: [{{bone: hips, {where}}}]\n")
        assert np.array_equal(np.sort(told.pins), np.sort(usual.pins))
    hem = made(tmp_path, body, "    attachments: [{bone: hips, rule: hem, name: weight}]\n")
    assert not set(hem.pins) & set(usual.pins)
    assert hem.vertices[hem.pins, 2].max() < usual.vertices[usual.pins, 2].min()
    assert list(hem.marks) == ["weight"]
    assert np.array_equal(np.sort(hem.marks["weight"]), np.sort(hem.pins))
    assert list(usual.marks) == ["waist"]


def test_cuffs_neck_and_shoulders_of_a_shirt(tmp_path, body):
    text = (
        "    attachments:\n      - {bone: leftUpperArm, rule: left_cuff}\n"
        "      - {bone: rightUpperArm, rule: right_cuff}\n"
        "      - {bone: chest, rule: shoulders, stiffness: 100}\n"
        "    elastic: [{rule: neck, tension: 1}]\n"
    )
    shirt = made(tmp_path, body, text, "tshirt")
    loops = {frozenset(loop.tolist()): loop for loop in boundary_loops(shirt.triangles)}
    left, right, shoulders, neck = (frozenset(v.tolist()) for v in shirt.marks.values())
    assert {left, right, neck} <= set(loops)
    assert shirt.vertices[[*left], 1].min() > 0.0 > shirt.vertices[[*right], 1].max()
    assert shirt.vertices[[*neck], 2].mean() > shirt.vertices[[*left], 2].mean()
    assert set(shirt.soft.vertices) == set(shoulders)
    both = made(tmp_path, body, "    elastic: [{rule: cuffs, tension: 1}]\n", "tshirt")
    assert set(both.marks["elastic cuffs"]) == left | right


def test_without_a_bone_what_is_attached_follows_the_skin_there(tmp_path, body):
    usual = made(tmp_path, body, "")
    told = made(tmp_path, body, "    attachments: [{loop: 0}]\n")
    assert np.array_equal(np.sort(told.pins), np.sort(usual.pins))
    frames = [{g.frames[k] for k in g.pin_frame} for g in (usual, told)]
    assert frames[0] == frames[1]
    assert len(frames[0]) == 1
    assert list(told.marks) == ["loop 0"]
    shirt = made(tmp_path, body, "    attachments: [{rule: cuffs}, {rule: neck}]\n", "tshirt")
    y = shirt.vertices[shirt.pins, 1]
    low = shirt.vertices[shirt.pins, 2] < shirt.vertices[shirt.pins, 2].mean()
    arms = [body.humanoid[f"{side}UpperArm"] for side in ("left", "right")]
    frame = np.array(shirt.frames)[shirt.pin_frame]
    assert set(frame[low & (y > 0)]) == {arms[0]}
    assert set(frame[low & (y < 0)]) == {arms[1]}
    assert not set(frame[~low]) & {*arms}


def test_a_band_lies_between_its_heights(tmp_path, body):
    skirt = made(tmp_path, body, "    attachments: [{bone: hips, band: [0.9, 0.95]}]\n")
    z = skirt.vertices[:, 2] - body.skin.vertices[:, 2].min()
    assert len(skirt.pins)
    assert set(skirt.pins) == set(np.flatnonzero((z >= 0.9) & (z <= 0.95)))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("attachments: [{bone: hips}]", "where it is: found none"),
        ("attachments: [{bone: hips, loop: 0, rule: hem}]", "found rule and loop"),
        (
            "attachments: [{bone: hips, rule: knee}]",
            "attachments.rule: found 'knee'; allowed: waist",
        ),
        ("attachments: [{bone: hips, loop: 7}]", "no open edge 7; allowed: 0 to 1"),
        ("attachments: [{bone: hips, loop: -1}]", "attachments.loop: found -1"),
        ("attachments: [{bone: hips, loop: true}]", "attachments.loop: found True"),
        ("attachments: [{bone: hips, rule: neck}]", "has no neck"),
        ("attachments: [{bone: hips, rule: cuffs}]", "has no cuffs"),
        ("attachments: [{bone: hips, rule: shoulders}]", "does not lie on the shoulders"),
        ("attachments: [{bone: hips, band: [2, 3]}]", "no vertices between 2 and 3 m; allowed:"),
        ("attachments: [{bone: hips, band: [1, 1]}]", "band: found 1 to 1"),
        ("attachments: [{bone: hips, band: 1}]", "band: found 1; allowed: two heights"),
        ("attachments: [{bone: hips, colour: red}]", "colour: found 'red'"),
        ('attachments: [{bone: hips, colour: "#ff0000"}]', "the mesh has no colours"),
        ("attachments: [{bone: hips, group: belt}]", "no group 'belt'; allowed: none"),
        ("attachments: [{bone: hips, loop: 0, name: 3}]", "attachments.name: found 3"),
        (
            "attachments: [{bone: hips, loop: 0, name: a}, {bone: hips, rule: waist, name: b}]",
            "attachment 'b': attached vertices are listed twice",
        ),
        ("elastic: [{rule: waist}]", "elastic.tension: found None"),
        ("elastic: [{rule: waist, tension: -1}]", "elastic.tension: found -1"),
        ("elastic: [{rule: waist, tension: 1, slack: 1}]", "elastic.slack: found 1"),
        ("elastic: [{tension: 1}]", "where it is: found none"),
        ("elastic: {tension: 1}", "elastic: found {'tension': 1}; allowed: a list"),
        ("elastic: [{vertices: [0, 1], tension: 1, colour: x}]", "found vertices and colour"),
        ("elastic: [{vertices: [5, 900], tension: 1}]", "no edges run along it"),
    ],
)
def test_places_that_are_none_are_named(tmp_path, body, more, words):
    with pytest.raises(InputFileError) as error:
        made(tmp_path, body, f"    {more}\n")
    said = str(error.value)
    assert words in said
    assert "garment 'it'" in said
    assert "\n" not in said


def tube_lines(around=24, rows=9, paint=False):
    """A tube, 0.8 m high and 0.25 m wide, painted red in its highest third."""
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    rings = [
        np.column_stack(
            [0.25 * np.cos(angle), 0.25 * np.sin(angle), np.full(around, 0.4 + 0.1 * k)]
        )
        for k in range(rows)
    ]
    x = np.concatenate(rings)
    red = np.where(x[:, 2:] > 0.95, [1.0, 0.0, 0.0], [0.2, 0.2, 0.2])
    quads = []
    for k in range(rows - 1):
        for i in range(around):
            j = (i + 1) % around
            quads.append(
                [k * around + i, k * around + j, (k + 1) * around + j, (k + 1) * around + i]
            )
    return x, red, np.array(quads)


@pytest.mark.parametrize("ending", ["obj", "ply", "glb"])
@pytest.mark.parametrize("remesh", ["never", "always"])
def test_painted_colours_and_groups(tmp_path, body, ending, remesh):
    x, red, quads = tube_lines()
    top = quads[(x[quads, 2] > 0.75).all(axis=1)]
    rest = quads[~(x[quads, 2] > 0.75).all(axis=1)]
    path = tmp_path / f"tube.{ending}"
    if ending == "obj":
        lines = [
            " ".join(["v", *(f"{c:.6f}" for c in (*p, *c))]) for p, c in zip(x, red, strict=True)
        ]
        for name, faces in (("belt", top), ("cloth", rest)):
            lines.append(f"g {name}")
            lines += ["f " + " ".join(map(str, f)) for f in (faces + 1).tolist()]
        path.write_text("\n".join(lines))
    elif ending == "ply":
        head = f"ply\nformat ascii 1.0\nelement vertex {len(x)}\n"
        head += "".join(f"property float {a}\n" for a in "xyz")
        head += "".join(f"property uchar {c}\n" for c in ("red", "green", "blue"))
        head += f"element face {len(quads)}\nproperty list uchar int vertex_indices\nend_header\n"
        body_lines = [
            " ".join([*(f"{v:.6f}" for v in p), *(f"{round(255 * v)}" for v in c)])
            for p, c in zip(x, red, strict=True)
        ]
        body_lines += ["4 " + " ".join(map(str, q)) for q in quads.tolist()]
        path.write_text(head + "\n".join(body_lines) + "\n")
    else:
        path.write_bytes(painted_glb(x, red, quads, belt=(x[:, 2] > 0.75).astype(float)))
    mesh = load_garment_mesh(path, up="z")
    assert mesh.colours is not None
    places = ['colour: "#ff0000"'] + (["group: belt"] if ending != "ply" else [])
    for where in places:
        outfit = tmp_path / "mine.yaml"
        outfit.write_text(
            f"version: 1\ngarments:\n  - name: tube\n    mesh: {path.name}\n"
            f"    options: {{up: z, remesh: {remesh}, edge_length: 0.06}}\n"
            f"    attachments: [{{bone: hips, {where}}}]\n"
        )
        (tube,) = load_outfit(outfit, body).garments
        z = tube.vertices[:, 2]  # what was moved out of the body has moved sideways
        limit = 0.95 if "colour" in where else 0.75
        assert len(tube.pins) > 20
        assert z[tube.pins].min() > limit - 0.06
        assert set(np.flatnonzero(z > limit + 0.06)) <= set(tube.pins)


def painted_glb(x, red, quads, belt):
    """A .glb, turned to y up, with colours as light and an attribute of its own."""
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype("<u4")
    light = np.where(red <= 0.04045, red / 12.92, ((red + 0.055) / 1.055) ** 2.4)
    arrays = [x.astype("<f4"), light.astype("<f4"), belt.astype("<f4"), triangles.ravel()]
    kinds = [("VEC3", 5126), ("VEC3", 5126), ("SCALAR", 5126), ("SCALAR", 5125)]
    views, accessors, data = [], [], b""
    for k, (array, (kind, component)) in enumerate(zip(arrays, kinds, strict=True)):
        raw = array.tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(raw)})
        accessors.append(
            {"bufferView": k, "componentType": component, "count": len(array), "type": kind}
        )
        data += raw
    content = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "COLOR_0": 1, "_belt": 2}, "indices": 3}
                ]
            }
        ],
        "nodes": [{"mesh": 0, "name": "tube"}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def test_only_numbers_depend_on_the_order_of_the_file():
    entry = {"name": "it", "mesh": "it.obj", "elastic": [{"vertices": [1, 2], "tension": 1}]}
    (garment,) = outfit_from({"version": 1, "garments": [entry]}).garments
    assert garment.holds.elastic[0].place.by_number
    assert not holds_of({"elastic": [{"loop": 1, "tension": 1}]}).elastic[0].place.by_number
    with pytest.raises(ParameterError, match="a vertex is not a whole number"):
        holds_of({"elastic": [{"vertices": [1.5], "tension": 1}]})


def test_a_picture_names_and_shows_what_holds_a_garment(tmp_path, body):
    skirt = made(
        tmp_path,
        body,
        "    attachments: [{bone: hips, rule: waist, name: belt}]\n"
        "    elastic: [{rule: hem, tension: 2}]\n",
    )
    triangles = body.skin.triangles
    picture = outfit_picture([skirt], body.skin.vertices, triangles)
    bare = outfit_picture([replace(skirt, marks={})], body.skin.vertices, triangles)
    # Dots of a second colour, and a second line of the legend.
    assert picture.height > bare.height
    height = min(picture.height, bare.height) - 40
    shown, none = (np.asarray(p)[:height].astype(int) for p in (picture, bare))
    changed = np.abs(shown - none).max(axis=2) > 40
    half = changed.shape[0] // 2
    assert changed[:half].sum() > 100
    assert changed[half:].sum() > 100
    assert changed.mean() < 0.05
