"""Animations in glTF files as clips."""

import numpy as np
import pytest
from gltf_figure import BONES, Figure, nodes_at, swing
from hostile.reading import refused
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.mocap.clip_name import file_and_animation
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.gltf_channels import Channel
from garment_sim_ros.mocap.gltf_clip import load_gltf_clip
from garment_sim_ros.mocap.sampling import ClipSampler

TIMES = np.linspace(0.5, 2.5, 21)


def walking(seed=None, scale=1.0, size=1.0):
    """A figure whose arm, knees and trunk turn while it goes along."""
    figure = Figure(seed, scale, size)
    figure.animation()
    phase = np.pi * (TIMES - TIMES[0])
    figure.turn("LeftUpperArm", TIMES, swing((0.0, 0.6, 0.8), 70.0 * np.sin(phase)))
    figure.turn("RightLowerArm", TIMES, swing((0.0, 1.0, 0.0), 45.0 - 45.0 * np.cos(phase)))
    figure.turn("LeftLowerLeg", TIMES, swing((1.0, 0.0, 0.0), 40.0 - 40.0 * np.cos(phase)))
    figure.turn("RightUpperLeg", TIMES, swing((1.0, 0.0, 0.0), 30.0 * np.sin(phase)))
    figure.turn("Spine", TIMES, swing((0.0, 1.0, 0.0), 20.0 * np.sin(phase)))
    way = np.stack([0.1 * phase, 1.0 + 0.02 * np.sin(phase), 0.4 * phase], axis=1)
    figure.animate(figure.node["Hips"], "translation", TIMES, way * size / scale)
    return figure


def check_against_nodes(path, clip, start, atol):
    """Joints of the clip are where the file's nodes are, and turn as they do."""
    file = GltfFile(path)
    (animation,) = file.list_of("animations")
    node = {entry["name"]: n for n, entry in enumerate(file.list_of("nodes"))}
    kinematics, sampler = ForwardKinematics(clip.rig), ClipSampler(clip)
    turned = []
    for t in np.linspace(0.0, clip.duration, 17):
        T = kinematics.from_dofs(sampler.sample(t)).copy()
        told = nodes_at(file, animation, start + t)
        told = np.array([told[node[name]] for name in clip.rig.joint_names])
        np.testing.assert_allclose(T[:, :3, 3], told[:, :3, 3], atol=atol)
        scale = np.cbrt(np.linalg.det(told[:, :3, :3]))[:, None, None]
        turned.append((told[:, :3, :3] / scale).transpose(0, 2, 1) @ T[:, :3, :3])
    # What is between both axes of a joint is the same in all frames: how they lie at rest.
    np.testing.assert_allclose(turned, np.broadcast_to(turned[0], np.shape(turned)), atol=1e-5)


@pytest.mark.parametrize("seed", [None, 3])
@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_joints_are_where_the_nodes_are(tmp_path, seed, scale):
    path = walking(seed, scale).glb(tmp_path / "walk.glb")
    clip = load_gltf_clip(path)
    assert clip.name == "Move"
    assert clip.rig.joint_names == tuple(BONES)
    assert clip.duration == pytest.approx(2.0)
    assert clip.times[0] == 0.0
    check_against_nodes(path, clip, TIMES[0], 1e-5)


def test_the_rest_pose_is_a_body_pose_and_up_is_known(tmp_path):
    clip = load_gltf_clip(walking(3).glb(tmp_path / "walk.glb"))
    T = ForwardKinematics(clip.rig).from_dofs(np.zeros(len(clip.rig.dofs)))
    at = dict(zip(clip.rig.joint_names, T[:, :3, 3].copy()))
    for name, (_, place) in BONES.items():
        np.testing.assert_allclose(at[name], place, atol=1e-5)
    np.testing.assert_allclose(T[:, :3, :3], np.broadcast_to(np.eye(3), (len(T), 3, 3)), atol=1e-6)
    assert clip.reference is None
    np.testing.assert_allclose(clip.T_world_file[:3, :3] @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(clip.T_world_file[:3, :3] @ [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])


@pytest.mark.parametrize(("size", "metres"), [(0.4, 1.0), (1.6, 1.0), (100.0, 0.01)])
def test_metres_are_believed_where_they_make_a_body(tmp_path, size, metres):
    clip = load_gltf_clip(walking(size=size).glb(tmp_path / "walk.glb"))
    T = ForwardKinematics(clip.rig).from_dofs(np.zeros(len(clip.rig.dofs)))
    head = T[clip.rig.index("Head"), 1, 3]
    assert head == pytest.approx(1.6 * size * metres, rel=1e-5)
    assert any("Unit taken" in note for note in clip.notes) == (metres != 1.0)


def test_the_place_goes_on_from_round_to_round(tmp_path):
    clip = load_gltf_clip(walking().glb(tmp_path / "walk.glb"))
    sampler, kinematics = ClipSampler(clip, "carry"), ForwardKinematics(clip.rig)
    hips = [kinematics.from_dofs(sampler.sample(t))[0, :3, 3].copy() for t in (2.0, 4.0, 6.0)]
    np.testing.assert_allclose(hips[1] - hips[0], [0.2 * np.pi, 0.0, 0.8 * np.pi], atol=0.02)
    np.testing.assert_allclose(hips[2] - hips[1], hips[1] - hips[0], atol=1e-6)


def test_an_armature_that_moves_moves_the_body(tmp_path):
    figure = Figure()
    figure.animation()
    turns = swing((0.0, 1.0, 0.0), 90.0 * (TIMES - TIMES[0]))
    figure.animate(0, "rotation", TIMES, turns.as_quat())
    figure.turn("LeftUpperArm", TIMES, swing((0.0, 0.0, 1.0), 20.0 * TIMES))
    path = figure.glb(tmp_path / "turns.glb")
    clip = load_gltf_clip(path)
    assert clip.rig.joint_names[0] == "Armature"
    check_against_nodes(path, clip, TIMES[0], 1e-5)


def test_a_skeleton_is_whole_where_few_of_its_joints_move(tmp_path):
    figure = Figure(4)
    figure.json["nodes"][0]["children"].append(figure.add("nodes", {"name": "shirt", "mesh": 0}))
    figure.add("nodes", {"name": "lamp"})
    figure.add("meshes", {"primitives": []})
    figure.animation()
    figure.turn("LeftHand", TIMES, swing((1.0, 0.0, 0.0), 20.0 * TIMES))
    clip = load_gltf_clip(figure.glb(tmp_path / "hand.glb"))
    assert clip.rig.joint_names == tuple(BONES)
    assert {name.rpartition("_")[0] for name in clip.rig.dofs.names} == {"LeftHand"}


def test_bones_are_as_long_as_in_the_motion_and_those_that_slide_slide(tmp_path):
    figure = walking()
    other = np.tile([0.0, -0.6, 0.0], (len(TIMES), 1))
    figure.animate(figure.node["LeftLowerLeg"], "translation", TIMES, other)
    slides = np.outer(np.sin(TIMES), [0.0, 0.05, 0.0])
    slides[:, 1] += 0.2
    figure.animate(figure.node["Chest"], "translation", TIMES, slides)
    path = figure.glb(tmp_path / "walk.glb")
    clip = load_gltf_clip(path)
    check_against_nodes(path, clip, TIMES[0], 1e-5)
    knee = clip.rig.index("LeftLowerLeg")
    np.testing.assert_allclose(clip.rig.T_parent_joint[knee, :3, 3], other[0], atol=1e-6)
    moved = {name.rpartition("_")[0] for name in clip.rig.dofs.names if "position" in name}
    assert moved == {"Hips", "Chest"}


def test_whole_numbers_stand_for_rotations(tmp_path):
    plain, small = Figure(), Figure()
    q = swing((0.0, 0.0, 1.0), 40.0 * np.sin(TIMES)).as_quat()
    for figure in (plain, small):
        figure.animation()
    plain.animate(plain.node["Head"], "rotation", TIMES, q)
    whole = np.round(q * 32767).astype(np.int16)
    small.animate(small.node["Head"], "rotation", TIMES, whole, dtype="i2", normalized=True)
    clips = [load_gltf_clip(f.glb(tmp_path / f"{i}.glb")) for i, f in enumerate((plain, small))]
    np.testing.assert_allclose(clips[0].values, clips[1].values, atol=1e-4)


def test_keys_need_no_unit_length(tmp_path):
    """A chord between quaternions of other lengths is another arc."""
    q = swing((0.0, 0.0, 1.0), np.array([0.0, 80.0, 0.0])).as_quat()
    angles = []
    for k, lengths in enumerate(([1.0, 1.0, 1.0], [1.0, 3.0, 1.0])):
        figure = Figure()
        figure.animation()
        values = q * np.array(lengths)[:, None]
        figure.animate(figure.node["Head"], "rotation", [0.0, 1.0, 2.0], values)
        figure.turn("Spine", [0.0, 0.25], swing((0.0, 1.0, 0.0), np.array([0.0, 9.0])))
        clip = load_gltf_clip(figure.glb(tmp_path / f"{k}.glb"))
        angles.append(ClipSampler(clip).sample(0.25))
    np.testing.assert_allclose(angles[1], angles[0], atol=1e-6)


def test_linear_stepped_and_cubic_samplers():
    rng = np.random.default_rng(0)
    times = np.array([0.2, 0.5, 1.1, 1.3])
    t = np.linspace(0.0, 1.5, 61)
    inside = np.clip(t, times[0], times[-1])
    values = rng.normal(size=(4, 3))
    linear = Channel(0, "translation", "LINEAR", times, values)
    told = np.stack([np.interp(t, times, values[:, k]) for k in range(3)], axis=1)
    np.testing.assert_allclose(linear.at(t), told, atol=1e-12)
    stepped = Channel(0, "translation", "STEP", times, values)
    told = values[[max(int((times <= s).sum()) - 1, 0) for s in t]]
    np.testing.assert_array_equal(stepped.at(t), told)
    tangents = rng.normal(size=(2, 4, 3))
    cubic = np.stack([tangents[0], values, tangents[1]], axis=1)
    told = np.empty((len(t), 3))
    for i in range(3):
        spline = CubicHermiteSpline(
            times[i : i + 2], values[i : i + 2], [tangents[1][i], tangents[0][i + 1]]
        )
        here = (inside >= times[i]) & (inside <= times[i + 1])
        told[here] = spline(inside[here])
    found = Channel(0, "translation", "CUBICSPLINE", times, cubic).at(t)
    np.testing.assert_allclose(found, told, atol=1e-12)


def test_rotations_go_the_short_way_at_an_even_rate():
    first = Rotation.from_rotvec([0.0, 0.0, 0.3])
    second = Rotation.from_rotvec([0.0, 0.0, 1.5])
    q = np.stack([first.as_quat(), -second.as_quat()])
    channel = Channel(0, "rotation", "LINEAR", np.array([0.0, 1.0]), q)
    found = Rotation.from_quat(channel.at(np.linspace(0.0, 1.0, 5))).as_rotvec()
    np.testing.assert_allclose(found[:, 2], [0.3, 0.6, 0.9, 1.2, 1.5], atol=1e-9)
    same = Channel(0, "rotation", "LINEAR", np.array([0.0, 1.0]), q[[0, 0]])
    np.testing.assert_allclose(same.at(np.array([0.3])), q[:1], atol=1e-12)


def test_between_cubic_keys_there_are_samples(tmp_path):
    figure = Figure()
    figure.animation()
    flat = np.tile([0.0, 0.0, 0.0, 1.0], (2, 3, 1))
    flat[1, 1] = swing((0.0, 0.0, 1.0), np.array([90.0])).as_quat()[0]
    flat[:, [0, 2]] = 0.0
    values = flat.reshape(6, 4)
    figure.animate(figure.node["Head"], "rotation", [0.0, 1.0], values, way="CUBICSPLINE")
    clip = load_gltf_clip(figure.glb(tmp_path / "nod.glb"))
    assert np.diff(clip.times).max() < 1.01 / 60.0
    # A quarter of the time: 3 s^2 - 2 s^3 = 0.156 of the way along the chord.
    a = 3 * 0.25**2 - 2 * 0.25**3
    chord = np.array([0.0, 0.0, a * np.sin(np.pi / 4), 1.0 - a + a * np.cos(np.pi / 4)])
    told = 2.0 * np.arctan2(chord[2], chord[3])
    column = clip.rig.dofs.names.index("Head_Zrotation")
    assert ClipSampler(clip).sample(0.25)[column] == pytest.approx(told, abs=1e-4)


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
    refused(load_clip, f"{path}:animation=0", match="no animation that turns a joint")
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
        (lambda f: f.json["animations"][0].update(channels=[]), "no animation that turns"),
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
        (_still, "no joint moves"),
    ],
)
def test_damaged_animations_are_refused(tmp_path, damage, words):
    figure = walking()
    damage(figure)
    refused(load_gltf_clip, figure.glb(tmp_path / "walk.glb"), match=words)


def test_too_many_numbers_are_refused_before_they_are_made(tmp_path):
    figure = Figure()
    figure.animation()
    flat = np.tile([0.0, 0.0, 0.0, 1.0], (2, 3, 1)).reshape(6, 4)
    figure.animate(figure.node["Head"], "rotation", [0.0, 8e4], flat, way="CUBICSPLINE")
    refused(load_gltf_clip, figure.glb(tmp_path / "long.glb"), match="joints in .* frames")


def test_options_out_of_range(tmp_path):
    path = walking().glb(tmp_path / "walk.glb")
    with pytest.raises(ParameterError, match="skip_t_pose"):
        load_gltf_clip(path, skip_t_pose="perhaps")
    with pytest.raises(InputFileError, match="not glTF"):
        load_clip(_text(tmp_path / "a.glb"))


def _text(path):
    path.write_text("nothing")
    return path
