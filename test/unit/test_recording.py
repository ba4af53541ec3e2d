"""Reading back a bag: what was written, and clear errors for what is no avatar's bag."""

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.recording.bags import read_recording
from garment_sim_ros.recording.tracks import ColliderTrack

STORE = get_typestore(Stores.ROS2_JAZZY)
FRAMES = 10


def message(kind, **fields):
    return STORE.types[kind](**fields)


def header(nanoseconds):
    sec, nanosec = divmod(nanoseconds, 1_000_000_000)
    stamp = message("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    return message("std_msgs/msg/Header", stamp=stamp, frame_id="world")


def joints(stamp, names, values):
    empty = np.zeros(0)
    return message(
        "sensor_msgs/msg/JointState",
        header=header(stamp),
        name=names,
        position=np.array(values, float),
        velocity=empty,
        effort=empty,
    )


def cloud(stamp, points, step):
    data = np.zeros((len(points), step), np.uint8)
    data[:, :12] = points.astype(np.float32).view(np.uint8).reshape(-1, 12)
    return message(
        "sensor_msgs/msg/PointCloud2",
        header=header(stamp),
        height=1,
        width=len(points),
        fields=[],
        is_bigendian=False,
        point_step=step,
        row_step=step * len(points),
        data=data.ravel(),
        is_dense=True,
    )


def topology(points, triangles):
    triangle, point = "shape_msgs/msg/MeshTriangle", "geometry_msgs/msg/Point"
    return message(
        "shape_msgs/msg/Mesh",
        triangles=[message(triangle, vertex_indices=np.array(t, np.uint32)) for t in triangles],
        vertices=[message(point, x=p[0], y=p[1], z=p[2]) for p in points],
    )


def quality(stamp, **values):
    items = [message("diagnostic_msgs/msg/KeyValue", key=k, value=v) for k, v in values.items()]
    status = message(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=0,
        name="skirt",
        message="",
        hardware_id="",
        values=items,
    )
    return message("diagnostic_msgs/msg/DiagnosticArray", header=header(stamp), status=[status])


REST = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@pytest.fixture
def write(tmp_path):
    """Writes messages `(topic, arrival, message)` to a bag and returns its path."""

    def write(messages, plugin="MCAP", compressed="NONE"):
        path = tmp_path / "bag"
        writer = Writer(path, version=9, storage_plugin=StoragePlugin[plugin])
        if compressed != "NONE":
            writer.set_compression(CompressionMode[compressed], CompressionFormat.ZSTD)
        with writer:
            connections = {}
            for topic, arrival, content in messages:
                kind = content.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
                data = STORE.serialize_cdr(content, kind)
                writer.write(connections[topic], arrival, data)
        return path

    return write


def avatar(namespace="", step=24, spoil=None, text="<robot/>", joints_named=("a", "b")):
    text = message("std_msgs/msg/String", data=text)
    messages = [
        (f"{namespace}/robot_description", 1, text),
        (f"{namespace}/garments/skirt/topology", 1, topology(REST, [[0, 1, 2]])),
    ]
    for i in range(FRAMES):
        stamp = 5_000_000_000 + i * 16_666_667
        x = REST + i
        if i == spoil:
            x[1, 2] = np.nan
        messages += [
            (f"{namespace}/joint_states", stamp + 1, joints(stamp, list(joints_named), [i, -i])),
            (f"{namespace}/garments/skirt/points", stamp + 2, cloud(stamp, x, step)),
            (f"{namespace}/quality", stamp + 3, quality(stamp, step_ms=f"{0.5 * i}", solver="x")),
        ]
    return messages


@pytest.mark.parametrize("namespace", ["", "/left/avatar"])
@pytest.mark.parametrize("step", [12, 24])
def test_reads_what_was_written(write, namespace, step):
    recording = read_recording(write(avatar(namespace, step)))
    assert recording.robot_description == "<robot/>"
    assert recording.joint_names == ("a", "b")
    assert recording.joint_values.tolist() == [[i, -i] for i in range(FRAMES)]
    assert recording.joint_stamp[1] == 5_016_666_667
    skirt = recording.garments["skirt"]
    assert skirt.vertices.tolist() == REST.tolist()
    assert skirt.triangles.tolist() == [[0, 1, 2]]
    assert (skirt.arrival == recording.stamp + 2).all()
    assert skirt.finite
    assert skirt.positions == pytest.approx(np.array([REST + i for i in range(FRAMES)]))
    assert recording.quality["skirt"]["step_ms"].tolist() == [0.5 * i for i in range(FRAMES)]
    assert "solver" not in recording.quality["skirt"]


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
@pytest.mark.parametrize("compressed", ["FILE", "MESSAGE"])
def test_reads_what_was_compressed(write, plugin, compressed):
    path = write(avatar(), plugin, compressed)
    assert compressed.lower() in (path / "metadata.yaml").read_text()
    recording = read_recording(path)
    assert recording.robot_description == "<robot/>"
    assert recording.joint_values.tolist() == [[i, -i] for i in range(FRAMES)]
    assert recording.garments["skirt"].positions == pytest.approx(
        np.array([REST + i for i in range(FRAMES)])
    )


def test_positions_are_kept_of_so_many_frames_only(write):
    recording = read_recording(write(avatar()), most_frames=4)
    skirt = recording.garments["skirt"]
    assert len(skirt.arrival) == FRAMES
    assert ((recording.stamp - 5_000_000_000) // 16_666_667).tolist() == [0, 3, 6, 9]
    assert (skirt.positions[:, 0, 0] == [0, 3, 6, 9]).all()


def test_frames_are_kept_from_when_the_pose_is_known(write):
    """The first and the last message that came were not of the joints."""
    messages = [m for m in avatar() if not m[0].endswith("joint_states")]
    messages += [m for m in avatar() if m[0].endswith("joint_states")][3:-2]
    recording = read_recording(write(messages))
    skirt = recording.garments["skirt"]
    assert skirt.positions[:, 0, 0].tolist() == list(range(3, FRAMES - 2))
    assert recording.stamp[0] == recording.joint_stamp[0]
    assert recording.stamp[-1] == recording.joint_stamp[-1]
    assert len(skirt.arrival) == FRAMES


def test_frames_that_one_garment_lacks_are_not_kept(write):
    messages = avatar()
    scarf = [(t.replace("skirt", "scarf"), a, m) for t, a, m in messages if "garments" in t]
    del scarf[3]
    recording = read_recording(write(messages + scarf))
    assert len(recording.stamp) == FRAMES - 1
    for garment in recording.garments.values():
        assert garment.positions[:, 0, 0].tolist() == [0, 1, *range(3, FRAMES)]


def test_points_that_do_not_fit_the_topology_are_refused(write):
    messages = avatar()
    messages.append(("/garments/skirt/points", 9, cloud(9, REST[:2], 12)))
    with pytest.raises(InputFileError, match="topology"):
        read_recording(write(messages))


def test_every_frame_is_looked_at_for_nan(write):
    assert not read_recording(write(avatar(spoil=4)), most_frames=4).garments["skirt"].finite


def test_messages_with_other_joints_are_left_out(write):
    messages = avatar()
    messages.append(("/joint_states", 9_000_000_000, joints(9_000_000_000, ["b", "a"], [7, 7])))
    assert len(read_recording(write(messages)).joint_values) == FRAMES


@pytest.mark.parametrize("missing", ["robot_description", "joint_states", "topology", "quality"])
def test_missing_topic_is_named(write, missing):
    messages = [m for m in avatar() if not m[0].endswith(missing)]
    with pytest.raises(InputFileError, match=missing):
        read_recording(write(messages))


def test_what_is_no_bag_is_a_clear_error(tmp_path):
    for path in (tmp_path, tmp_path / "nothing"):
        with pytest.raises(InputFileError, match="rosbag2"):
            read_recording(path)


def test_poses_between_two_messages_are_interpolated_and_those_of_one_are_its():
    turns = np.array([0.0, 0.3, 1.1])
    track = ColliderTrack(
        colliders=ColliderSet(colliders=(Collider(name="frame_a", kind="frame", bone="a"),)),
        stamp=np.array([100, 200, 400]),
        position=np.array([[[0.0, 0.0, 1.0]], [[2.0, 0.0, 1.0]], [[2.0, 4.0, 1.0]]]),
        orientation=np.stack(
            [0 * turns, 0 * turns, np.sin(0.5 * turns), np.cos(0.5 * turns)], axis=-1
        )[:, None],
    )
    for k, stamp in enumerate((100, 200, 400)):
        poses = track.at(stamp)
        assert np.array_equal(poses.position, track.position[k])
        assert np.array_equal(poses.orientation, track.orientation[k])
    poses = track.at(350)
    np.testing.assert_allclose(poses.position, [[2.0, 3.0, 1.0]])
    turn = 0.3 + 0.75 * 0.8
    np.testing.assert_allclose(
        poses.orientation, [[0.0, 0.0, np.sin(0.5 * turn), np.cos(0.5 * turn)]]
    )
    assert track.at(99) is None
    assert track.at(401) is None
