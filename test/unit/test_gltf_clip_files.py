"""Which animation of a glTF file is a clip, what its parts are called, and damaged ones."""

import numpy as np
import pytest
from gltf_figure import TIMES, Figure, swing, walking
from hostile.reading import bounded, refused

from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.mocap.clip_name import file_and_animation
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.gltf_clip import load_gltf_clip
from garment_sim_ros.mocap.source_urdf import urdf_from_clip


def test_an_animation_of_the_skeleton_is_taken(tmp_path):
    """Not one of a camera, a lamp, or one that holds a pose."""
    figure = Figure(2)
    camera = figure.add("nodes", {"name": "Camera", "camera": 0})
    prop = figure.add("nodes", {"name": "Door"})
    for name, node in (("Camera", camera), ("Door", prop)):
        figure.animation(name)
        turns = swing((0.0, 1.0, 0.0), np.array([0.0, 90.0])).as_quat()
        figure.animate(node, "rotation", [0.0, 9.0], turns)
    figure.animation("TPose")
    figure.turn("Head", [0.0, 1.0], swing((1.0, 0.0, 0.0), np.zeros(2)))
    figure.animation("Nod")
    figure.turn("Head", [0.0, 1.0], swing((1.0, 0.0, 0.0), np.array([0.0, 20.0])))
    figure.animate(prop, "rotation", [0.0, 50.0], turns)
    path = figure.glb(tmp_path / "scene.glb")
    clip = load_clip(path)
    assert clip.notes[0].startswith("Animation 3, 'Nod'")
    refused(load_clip, f"{path}:animation=TPose", match="no joint moves")
    refused(
        load_clip, f"{path}:animation=Camera", match="no joint that moves in .* 'Camera'.*'Nod'"
    )


def test_names_of_joints_in_a_file_of_bone_names_are_those_of_the_file(tmp_path):
    figure = walking()
    figure.json["nodes"][figure.node["Hips"]]["name"] = "my root bone"
    path = figure.glb(tmp_path / "a.glb")
    clip = load_clip(path, humanoid_overrides={"hips": "my root bone"})
    assert clip.rig.joint_names[0] == "my_root_bone"


def test_any_name_of_an_animation_and_of_joints_is_fit_for_urdf(tmp_path):
    figure = walking()
    figure.json["animations"][0]["name"] = "Wa\x00lk\n" + "x" * 5000
    for k, name in enumerate(("a\uffff", "a_", "a\ufffe", "a__2", "a_2")):
        figure.json["nodes"][5 + k]["name"] = name
    clip = load_gltf_clip(figure.glb(tmp_path / "a.glb"))
    assert len(clip.name) == 200
    parse_urdf(urdf_from_clip(clip))
    urdf_from_clip(clip).encode()
    refused(load_clip, f"{tmp_path / 'a.glb'}:animation={'9' * 6000}", match="no animation '999")


def _deep(figure):
    nodes = figure.json["nodes"]
    first = len(nodes)
    nodes += [{"name": str(k), "children": [first + k + 1]} for k in range(900)]
    nodes.append({"name": "last", "children": [0]})
    figure.turn("Head", [0.0, 2000.0], swing((0.0, 0.0, 1.0), np.array([0.0, 30.0])))


def _wide(figure):
    nodes = figure.json["nodes"]
    first = len(nodes)
    nodes += [{"name": str(k)} for k in range(8000)]
    nodes[1]["children"] += range(first, first + 8000)
    figure.turn("Head", [0.0, 6.0], swing((0.0, 0.0, 1.0), np.array([0.0, 30.0])))


def _shared(figure):
    q = np.tile(swing((0.0, 0.0, 1.0), np.array([0.0, 30.0])).as_quat(), (200_000, 1))
    times = figure.accessor(np.arange(400_000, dtype=np.float64), "f4")
    (animation,) = figure.json["animations"]
    animation["samplers"] = [{"input": times, "output": figure.accessor(q, "f4")}]
    animation["channels"] = [
        {"sampler": 0, "target": {"node": n, "path": "rotation"}} for n in range(19)
    ]


@pytest.mark.parametrize(
    ("grow", "words"),
    [
        (_deep, "moves 19 joints of 921 nodes in 120001 frames; allowed"),
        (_wide, "8019 joints; allowed: 1024"),
        (_shared, "animation of over 20000000 numbers"),
    ],
)
def test_hostile_sizes_are_refused_soon(tmp_path, grow, words):
    """Few bytes that would take minutes or gigabytes."""
    figure = Figure()
    figure.animation()
    grow(figure)
    path = figure.glb(tmp_path / "large.glb")
    with bounded():
        refused(load_gltf_clip, path, match=words)


def test_one_pose_is_a_clip(tmp_path):
    figure = Figure(2)
    figure.animation("Pose")
    figure.turn("LeftUpperArm", [0.0], swing((0.0, 0.0, 1.0), np.array([-70.0])))
    path = figure.glb(tmp_path / "pose.glb")
    clip = load_clip(f"{path}:animation=Pose")
    assert len(clip.times) == 1
    column = clip.rig.dofs.names.index("LeftUpperArm_Zrotation")
    assert np.degrees(clip.values[0, column]) == pytest.approx(-70.0, abs=1e-3)
    refused(load_clip, path, match="no animation in which a joint turns; found 0: 'Pose'")


def test_many_animations_of_others_take_no_time(tmp_path):
    """A skeleton is looked at for few of them."""
    figure = Figure()
    nodes = figure.json["nodes"]
    nodes += [{"name": str(k)} for k in range(2000)]
    figure.animation()
    figure.animate(len(nodes) - 1, "rotation", [0.0, 1.0], np.eye(4)[:2])
    figure.json["animations"] *= 5000
    path = figure.glb(tmp_path / "many.glb")
    with bounded():
        clip = load_clip(path)
    assert clip.rig.joint_names == ("1999",)
    assert any("only drive a body of the same names" in note for note in clip.notes)


def test_one_of_several_animations(tmp_path):
    figure = Figure()
    figure.animation("Open")
    figure.animate(figure.node["Hips"], "translation", [0.0, 1.0], np.ones((2, 3)))
    for name, last in (("Idle", 1.0), ("Run", 3.0)):
        figure.animation(name)
        figure.turn("Head", [0.0, last], swing((0.0, 0.0, 1.0), np.array([0.0, 30.0])))
    path = figure.glb(tmp_path / "avatar.glb")
    clip = load_clip(path)
    assert (clip.name, clip.duration) == ("Idle", 1.0)
    assert clip.notes[0] == ("Animation 1, 'Idle'; the file has 0: 'Open', 1: 'Idle', 2: 'Run'.")
    for named in ("Run", "2"):
        clip = load_clip(f"{path}:animation={named}")
        assert (clip.name, clip.duration) == ("Run", 3.0)
    refused(load_clip, f"{path}:animation=Walk", match="no animation 'Walk'.*'Idle', 2: 'Run'")
    refused(load_clip, f"{path}:animation=0", match="no joint that moves in animation '0'.*'Run'")
    refused(load_clip, f"{tmp_path / 'none.glb'}:animation=0", match="none.glb.*exist|missing")


def test_a_file_may_be_called_as_an_animation_would(tmp_path):
    path = tmp_path / "a.glb:animation=0.glb"
    walking().glb(path)
    assert file_and_animation(path) == (str(path), None)
    assert file_and_animation(f"{path}:animation=Move") == (str(path), "Move")
    assert file_and_animation("b.VRM:animation=a") == ("b.VRM", "a")
    assert file_and_animation("walk:animation=1") == ("walk:animation=1", None)
    assert load_clip(path).name == load_clip(f"{path}:animation=0").name == "Move"


def declared(extension):
    figure = walking(5)
    for k, node in enumerate(figure.json["nodes"]):
        node["name"] = f"J\t{k}"
    bones = {bone[0].lower() + bone[1:]: {"node": n} for bone, n in figure.node.items()}
    humanoid = {"humanBones": bones}
    if extension == "VRM":
        humanoid = {"humanBones": [{"bone": b, **entry} for b, entry in bones.items()]}
    figure.json["extensions"] = {extension: {"humanoid": humanoid}}
    return figure


@pytest.mark.parametrize("extension", ["VRM", "VRMC_vrm", "VRMC_vrm_animation"])
def test_bones_that_the_file_declares_are_called_by_their_names(tmp_path, extension):
    clip = load_clip(declared(extension).glb(tmp_path / "move.vrma"))
    assert {"hips", "leftUpperArm", "rightToes"} <= set(clip.rig.joint_names)
    assert not any("No joint name" in note for note in clip.notes)
    assert clip.hinges


def test_names_are_fit_for_topics_and_no_two_are_alike(tmp_path):
    figure = walking()
    for n, name in ((figure.node["LeftHand"], "a b"), (figure.node["RightHand"], "a\tb")):
        figure.json["nodes"][n]["name"] = name
    names = load_gltf_clip(figure.glb(tmp_path / "a.glb")).rig.joint_names
    assert len(set(names)) == len(names)
    assert sum(name.startswith("a_b") for name in names) == 2


def test_what_else_an_animation_moves_is_left_out(tmp_path):
    figure = walking()
    (animation,) = figure.json["animations"]
    animation["channels"] += [
        {"sampler": 0, "target": {"path": "rotation"}},
        {"sampler": 0, "target": {"path": "weights", "node": 3}},
        {"sampler": 0, "target": {"path": "pointer", "extensions": {}}},
    ]
    assert load_gltf_clip(figure.glb(tmp_path / "a.glb")).duration == pytest.approx(2.0)


def _sampler(figure, key, value):
    figure.json["animations"][0]["samplers"][0][key] = value


def _channel(figure, key, value):
    figure.json["animations"][0]["channels"][0][key] = value


def _replace(figure, key, array):
    _sampler(figure, key, figure.accessor(np.asarray(array, np.float64), "f4"))


def _far(figure):
    node = figure.node["Spine"]
    figure.animate(node, "translation", TIMES, np.full((len(TIMES), 3), 1e7))


def _still(figure):
    q = figure.json["nodes"][figure.node["Head"]].get("rotation")
    figure.json["animations"] = []
    figure.animation()
    figure.animate(figure.node["Head"], "rotation", [0.0, 1.0], [q, q])


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda f: f.json.update(animations=[]), "has no animation"),
        (lambda f: f.json.update(animations=5), "animations is malformed"),
        (lambda f: f.json["animations"][0].update(channels=[]), "no animation in which a joint"),
        (lambda f: f.json["animations"][0].update(samplers=[]), "sampler is 0"),
        (lambda f: _channel(f, "target", None), "has no target"),
        (lambda f: _channel(f, "target", {"path": "rotation", "node": 99}), "node is 99"),
        (lambda f: _channel(f, "sampler", -1), "sampler is -1"),
        (lambda f: _sampler(f, "interpolation", "SMOOTH"), "is 'SMOOTH'; allowed: LINEAR, STEP"),
        (lambda f: _sampler(f, "interpolation", "CUBICSPLINE"), "21 times and 21 values"),
        (lambda f: _sampler(f, "interpolation", ["STEP"]), "allowed: LINEAR"),
        (lambda f: _sampler(f, "output", 10**6), "output is 1000000"),
        (lambda f: _replace(f, "output", np.ones((21, 3))), "has type 'VEC3'"),
        (lambda f: _replace(f, "output", np.full((21, 4), np.nan)), "not finite"),
        (lambda f: _replace(f, "input", np.zeros(21)), "times do not increase"),
        (lambda f: _replace(f, "input", [*range(20), np.inf]), "times do not increase"),
        (lambda f: _replace(f, "input", 1e6 * np.arange(21)), "s long"),
        (lambda f: f.json["nodes"][6].update(matrix=np.eye(4).ravel().tolist()), "has a matrix"),
        (lambda f: f.turn("LeftUpperArm", [0.0], swing((1.0, 0, 0), np.ones(1))), "twice"),
        (_far, "out of all bounds"),
        (_still, "no animation in which a joint turns; found 0: 'Move'"),
    ],
)
def test_damaged_animations_are_refused(tmp_path, damage, words):
    figure = walking()
    damage(figure)
    refused(load_gltf_clip, figure.glb(tmp_path / "walk.glb"), match=words)


def test_too_many_numbers_are_refused_before_they_are_made(tmp_path):
    figure = Figure()
    figure.animation()
    figure.turn("Head", [0.0, 8e4], swing((0.0, 0.0, 1.0), np.array([0.0, 30.0])))
    refused(
        load_gltf_clip, figure.glb(tmp_path / "long.glb"), match="joints of 20 nodes in .* frames"
    )


def test_options_out_of_range(tmp_path):
    path = walking().glb(tmp_path / "walk.glb")
    with pytest.raises(ParameterError, match="skip_t_pose"):
        load_gltf_clip(path, skip_t_pose="perhaps")
    with pytest.raises(InputFileError, match="not glTF"):
        load_clip(_text(tmp_path / "a.glb"))


def _text(path):
    path.write_text("nothing")
    return path
