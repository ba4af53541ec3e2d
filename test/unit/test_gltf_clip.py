"""Animations in glTF files as clips."""

import numpy as np
import pytest
from gltf_figure import BONES, TIMES, Figure, nodes_at, swing, walking
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.mocap.gltf_channels import Channel
from garment_sim_ros.mocap.gltf_clip import load_gltf_clip
from garment_sim_ros.mocap.sampling import ClipSampler, rate_of


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


@pytest.mark.parametrize("mirror", [(-1, 1, 1), (1, 1, -1), (-1, -1, -1)])
def test_a_mirrored_armature_turns_as_its_image_does(tmp_path, mirror):
    figure = walking(3)
    figure.json["nodes"][0]["scale"] = list(mirror)
    image = load_gltf_clip(figure.glb(tmp_path / "image.glb"))
    plain = load_gltf_clip(walking(3).glb(tmp_path / "plain.glb"))
    assert image.rig.joint_names == plain.rig.joint_names
    S = np.diag(np.array(mirror, np.float64))
    fk, of_image = ForwardKinematics(plain.rig), ForwardKinematics(image.rig)
    for k in range(0, len(plain.times), 10):
        T, T_image = fk.from_dofs(plain.values[k]), of_image.from_dofs(image.values[k])
        np.testing.assert_allclose(T_image[:, :3, 3], T[:, :3, 3] @ S, atol=1e-5)
        np.testing.assert_allclose(T_image[:, :3, :3], S @ T[:, :3, :3] @ S, atol=1e-5)


def test_who_swims_does_not_stand(tmp_path):
    """Up is y in any glTF file, also where nobody is ever upright."""
    figure = Figure()
    figure.animation()
    figure.turn("Hips", TIMES, swing((1.0, 0.0, 0.0), np.full(21, 88.0)))
    figure.turn("LeftUpperLeg", TIMES, swing((1.0, 0.0, 0.0), 20.0 * np.sin(9.0 * TIMES)))
    clip = load_gltf_clip(figure.glb(tmp_path / "swims.glb"))
    np.testing.assert_allclose(clip.T_world_file[:3, :3] @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    assert clip.reference is None
    head = ForwardKinematics(clip.rig).from_dofs(clip.values[0])[clip.rig.index("Head"), :3, 3]
    assert head[1] < 1.1  # as high as the hips


def test_the_body_faces_as_it_rests_wherever_it_walks(tmp_path):
    figure = walking()
    turn = swing((0.0, 1.0, 0.0), np.full(21, 90.0)).as_quat()
    figure.animate(0, "rotation", TIMES, turn)
    clip = load_gltf_clip(figure.glb(tmp_path / "sideways.glb"))
    np.testing.assert_allclose(clip.T_world_file[:3, :3] @ [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])


@pytest.mark.parametrize("keys", [[0.0, 1.0, 2.0, 3.0], [0.0, 0.001, 1.3, 3.0], [0.0, 3.0]])
def test_few_keys_are_sampled_sixty_times_a_second(tmp_path, keys):
    figure = Figure()
    figure.animation()
    figure.turn("Head", keys, swing((0.0, 0.0, 1.0), 20.0 * np.array(keys)))
    clip = load_gltf_clip(figure.glb(tmp_path / "few.glb"))
    assert rate_of(clip) == pytest.approx(60.0)
    assert clip.duration == pytest.approx(3.0)


def test_frames_that_a_program_worked_out_are_the_samples(tmp_path):
    figure = Figure()
    figure.animation()
    times = np.arange(31) / 24.0
    figure.turn("Head", times, swing((0.0, 0.0, 1.0), 20.0 * np.sin(times)))
    figure.turn("Neck", times[[0, 5, 30]], swing((0.0, 0.0, 1.0), np.array([0.0, 5.0, 0.0])))
    clip = load_gltf_clip(figure.glb(tmp_path / "baked.glb"))
    assert rate_of(clip) == pytest.approx(24.0)
    head = clip.values[:, clip.rig.dofs.names.index("Head_Zrotation")]
    np.testing.assert_allclose(head, np.radians(20.0 * np.sin(times)), atol=1e-6)


def test_steps_are_steps(tmp_path):
    figure = Figure()
    figure.animation()
    turns = swing((0.0, 0.0, 1.0), np.array([0.0, 10.0, 20.0]))
    figure.turn("Head", [0.0, 1.0, 2.0], turns, way="STEP")
    clip = load_gltf_clip(figure.glb(tmp_path / "steps.glb"))
    sampler, column = ClipSampler(clip), clip.rig.dofs.names.index("Head_Zrotation")
    told = [np.degrees(sampler.sample(t)[column]) for t in (0.5, 0.98, 1.02, 1.98, 2.0)]
    np.testing.assert_allclose(told, [0.0, 0.0, 10.0, 10.0, 20.0], atol=1e-4)


def test_a_first_movement_is_no_inserted_pose(tmp_path):
    figure = Figure()
    figure.animation()
    for side, sign in (("Left", -1.0), ("Right", 1.0)):
        arms = swing((0.0, 0.0, 1.0), sign * np.array([0.0, 80.0, 80.0]))
        figure.turn(f"{side}UpperArm", [0.0, 1.0, 2.0], arms)
    clip = load_gltf_clip(figure.glb(tmp_path / "arms.glb"))
    assert clip.duration == pytest.approx(2.0)
    assert not any("Skipped" in note for note in clip.notes)


def test_what_others_do_takes_no_time(tmp_path):
    figure = walking()
    hat = figure.add("nodes", {"name": "hat", "mesh": 0})
    figure.add("meshes", {"primitives": []})
    figure.animate(hat, "translation", [0.0, 500.0], np.zeros((2, 3)))
    clip = load_gltf_clip(figure.glb(tmp_path / "hat.glb"))
    assert clip.duration == pytest.approx(2.0)


def test_the_hips_carry_the_body_wherever_they_stand_among_the_nodes(tmp_path):
    figure = walking()
    control = figure.add("nodes", {"name": "IK_Foot"})
    figure.json["nodes"][0]["children"].insert(0, control)
    figure.animate(control, "translation", TIMES, np.outer(np.sin(TIMES), [1.0, 0.0, 0.0]))
    figure.animate(0, "translation", TIMES, np.zeros((21, 3)))
    clip = load_gltf_clip(figure.glb(tmp_path / "controls.glb"))
    sampler, kinematics = ClipSampler(clip, "carry"), ForwardKinematics(clip.rig)
    hips = clip.rig.index("Hips")
    z = [kinematics.from_dofs(sampler.sample(t))[hips, 2, 3] for t in (0.1, 1.9, 2.1, 3.9)]
    assert z[3] - z[1] == pytest.approx(0.8 * np.pi, abs=0.05)
    assert z[2] > z[1]


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
