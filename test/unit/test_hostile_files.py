"""Small files made to take hours or all memory, and those that readers once fell over."""

import json

import numpy as np
import pytest
from hostile.gltf_files import document
from hostile.reading import bounded, folder_with, refused, written
from unit.test_collider_description import example_set
from unit.test_obj_bodies import person, write_makehuman

from garment_sim_ros.body.humanoid import load_humanoid_overrides
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.loaders.mesh_file import read_mesh
from garment_sim_ros.body.loaders.obj_file import read_obj
from garment_sim_ros.body.loaders.urdf import body_from_urdf
from garment_sim_ros.colliders.description import load_colliders, to_json
from garment_sim_ros.garment.mesh import load_garment_mesh
from garment_sim_ros.garment.outfit_file import read_outfit
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.plain_data import PlainDataError, parse_json, parse_yaml


@pytest.fixture(autouse=True)
def _bounded():
    with bounded():
        yield


HUGE = "9" * 400


BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi")
)


def test_yaml_aliases(tmp_path):
    refused(load_humanoid_overrides, written(tmp_path / "b.yaml", BOMB), match="aliases")
    bones = BOMB + "hips: *i\n"
    refused(load_humanoid_overrides, written(tmp_path / "c.yaml", bones), match="aliases")
    refused(read_outfit, written(tmp_path / "o.yaml", BOMB), match="aliases")
    refused(load_clip, folder_with(tmp_path, BOMB), match="aliases")


@pytest.mark.parametrize(
    "text",
    [
        *("a: !!int ''", "a: !!timestamp x", "a: !!python/object:os.system x", "a: " + HUGE),
        *(
            "a: 2024-99-99",
            "? [a]: b",
            "a: 1\na: 2",
            "[" * 5000,
            "- " * 5000,
            "a: 9" + ":9" * 5000,
        ),
        *("a\x01b", "a: 18446744073709551616", "=", "<<: 3", "%YAML 9.9\n---\na", "a: b: c", "@"),
    ],
)
def test_yaml_that_is_not_plain(text):
    with pytest.raises(PlainDataError) as error:
        parse_yaml(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "text",
    ["", "[" * 10**5, HUGE, "[1e400]", "NaN", '"\\ud800"', '{"a": 1, "a": 2}', '{"\\uDfff": 1}'],
)
def test_json_that_is_not_plain(text):
    with pytest.raises(PlainDataError):
        parse_json(text)


def test_plain_data_is_read():
    assert parse_json('{"a": [1, 2.5, "\\ud83d\\ude00", null, true]}') == {
        "a": [1, 2.5, "\N{GRINNING FACE}", None, True]
    }
    assert parse_yaml("a: [1, 2.5, b, null, true, .inf]") == {
        "a": [1, 2.5, "b", None, True, np.inf]
    }


def test_obj_with_a_long_group_name(tmp_path):
    text = person().export(file_type="obj").replace("f ", "g " + "x" * 50_000 + "\nf ", 1)
    text += "f 1 2 3\n" * 5000
    assert read_obj(written(tmp_path / "a.obj", text)).groups[1] == "x" * 50_000
    load_body(tmp_path / "a.obj")


@pytest.mark.parametrize("index", ["1" + "0" * 20, "-1" + "0" * 20, HUGE, "9" * 5000, "1e20"])
def test_obj_with_a_far_index(tmp_path, index):
    path = written(tmp_path / "a.obj", f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {index}\n")
    refused(load_body, path, match="line 4")
    refused(load_garment_mesh, path, match="line 4")


def gltf(path, change):
    """A valid body after `change(document, primitive)`."""
    b = document()
    change(b, b.json["meshes"][0]["primitives"][0])
    return b.glb(path / "a.glb")


def test_gltf_with_sparse_counts_of_millions(tmp_path):
    def change(b, primitive):
        indices = {"bufferView": 0, "componentType": 5121}
        sparse = {"count": 1, "indices": indices, "values": {"bufferView": 0}}
        b.json["accessors"].append(
            {"componentType": 5126, "count": 19_000_000, "type": "VEC4", "sparse": sparse}
        )
        primitive["attributes"]["WEIGHTS_0"] = len(b.json["accessors"]) - 1

    refused(load_body, gltf(tmp_path, change), match="without data")


def test_gltf_that_shows_its_bytes_many_times(tmp_path):
    def change(b, primitive):
        b.json["meshes"][0]["primitives"] = [primitive] * 2000

    path = gltf(tmp_path, change)
    refused(load_body, path, match="many times|vertices and more")
    refused(load_garment_mesh, path, match="many times|vertices and more")


def test_gltf_with_400_sets_of_joints(tmp_path):
    def change(b, primitive):
        attributes = primitive["attributes"]
        for i in range(400):
            attributes[f"JOINTS_{i}"] = attributes["JOINTS_0"]
            attributes[f"WEIGHTS_{i}"] = attributes["WEIGHTS_0"]

    refused(load_body, gltf(tmp_path, change), match="JOINTS_n")


def test_gltf_with_60000_instances_of_a_mesh(tmp_path):
    def change(b, primitive):
        b.json["nodes"] += [{"mesh": 0}] * 60_000

    path = gltf(tmp_path, change)
    refused(load_body, path, match=r"shows")
    refused(load_garment_mesh, path, match=r"shows")


def test_gltf_with_empty_primitives_on_many_nodes(tmp_path):
    def change(b, primitive):
        b.json["meshes"][0]["primitives"] = [{"mode": 0}] * 5000
        b.json["nodes"] += [{"mesh": 0}] * 5000

    refused(load_body, gltf(tmp_path, change), match="primitives")


def test_gltf_with_nodes_65000_deep(tmp_path):
    def change(b, primitive):
        first = len(b.json["nodes"])
        b.json["nodes"] += [{"children": [first + i + 1]} for i in range(65_000)] + [{}]

    path = gltf(tmp_path, change)
    refused(load_body, path, match="deep")
    refused(load_garment_mesh, path, match="deep")


@pytest.mark.parametrize("stride", [10**30, 1e30, 10**17, 1000])
def test_gltf_with_a_far_stride(tmp_path, stride):
    def change(b, primitive):
        accessor = b.json["accessors"][primitive["attributes"]["POSITION"]]
        accessor["count"] = 1
        b.json["bufferViews"][accessor["bufferView"]]["byteStride"] = stride

    path = gltf(tmp_path, change)
    refused(load_body, path, match="byteStride|digits")
    refused(load_garment_mesh, path, match="byteStride|digits")


def test_gltf_with_half_of_a_surrogate_pair(tmp_path):
    def change(b, primitive):
        b.json["nodes"][1]["name"] = "\ud800"

    refused(load_body, gltf(tmp_path, change), match="surrogate")


ROBOT = '<robot name="r"><link name="a"><visual>{}<geometry>{}</geometry></visual></link></robot>'


@pytest.mark.parametrize(
    ("origin", "shape", "problem"),
    [
        ("", '<mesh filename="m.obj" scale="1e308 1 1"/>', "1e308"),
        ("", '<mesh filename="m.obj" scale="0 1 1"/>', "scale"),
        ("", '<mesh filename="m.obj" scale="1e5 1 1"/>', "reaches"),
        ("", '<sphere radius="1e-320"/>', "1e-320"),
        ("", '<cylinder radius="1e-320" length="1"/>', "1e-320"),
        ("", '<cylinder radius="0.000002" length="100"/>', "too thin"),
        ("", '<box size="1e-6 1e-6 100"/>', "too thin"),
        ('<origin xyz="1e308 0 0"/>', '<sphere radius="1"/>', "1e308"),
        ("", '<sphere radius="' + "1 " * 50_000 + '"/>', "1 finite numbers"),
    ],
)
def test_urdf_with_shapes_of_no_size(tmp_path, origin, shape, problem):
    person().export(tmp_path / "m.obj")
    path = written(tmp_path / "a.urdf", ROBOT.format(origin, shape))
    refused(load_body, path, match=problem)


def test_urdf_with_4000_boxes():
    visual = (
        '<visual><origin xyz="{0} 0 {1}"/><geometry><box size="0.1 {1} 0.2"/></geometry></visual>'
    )
    boxes = "".join(visual.format(0.2 * (i % 60), 0.1 + 0.01 * (i // 60)) for i in range(4000))
    body = body_from_urdf(f'<robot name="r"><link name="a">{boxes}</link></robot>')
    assert len(body.skin.triangles) >= 4000 * 12
    refused(
        body_from_urdf, f'<robot name="r"><link name="a">{boxes * 2}</link></robot>', match="8000"
    )


def test_urdf_with_a_line_of_followers():
    """Each joint follows the next, so that every one follows the last."""
    links = "".join(f'<link name="l{i}"/>' for i in range(4001))
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        + (f'<mimic joint="j{i + 1}" multiplier="{{}}"/>' if i < 3999 else "")
        + "</joint>"
        for i in range(4000)
    )
    body = '<link name="b"><visual><geometry><sphere radius="1"/></geometry></visual></link>'
    body += '<joint name="jb" type="fixed"><parent link="l0"/><child link="b"/></joint>'
    text = f'<robot name="r">{links}{joints}{body}</robot>'
    assert len(body_from_urdf(text.replace("{}", "1")).rig.dofs) == 4000
    refused(body_from_urdf, text.replace("{}", "2"), match="finite")


def test_collada_whose_nodes_show_each_other(tmp_path):
    nodes = "".join(
        f'<node id="n{i}">' + f'<instance_node url="#n{i + 1}"/>' * 10 + "</node>"
        for i in range(12)
    )
    text = (
        f"<COLLADA><library_nodes>{nodes}<node id='n12'><instance_geometry url='#g'/></node>"
        "</library_nodes><library_visual_scenes><visual_scene><node id='s'>"
        "<instance_node url='#n0'/></node></visual_scene></library_visual_scenes></COLLADA>"
    )
    refused(read_mesh, written(tmp_path / "a.dae", text), match="geometries")
    text = text.replace("<instance_geometry url='#g'/>", "<instance_node url='#n0'/>")
    refused(read_mesh, written(tmp_path / "b.dae", text), match="geometries")


def test_makehuman_without_parent_is_a_root(tmp_path):
    bones = {"low": {"head": "sole"}, "high": {"head": "mid", "parent": "low"}}
    body = load_body(write_makehuman(tmp_path, bones=bones))
    assert body.rig.parent.tolist() == [-1, 0]


@pytest.mark.parametrize(
    "change",
    [
        {"weights": {"low": [[int(HUGE), 1.0]]}},
        {"weights": {"low": [[0, int(HUGE)]]}},
        {"weights": {"low": [[0, "x" * 50_000], *[[0, 1]] * 5000]}},
        {"weights": {"\ud800": [[0, 1.0]]}},
        {"joints": {"sole": [int(HUGE)], "mid": [0]}},
        {"bones": {"\udfff": {"head": "sole", "parent": None}}},
        {"bones": {"a": {"head": ["sole"], "parent": None}}},
    ],
)
def test_makehuman_files(tmp_path, change):
    refused(load_body, write_makehuman(tmp_path, **change))


def test_a_vertex_that_follows_every_joint(tmp_path):
    bones = {f"b{i}": {"head": "sole", "parent": None} for i in range(1000)}
    weights = {name: [[0, 0.1], [1, 0.1]] for name in bones}
    refused(
        load_body, write_makehuman(tmp_path, bones=bones, weights=weights), match="1000 joints"
    )


OUTFIT = "version: 1\ngarments:\n  - {name: a, generator: tshirt, %s}\n"


@pytest.mark.parametrize(
    "entry",
    [
        *(f"layer: {HUGE}", f"tethers: {HUGE}", f"max_distance: {HUGE}", f"mu: {HUGE}"),
        *(f"self_collision: {HUGE}", f"options: {{vertices: {HUGE}}}", f"backstop: -{HUGE}"),
        *(f"options: {{ease: {HUGE}}}", f"material: {{friction: {HUGE}}}"),
        f"attachments: [{{bone: hips, vertices: [{HUGE}]}}]",
        f"attachments: [{{bone: hips, vertices: [1], stiffness: {HUGE}}}]",
        "options: {vertices: 100000}",
        'material: "a\\nb"',
        '"a\\nb": 1',
    ],
)
def test_outfits(tmp_path, entry):
    refused(read_outfit, written(tmp_path / "a.yaml", OUTFIT % entry))


def test_collider_descriptions(tmp_path):
    document = json.loads(to_json(example_set()))

    def changed(index, key, value):
        copy = json.loads(json.dumps(document))
        copy["colliders"][index][key] = value
        return written(tmp_path / "c.json", json.dumps(copy))

    texts = {"vertices": [*[0] * 20_000, "x" * 50_000], "faces": []}
    refused(load_colliders, changed(4, "geometry", texts), match="numbers only")
    far = {"vertices": [[-(2**63)] * 3] * 4, "faces": [[0, 1, 2]] * 4}
    refused(load_colliders, changed(4, "geometry", far), match="magnitudes")
    refused(load_colliders, changed(1, "name", "\ud800"), match="surrogate")
    refused(load_colliders, changed(1, "kind", ["x"]), match="kind")
    refused(load_colliders, changed(1, "geometry", {"radius": int(HUGE)}), match="digits")
    document["colliders"] = [dict(document["colliders"][1], name="x")] * 4096
    refused(load_colliders, written(tmp_path / "c.json", json.dumps(document)), match="unique")


def test_names_with_line_ends(tmp_path):
    written(tmp_path / "a.gltf", json.dumps({"asset": {"version": "a\nb\x1b[31m"}}))
    refused(load_body, tmp_path / "a.gltf", match=r"a\\nb")
    urdf = '<robot name="r"><link name="a&#10;b"/><link name="a&#10;b"/></robot>'
    refused(load_body, written(tmp_path / "a.urdf", urdf), match=r"a.*nb")
