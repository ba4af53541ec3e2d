"""BVH files made here: axes, units, channel orders, odd rest poses, and what must be refused."""

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.mocap.bvh import load_bvh
from test.bvh_figure import FIGURE, POSITIONS, bvh_text, standing_rows


@pytest.fixture
def load(tmp_path):
    def load(text, **options):
        path = tmp_path / "clip.bvh"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_bvh(path, **options)

    return load


def _world(clip, q):
    T = ForwardKinematics(clip.rig).from_dofs(q, clip.T_world_file)
    return dict(zip(clip.rig.joint_names, T))


def test_metres_y_up(load):
    clip = load(bvh_text(standing_rows(20)))
    assert clip.rig.dofs.names[:6] == (
        *("Hips_Xposition", "Hips_Yposition", "Hips_Zposition"),
        *("Hips_Zrotation", "Hips_Xrotation", "Hips_Yrotation"),
    )
    assert clip.values[5, 1] == pytest.approx(0.91)
    np.testing.assert_allclose(clip.values[5, 3:], math.radians(2.0 * math.sin(0.5)))
    assert clip.times[-1] == pytest.approx(0.19)
    assert clip.reference is None
    np.testing.assert_array_equal(
        clip.T_world_file[:3, :3], [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    )
    assert any("metre" in note for note in clip.notes)


@pytest.mark.parametrize(
    ("metres", "name"),
    [
        *((1.0, "metre"), (0.0254 / 0.45, "CMU unit"), (0.01, "centimetre")),
        *((0.1, "decimetre"), (0.001, "millimetre"), (0.3048, "foot")),
    ],
)
def test_unit_from_the_height(load, metres, name):
    clip = load(bvh_text(standing_rows(10, unit=metres), unit=metres))
    assert any(name in note for note in clip.notes), clip.notes
    assert clip.values[0, 1] == pytest.approx(0.91)
    assert clip.ankle_height == pytest.approx(0.07, abs=2e-3)


def test_a_child_in_inches(load):
    clip = load(bvh_text(standing_rows(10, unit=0.04), unit=0.04))  # 42 units high
    assert any("inch" in note for note in clip.notes), clip.notes


def test_unit_on_request(load):
    clip = load(bvh_text(standing_rows(4)), metres_per_unit=2.0)
    assert clip.values[0, 1] == pytest.approx(1.82)
    with pytest.raises(ParameterError, match="metres_per_unit"):
        load(bvh_text(standing_rows(4)), metres_per_unit=-1.0)


@pytest.mark.parametrize("order", ["".join(p) for p in itertools.permutations("XYZ")])
def test_channel_orders_and_line_ends(load, order):
    rng = np.random.default_rng(3)
    rows = standing_rows(6)
    rows[:, 3:] = rng.uniform(-20, 20, (6, rows.shape[1] - 3))
    clip = load(bvh_text(rows, order=order, newline="\r\n"))
    world = _world(clip, clip.values[3])
    expected = np.eye(4)
    for name, column in (("Hips", 3), ("Spine", 6), ("Neck", 9)):
        step = np.eye(4)
        offset = next(v for n, _, v in FIGURE if n == name)
        step[:3, 3] = rows[3, :3] if name == "Hips" else offset
        step[:3, :3] = Rotation.from_euler(
            order, rows[3, column : column + 3], degrees=True
        ).as_matrix()
        expected = expected @ step
    np.testing.assert_allclose(world["Neck"], clip.T_world_file @ expected, atol=1e-8)


def test_positions_after_rotations_still_move_first(load):
    rows = standing_rows(4)
    mixed = rows.copy()
    mixed[:, :6] = rows[:, [3, 0, 4, 1, 5, 2]]
    text = bvh_text(mixed, root="Zrotation Xposition Xrotation Yposition Yrotation Zposition")
    np.testing.assert_allclose(load(text).values, load(bvh_text(rows)).values)


def test_positions_that_replace_the_offset(load):
    joints = (("Hips", None, (0.0, 0.94, 0.0)), *FIGURE[1:])
    rows = standing_rows(10)
    clip = load(bvh_text(rows, joints=joints))
    assert any("replace" in note for note in clip.notes)
    assert _world(clip, clip.values[0])["Hips"][2, 3] == pytest.approx(0.91)
    rows[:, 1] = 0.01  # a small way from the offset instead
    clip = load(bvh_text(rows, joints=joints))
    assert _world(clip, clip.values[0])["Hips"][2, 3] == pytest.approx(0.95)


def test_positions_of_a_joint_below_the_root(load):
    text = bvh_text(np.zeros((1, 1)), joints=FIGURE[:2], ends={}, order="ZXY")
    head = text.replace("CHANNELS 3 Z", f"CHANNELS 6 {POSITIONS} Z").split("Frames")[0]
    added = np.zeros((5, 12))
    added[:, 1] = 0.9
    added[:, 7] = 0.05
    clip = load(head + _motion(added), metres_per_unit=1.0)
    T = ForwardKinematics(clip.rig).from_dofs(clip.values[0])
    np.testing.assert_allclose(T[1, :3, 3], [0.0, 0.9 + 0.25 + 0.05, 0.0])
    replacing = added.copy()
    replacing[:, 7] = 0.27
    clip = load(head + _motion(replacing), metres_per_unit=1.0)
    T = ForwardKinematics(clip.rig).from_dofs(clip.values[0])
    np.testing.assert_allclose(T[1, :3, 3], [0.0, 0.9 + 0.27, 0.0])
    zero = ForwardKinematics(clip.rig).from_dofs(np.zeros(12))
    np.testing.assert_allclose(zero[1, :3, 3], [0.0, 0.25, 0.0])  # the zero pose keeps its bones


def _motion(rows, frame_time="0.01"):
    return f"Frames: {len(rows)}\nFrame Time: {frame_time}\n" + "\n".join(
        " ".join(f"{x:.9g}" for x in row) for row in rows
    )


def test_rest_pose_with_all_bones_along_one_axis(load):
    """Only the angles make it a body: the loader finds a standing frame and the right axes."""
    flat = tuple(
        (name, above, (np.linalg.norm(v), 0.0, 0.0) if "Up" not in name and above else v)
        for name, above, v in FIGURE
    )
    directions = {name: np.array(v) for name, above, v in FIGURE if above}
    rows = np.zeros((8, 3 + 3 * len(FIGURE)))
    rows[:, 1] = 0.91
    world = {"Hips": np.eye(3)}
    bones = {above: name for name, above, _ in FIGURE if above not in (None, "Hips", "Spine")}
    bones |= {"Spine": "Neck"}
    order = [name for name, _, _ in FIGURE]
    column = {name: 3 + 3 * i for i, name in enumerate(_depth_first("Hips"))}
    for name in order[1:]:
        above = next(a for n, a, _ in FIGURE if n == name)
        child = bones.get(name)
        R = world[above]
        if child is not None:
            aim = directions[child] / np.linalg.norm(directions[child])
            R, _ = Rotation.align_vectors([aim], [[1.0, 0.0, 0.0]])
            R = R.as_matrix()
        world[name] = R
        local = Rotation.from_matrix(world[above].T @ R).as_euler("ZXY", degrees=True)
        rows[:, column[name] : column[name] + 3] = local
    clip = load(bvh_text(rows, joints=flat, ends={}))
    assert clip.reference is not None
    assert any("reference" in note for note in clip.notes)
    placed = _world(clip, clip.values[0])
    assert placed["Neck"][2, 3] > placed["Hips"][2, 3] > placed["LeftLeg"][2, 3]
    assert placed["LeftUpLeg"][1, 3] > placed["RightUpLeg"][1, 3]


def _depth_first(name):
    yield name
    for child, above, _ in FIGURE:
        if above == name:
            yield from _depth_first(child)


def test_inserted_t_pose_is_skipped_where_the_motion_jumps_away(load):
    rows = standing_rows(40)
    column = {name: 3 + 3 * i for i, name in enumerate(_depth_first("Hips"))}
    rows[:, column["LeftArm"]] += -70.0  # the arms hang, but in frame 1
    rows[:, column["RightArm"]] += 70.0
    rows[0, 3:] = 0.0
    text = bvh_text(rows)
    assert len(load(text).values) == 39
    assert any("Skipped 1" in note for note in load(text).notes)
    assert len(load(text, skip_t_pose="off").values) == 40
    smooth = bvh_text(rows[1:])
    assert len(load(smooth).values) == 39
    assert len(load(smooth, skip_t_pose="on").values) == 38
    with pytest.raises(ParameterError, match="skip_t_pose"):
        load(text, skip_t_pose="maybe")


def test_a_fast_start_is_not_an_inserted_pose(load):
    rows = standing_rows(40)
    rows[:, 12:] = 60.0 * np.sin(1.5 * np.arange(40))[:, None]  # jumps of 60 degrees everywhere
    assert len(load(bvh_text(rows)).values) == 40


def test_one_frame_is_a_still(load):
    clip = load(bvh_text(standing_rows(1)))
    assert len(clip.times) == 1
    assert clip.duration == 0.0
    assert not clip.loops


def test_frame_time_zero_is_replaced_and_said(load):
    clip = load(bvh_text(standing_rows(3), frame_time="0"))
    assert clip.times[1] == pytest.approx(1 / 30)
    assert any("Frame Time" in note for note in clip.notes)


def test_a_closed_clip_loops(load):
    rows = standing_rows(50)
    assert not load(bvh_text(rows)).loops
    rows[-1] = rows[0]
    assert load(bvh_text(rows)).loops


def test_unknown_names_are_loaded_and_said(load):
    joints = (("a", None, (0, 0, 0)), ("b", "a", (0, 1.0, 0)))
    clip = load(bvh_text(np.zeros((2, 9)), joints=joints, ends={}))
    assert any("No joint name is known" in note for note in clip.notes)


def test_repeated_and_odd_names(load):
    joints = (("Hips", None, (0, 0, 0)), ("x", "Hips", (0, 1.0, 0)), ("x y", "Hips", (0, 1, 0)))
    text = (
        bvh_text(np.zeros((2, 12)), joints=joints, ends={})
        .replace("x y", "x")
        .replace("x\n", "x\n")
    )
    assert load(text).rig.joint_names == ("Hips", "x", "x__2")


def test_more_numbers_than_declared_are_left_out(load):
    text = bvh_text(standing_rows(5)).replace("Frames: 5", "Frames: 3")
    assert len(load(text).values) == 3


GOOD = bvh_text(standing_rows(3))
BAD = {
    "empty": b"",
    "blank": b" \n\n",
    "binary": bytes(range(256)) * 40,
    "zeros": b"\0" * 5000,
    "other text": b"hello\nworld\n",
    "no motion": GOOD.split("MOTION")[0],
    "cut in the hierarchy": GOOD[: len(GOOD) // 4],
    "cut in the numbers": GOOD[: -len(GOOD) // 6],
    "cut in the last frame": GOOD.rstrip().rpartition(" ")[0],
    "no frames": bvh_text(np.zeros((0, 51))),
    "negative frames": GOOD.replace("Frames: 3", "Frames: -3"),
    "huge frames": GOOD.replace("Frames: 3", "Frames: 99999999999999"),
    "many digits": GOOD.replace("Frames: 3", "Frames: " + "9" * 900),
    "fractional frames": GOOD.replace("Frames: 3", "Frames: 3.5"),
    "no frame time": GOOD.replace("Frame Time: 0.01", ""),
    "frame time nan": GOOD.replace("Frame Time: 0.01", "Frame Time: nan"),
    "frame time negative": GOOD.replace("Frame Time: 0.01", "Frame Time: -1"),
    "nan": bvh_text([*standing_rows(2), np.full(51, np.nan)]),
    "inf": bvh_text([*standing_rows(2), np.full(51, np.inf)]),
    "enormous": bvh_text([*standing_rows(2), np.full(51, 1e300)]),
    "a word among numbers": GOOD.replace("0.91 0", "0.91 abc", 1),
    "one long word": GOOD[:-4] + "1" * 9_000_000,
    "unbalanced": GOOD.replace("}\nMOTION", "MOTION"),
    "closed twice": GOOD.replace("}\nMOTION", "}\n}\nMOTION"),
    "offset of two": GOOD.replace("OFFSET 0 0.25 0", "OFFSET 0 0.25"),
    "offset nan": GOOD.replace("OFFSET 0 0.25 0", "OFFSET 0 nan 0"),
    "offset huge": GOOD.replace("OFFSET 0 0.25 0", "OFFSET 0 1e30 0"),
    "unknown channel": GOOD.replace("CHANNELS 3 Z", "CHANNELS 3 W", 1),
    "channel count": GOOD.replace("CHANNELS 3 Z", "CHANNELS 4 Z", 1),
    "channel twice": GOOD.replace("Zrotation Xrotation Yrotation", "Zrotation Zrotation Y", 1),
    "no channels": GOOD.replace("CHANNELS", "#"),
    "nameless": GOOD.replace("ROOT Hips", "ROOT"),
    "joint outside": GOOD.replace("ROOT Hips", "JOINT Hips"),
    "end site with joint": GOOD.replace("End Site\n{", "End Site\n{\nJOINT x\n{\n}", 1),
    "deep": "HIERARCHY\nROOT r\n{\n" + "JOINT a\n{\n" * 100_000 + "}" * 100_001 + "\nMOTION\n",
    "wide": "HIERARCHY\nROOT r\n{\n" + "JOINT a\n{\n}\n" * 10_000 + "}\nMOTION\nFrames: 1\n",
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_are_refused(load, name):
    assert len(BAD[name]) == 0 or BAD[name] != GOOD
    with pytest.raises(InputFileError, match=r"clip\.bvh") as caught:
        load(BAD[name])
    assert len(str(caught.value)) < 400
    assert str(caught.value).isprintable()


def test_missing_file_and_folder(tmp_path):
    for path in (tmp_path / "none.bvh", tmp_path):
        with pytest.raises(InputFileError):
            load_bvh(path)


def test_zero_length_bones_are_harmless(load):
    joints = tuple((n, a, (0.0, 0.0, 0.0)) for n, a, _ in FIGURE)
    clip = load(bvh_text(standing_rows(3), joints=joints, ends={}))
    assert np.isfinite(clip.values).all()
