"""Recordings as rosbag2 writes them, and what is left of one when the disk is full."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest
import yaml
from rosbags.typesys import Stores, get_typestore

pytest.importorskip("sensor_msgs")
from garment_sim_ros.mocap.bag_file import opened_bag
from garment_sim_ros.recording.bag_writer import BagWriter
from garment_sim_ros.ros.offered import offered

STORE = get_typestore(Stores.ROS2_JAZZY)
MESSAGE = 50_000
"""Bytes of one."""
FOREVER = {"sec": 9223372036, "nsec": 854775807}
PROFILE = {
    "history": "keep_last",
    "depth": 2,
    "reliability": "reliable",
    "durability": "volatile",
    "deadline": FOREVER,
    "lifespan": FOREVER,
    "liveliness": "automatic",
    "liveliness_lease_duration": FOREVER,
    "avoid_ros_namespace_conventions": False,
}


def write(path, count):
    """A recording of so many messages that cannot be compressed."""
    noise = np.random.default_rng(1)
    writer = BagWriter(path)
    writer.open()
    try:
        connection = writer.add_connection(
            "/a/points",
            "std_msgs/msg/String",
            typestore=STORE,
            offered_qos_profiles=[offered(reliable=True, latched=False, depth=2)],
        )
        for i in range(count):
            data = noise.integers(0, 256, MESSAGE - 8, np.uint8).tobytes()
            writer.write(connection, 10**9 + i, b"\0\1\0\0" + i.to_bytes(4, "little") + data)
        writer.close()
    except OSError:
        return writer.keep_what_is_whole()
    return count


def numbers(path):
    with opened_bag(path) as bag:
        (connection,) = bag.connections
        found = [
            (time - 10**9, int.from_bytes(data[4:8], "little"))
            for _, time, data in bag.messages([connection])
        ]
        assert connection.msgcount == len(found)
    assert all(time == number for time, number in found)
    return [number for _, number in found]


def metadata(path):
    return yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


def test_metadata_are_those_that_rosbag2_writes(tmp_path):
    """Version 9, key by key, as rosbag2_storage's metadata_io has them."""
    write(tmp_path / "bag", 3)
    found = metadata(tmp_path / "bag")
    times = {
        "starting_time": {"nanoseconds_since_epoch": 10**9},
        "duration": {"nanoseconds": 2},
        "message_count": 3,
    }
    (topic,) = found.pop("topics_with_message_count")
    assert topic["message_count"] == 3
    digest = topic["topic_metadata"].pop("type_description_hash")
    assert digest.startswith("RIHS01_")
    assert len(digest) == len("RIHS01_") + 64
    assert topic["topic_metadata"] == {
        "name": "/a/points",
        "type": "std_msgs/msg/String",
        "serialization_format": "cdr",
        "offered_qos_profiles": [PROFILE],
    }
    assert found == {
        "version": 9,
        "storage_identifier": "mcap",
        **times,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": ["bag.mcap"],
        "files": [{"path": "bag.mcap", **times}],
        "custom_data": None,
        "ros_distro": "jazzy",
    }


def test_the_file_itself_has_the_same_metadata(tmp_path):
    write(tmp_path / "bag", 3)
    content = (tmp_path / "bag" / "bag.mcap").read_bytes()
    assert content.count(b"ros_distro: jazzy") == 1
    assert b"ros_distro: rosbags" not in content


def limited(path, room):
    """As `write`, 70 messages in a process that may write so many bytes to a file."""
    script = f"""
    import resource, signal
    from pathlib import Path
    from test_bag_writer import write
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))
    print(write(Path({str(path)!r}), 70))
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)],
        capture_output=True,
        text=True,
        check=False,
        cwd=__file__.rpartition("/")[0],
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return int(done.stdout)


@pytest.mark.parametrize("room", [None, 2_500_000])
def test_the_reader_of_the_formats_authors_reads_all_of_it(tmp_path, room):
    """Also where the disk was full."""
    reader = pytest.importorskip("mcap.reader")
    count = write(tmp_path / "bag", 3) if room is None else limited(tmp_path / "bag", room)
    with (tmp_path / "bag" / "bag.mcap").open("rb") as stream:
        found = reader.make_reader(stream)
        assert found.get_summary().statistics.message_count == count
        times = [message.log_time for _, _, message in found.iter_messages()]
    assert times == list(range(10**9, 10**9 + count))


@pytest.mark.parametrize("room", [1_100_000, 2_500_000, 3_149_000, 3_400_000])
def test_a_recording_that_runs_out_of_room_ends_before(tmp_path, room):
    count = limited(tmp_path / "bag", room)
    # All whole chunks, of a mebibyte each, that there was room for.
    assert count == min(70, room // (2**20 + 2000) * 21)
    assert numbers(tmp_path / "bag") == list(range(count))
    assert metadata(tmp_path / "bag")["message_count"] == count
    assert sorted(p.name for p in (tmp_path / "bag").iterdir()) == ["bag.mcap", "metadata.yaml"]
