"""Recordings as clips: what is read, what is left out, what is refused."""

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.rosbag import load_bag
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.mocap.walk import walk

TYPES = get_typestore(Stores.ROS2_JAZZY)
STATE, STRING = "sensor_msgs/msg/JointState", "std_msgs/msg/String"


def _state(names, positions, nanoseconds):
    T = TYPES.types
    empty = np.zeros(0)
    return T[STATE](
        header=T["std_msgs/msg/Header"](
            stamp=T["builtin_interfaces/msg/Time"](
                sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9
            ),
            frame_id="",
        ),
        name=list(names),
        position=np.asarray(positions, dtype=np.float64),
        velocity=empty,
        effort=empty,
    )


def _write(path, states, *, urdf, namespace="", plugin=StoragePlugin.MCAP):
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        joint_states = writer.add_connection(f"{namespace}/joint_states", STATE, typestore=TYPES)
        description = writer.add_connection(
            f"{namespace}/robot_description", STRING, typestore=TYPES
        )
        if urdf is not None:
            message = TYPES.types[STRING](data=urdf)
            writer.write(description, 1, TYPES.serialize_cdr(message, STRING))
        for k, state in enumerate(states):
            data = state if isinstance(state, bytes) else TYPES.serialize_cdr(state, STATE)
            writer.write(joint_states, 10 + k, bytes(data))
    return path


WALK = walk(path="straight", strides=4)
URDF = urdf_from_clip(WALK)
NAMES = WALK.rig.dofs.names
STEP = 10_000_000
START = 1_700_000_000 * 10**9


def _states(count, order=None):
    order = np.arange(len(NAMES)) if order is None else order
    return [
        _state(
            [NAMES[k] for k in order], WALK.values[i][order], START + round(WALK.times[i] * 1e9)
        )
        for i in range(count)
    ]


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("single", [False, True])
def test_folder_and_single_file(tmp_path, plugin, single):
    path = _write(tmp_path / "bag", _states(30), urdf=URDF, plugin=plugin)
    if single:
        path = next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))
    clip = load_clip(path)
    np.testing.assert_array_equal(clip.values, WALK.values[:30])
    np.testing.assert_allclose(clip.times, WALK.times[:30], atol=1e-8)
    assert clip.rig.dofs.names == NAMES
    assert clip.end_sites == WALK.end_sites
    assert clip.ankle_height == WALK.ankle_height
    assert not clip.notes
    T = ForwardKinematics(clip.rig).from_dofs(clip.values[7], clip.T_world_file)
    expected = ForwardKinematics(WALK.rig).from_dofs(WALK.values[7], WALK.T_world_file)
    np.testing.assert_allclose(T[clip.rig.index("leftToes")], expected[WALK.rig.index("leftToes")])


def test_order_of_names_does_not_matter(tmp_path):
    states = _states(3) + _states(6, np.random.default_rng(0).permutation(len(NAMES)))[3:]
    clip = load_bag(_write(tmp_path / "bag", states, urdf=URDF))
    np.testing.assert_array_equal(clip.values, WALK.values[:6])


def test_in_a_namespace_with_its_own_description(tmp_path):
    clip = load_bag(_write(tmp_path / "bag", _states(3), urdf=URDF, namespace="/ada"))
    assert len(clip.times) == 3


def test_what_cannot_be_used_is_left_out_and_counted(tmp_path):
    good = _states(6)
    nan = WALK.values[0].copy()
    nan[3] = np.nan
    t = START + round(WALK.times[3] * 1e9)
    bad = [
        _state(NAMES, nan, t + 1),
        _state(NAMES, np.full(len(NAMES), np.inf), t + 2),
        _state(NAMES, WALK.values[0][:-1], t + 3),
        _state(NAMES[:-1], WALK.values[0][:-1], t + 4),
        _state((*NAMES[:-1], "other"), WALK.values[0], t + 5),
        _state((NAMES[0], *NAMES[:-1]), WALK.values[0], t + 6),
        _state(NAMES, WALK.values[0], t),  # again
        _state(NAMES, WALK.values[0], START - STEP),  # back
        _state([], [], t + 7),
        b"\x00\x01\x00\x00 damaged",
        b"",
    ]
    clip = load_bag(_write(tmp_path / "bag", [*good[:4], *bad, *good[4:]], urdf=URDF))
    np.testing.assert_array_equal(clip.values, WALK.values[:6])
    text = " ".join(clip.notes)
    for part in (
        *("2 message(s): a position is not finite", "1 message(s): names and positions differ"),
        *("1 message(s): a name occurs twice", "3 message(s): the joints are not those"),
        *("2 message(s): the stamp repeats", "2 message(s): they cannot be decoded"),
    ):
        assert part in text, text


def test_stamps_that_are_not_set_are_those_of_the_recording(tmp_path):
    states = [_state(NAMES, WALK.values[i], 0) for i in range(4)]
    clip = load_bag(_write(tmp_path / "bag", states, urdf=URDF))
    np.testing.assert_allclose(clip.times, 1e-9 * np.arange(4))


def test_joints_that_were_not_recorded_are_said(tmp_path):
    states = [_state(NAMES[:6], WALK.values[i][:6], START + i * STEP) for i in range(3)]
    clip = load_bag(_write(tmp_path / "bag", states, urdf=URDF))
    assert any("Not recorded" in note for note in clip.notes)
    assert not clip.values[:, 6:].any()


def test_interpolation_is_that_of_the_clip(tmp_path):
    path = _write(tmp_path / "bag", _states(20), urdf=URDF)
    ours, recorded = ClipSampler(WALK), ClipSampler(load_bag(path))
    for t in (0.004, 0.1234):
        np.testing.assert_allclose(recorded.sample(t), ours.sample(t), atol=1e-5)


@pytest.mark.parametrize(
    ("states", "urdf", "problem"),
    [
        ([], URDF, "no usable joint states"),
        (_states(2), None, "no message"),
        (_states(2), "<not xml", "not usable XML"),
        (_states(2), '<robot name="r"><link name="a"/></robot>', "of which"),
        ([_state(["x"], [0.0], 1)], URDF, "of which"),
        ([_state(NAMES, np.full(len(NAMES), np.nan), 1)], URDF, "not finite"),
    ],
)
def test_bags_without_a_motion_are_refused(tmp_path, states, urdf, problem):
    path = _write(tmp_path / "bag", states, urdf=urdf)
    with pytest.raises(InputFileError, match=problem):
        load_bag(path)


def test_bags_without_the_topics_are_refused(tmp_path):
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/chatter", STRING, typestore=TYPES)
    with pytest.raises(InputFileError, match="joint_states"):
        load_bag(tmp_path / "bag")


@pytest.mark.parametrize("share", [0.0, 0.2, 0.7, 0.95])
@pytest.mark.parametrize("ending", [".mcap", ".db3"])
def test_damaged_files_are_refused(tmp_path, share, ending):
    plugin = StoragePlugin.MCAP if ending == ".mcap" else StoragePlugin.SQLITE3
    path = _write(tmp_path / "bag", _states(20), urdf=URDF, plugin=plugin)
    file = next(f for f in path.iterdir() if f.suffix == ending)
    data = file.read_bytes()
    file.write_bytes(data[: int(share * len(data))])
    if ending == ".mcap" or share < 0.9:  # the end of a database may be empty pages
        with pytest.raises(InputFileError):
            load_bag(path)
    file.write_bytes(np.random.default_rng(0).bytes(4000))
    with pytest.raises(InputFileError):
        load_bag(file)


def test_folders_and_files_that_are_no_bags(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "yaml").mkdir()
    (tmp_path / "yaml" / "metadata.yaml").write_text("!!python/object/apply:os.system ['true']")
    (tmp_path / "text.mcap").write_text("hello")
    (tmp_path / "other.txt").write_text("hello")
    for name in ("empty", "yaml", "text.mcap", "other.txt", "none"):
        with pytest.raises(InputFileError):
            load_bag(tmp_path / name)
