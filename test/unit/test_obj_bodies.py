"""OBJ and PLY bodies without a rig, MakeHuman's files, and files that are not usable."""

import json

import numpy as np
import pytest
import trimesh

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.errors import InputFileError, ParameterError


def person(height=1.8):
    """A crude standing figure, y up and facing +z: a trunk, and feet that reach forwards."""
    trunk = trimesh.creation.box(extents=(0.5, 1.7, 0.2)).subdivide().subdivide().subdivide()
    trunk.apply_translation([0.0, 0.95, 0.0])
    feet = trimesh.creation.box(extents=(0.5, 0.1, 0.3)).subdivide().subdivide()
    feet.apply_translation([0.0, 0.05, 0.06])
    mesh = trimesh.util.concatenate([trunk, feet])
    mesh.apply_scale(height / 1.8)
    return mesh


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
@pytest.mark.parametrize(
    ("scale", "unit"), [(1, None), (10, "deci"), (100, "centi"), (1000, "milli")]
)
def test_unit_is_guessed_from_the_height_and_noted(tmp_path, suffix, scale, unit):
    mesh = person()
    mesh.apply_scale(scale)
    mesh.apply_translation([0.0, -0.7 * scale, 0.0])
    mesh.export(tmp_path / f"body{suffix}")
    body = load_body(tmp_path / f"body{suffix}")
    assert body.rig.joint_names == ("root",)
    assert "no rig" in body.notes[0]
    np.testing.assert_allclose(body.skin.vertices[:, 2].min(), 0.0, atol=1e-5)
    np.testing.assert_allclose(body.skin.vertices[:, 2].max(), 1.8, atol=1e-5)
    named = [note for note in body.notes if "unit taken as" in note]
    assert (len(named) == 0) if unit is None else (unit in named[0])


QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@pytest.mark.parametrize(
    ("rotation", "note"),
    [
        (np.eye(3), "y up, facing +z"),
        (np.diag([-1.0, 1.0, -1.0]), "y up, facing -z"),
        (Z_UP, "z up, facing -y"),
        (QUARTER @ Z_UP, "z up, facing +x"),
    ],
)
def test_axes_are_found_from_the_shape(tmp_path, rotation, note):
    mesh = person()
    mesh.vertices = mesh.vertices @ rotation.T
    mesh.export(tmp_path / "body.obj")
    body = load_body(tmp_path / "body.obj")
    assert any(note in n for n in body.notes)
    x = body.skin.vertices
    low = x[x[:, 2] < 0.05]
    assert low[:, 0].max() == pytest.approx(0.21, abs=1e-6)
    assert low[:, 0].min() == pytest.approx(-0.09, abs=1e-6)
    mesh = trimesh.Trimesh(x, body.skin.triangles, process=False)
    assert mesh.volume > 0.0


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("", "empty"),
        ("# nothing\n", "no polygons"),
        ("v 0 0 0\nv 1 0 0\nf 1 2 3\n", "not there"),
        ("v 0 0 0\nf 1 1 -2\n", "not there"),
        ("v 0 0 0\nf 0 1 2\n", "line 2"),
        ("v 0 0\n", "line 1"),
        (f"v 0 0 0\nvt 0 0\nf 1/1 1/{10**30} 1/1\n", "line 3"),
        ("v 0 zero 0\n", "line 1"),
        ("v 0 nan 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 0 is not finite"),
        ("v 0 0 0\nv 1 0 0\nf 1 2\n", "line 3"),
        ("v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nf 1 2 3\n", "no known unit"),
        ("v 0 0 0\nv 1e300 0 0\nv 0 1e300 0\nf 1 2 3\n", "over 1e"),
        ("v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 1 3\n", "degenerate"),
        ("\0\0", "zero bytes"),
    ],
)
def test_unusable_obj_files_are_one_clear_error(tmp_path, content, problem):
    path = tmp_path / "bad.obj"
    path.write_text(content)
    with pytest.raises(InputFileError, match=problem):
        load_body(path)


@pytest.mark.parametrize("content", [b"ply\n", b"ply\nformat ascii 1.0\nend_header\n", b"x" * 50])
def test_unusable_ply_files_are_one_clear_error(tmp_path, content):
    (tmp_path / "bad.ply").write_bytes(content)
    with pytest.raises(InputFileError):
        load_body(tmp_path / "bad.ply")


@pytest.mark.parametrize(
    ("name", "problem"),
    [("no.obj", "does not exist"), ("no.glb", "does not exist"), ("nothing", "does not exist")],
)
def test_missing_files(tmp_path, name, problem):
    with pytest.raises(InputFileError, match=problem):
        load_body(tmp_path / name)


def test_other_endings_and_folders(tmp_path):
    (tmp_path / "a.fbx").write_text("x")
    with pytest.raises(InputFileError, match=r"ending '\.fbx'"):
        load_body(tmp_path / "a.fbx")
    with pytest.raises(InputFileError, match="ending ''"):
        load_body(tmp_path)


def test_the_mannequin_is_built_in():
    body = load_body("mannequin:height=1.6,vertices=1500")
    assert np.ptp(body.skin.vertices[:, 2]) == pytest.approx(1.6, abs=0.02)
    for wrong in (
        "mannequin:size=2",
        "mannequin:height=x",
        "mannequin:height=9",
        "mannequin:vertices=2.5",
    ):
        with pytest.raises(ParameterError):
            load_body(wrong)


def write_makehuman(folder, bones=None, joints=None, weights=None, skeleton=None):
    """A tiny rigged body in MakeHuman's format, 16 dm high: two bones, one helper triangle."""
    box = trimesh.creation.box(extents=(5.0, 16.0, 2.0)).subdivide()
    v = len(box.vertices)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in box.vertices]
    lines += ["v 0 -8 0", "v 0 0 0", "v 0 0 30", "g body"]
    lines += [f"f {a + 1}/1 {b + 1}/1 {c + 1}/1" for a, b, c in box.faces]
    lines += ["g joint-x", f"f {v + 1} {v + 2} {v + 3}"]
    (folder / "mesh.obj").write_text("\n".join(lines))
    skeleton = skeleton or {
        "bones": bones
        or {"high": {"head": "mid", "parent": "low"}, "low": {"head": "sole", "parent": None}},
        "joints": joints or {"sole": [v], "mid": [v + 1]},
    }
    (folder / "rig.mhskel").write_text(json.dumps(skeleton))
    weights = weights or {
        "low": [[i, 0.4] for i in range(v + 3)],
        "high": [[i, 0.5] for i in range(v + 3)],
    }
    (folder / "weights.mhw").write_text(json.dumps({"weights": weights}))
    return folder / "mesh.obj"


def test_makehuman_files_beside_an_obj_are_its_rig(tmp_path):
    body = load_body(write_makehuman(tmp_path))
    assert body.rig.joint_names == ("low", "high")
    origin = np.linalg.inv(body.skin.T_bone_bind)[:, :3, 3]
    np.testing.assert_allclose(origin, [[0, 0, 0], [0, 0, 0.8]], atol=1e-9)
    assert len(body.skin.vertices) == 26
    np.testing.assert_allclose(np.sort(body.skin.weight, axis=1), [[4 / 9, 5 / 9]] * 26)
    for word in ("group 'body'", "decimetre", "summed to 0.900"):
        assert any(word in note for note in body.notes)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"bones": {"a": {"head": "sole", "parent": "a"}}}, "own ancestor"),
        ({"bones": {"a": {"head": "sole", "parent": "b"}}}, "parent 'b'"),
        ({"bones": {"a": {"head": "gone", "parent": None}}}, "starts at None"),
        ({"bones": {"a": 5}}, "parent ''"),
        ({"joints": {"sole": [10**9], "mid": [0]}}, "vertices 0 to"),
        ({"joints": {"sole": [], "mid": [0]}}, "vertices 0 to"),
        ({"joints": {"sole": [True], "mid": [0]}}, "vertices 0 to"),
        ({"skeleton": {"bones": []}}, "no 'bones'"),
        ({"skeleton": [1]}, "no 'bones'"),
        ({"weights": {"other": [[0, 1.0]]}}, "bone 'other'"),
        ({"weights": {"low": [[0, 1.0, 2.0]]}}, "malformed"),
        ({"weights": {"low": "x"}}, "malformed"),
        ({"weights": {"low": [[-1, 1.0]]}}, "not there"),
        ({"weights": {"low": [[0.5, 1.0]]}}, "not there"),
        ({"weights": {"low": [[0, -1.0]]}}, "not negative"),
        ({"weights": {"low": [[0, 0.0]]}}, "no vertex has"),
    ],
)
def test_unusable_makehuman_files_are_one_clear_error(tmp_path, change, problem):
    path = write_makehuman(tmp_path, **change)
    with pytest.raises(InputFileError, match=problem):
        load_body(path)


@pytest.mark.parametrize("content", ["", "{", '{"bones": NaN}', "[" * 100_000])
def test_rig_files_that_are_not_json(tmp_path, content):
    path = write_makehuman(tmp_path)
    (tmp_path / "rig.mhskel").write_text(content)
    with pytest.raises(InputFileError, match=r"rig\.mhskel"):
        load_body(path)
