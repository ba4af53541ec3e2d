"""Recordings and caches made to take hours or all memory, and those that readers fell over."""

import hashlib
import sqlite3
import struct
import zipfile
from contextlib import closing

import numpy as np
import pytest
from backports import zstd
from hostile.reading import bounded, folder_with, refused, written
from unit.test_recording import STORE, avatar

from garment_sim_ros import disk_cache
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.recording.bags import read_recording


@pytest.fixture(autouse=True)
def _bounded():
    with bounded():
        yield


@pytest.fixture
def bag(tmp_path):
    """Writes the bag of an avatar."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    def write(plugin, messages=None, compressed=None):
        path = tmp_path / f"bag_{plugin}"
        writer = Writer(path, version=9, storage_plugin=StoragePlugin[plugin])
        compressed = compressed or ("STORAGE" if plugin == "MCAP" else "NONE")
        if compressed != "NONE":
            writer.set_compression(CompressionMode[compressed], CompressionFormat.ZSTD)
        with writer:
            connections = {}
            for topic, arrival, content in messages or avatar():
                kind = content.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
                data = STORE.serialize_cdr(content, kind)
                writer.write(connections[topic], arrival, data)
        return next(file for file in path.iterdir() if file.suffix != ".yaml")

    return write


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_recordings_that_are_cut_off(bag, plugin):
    file = bag(plugin)
    whole = file.read_bytes()
    read_recording(file.parent)
    for k in range(20):
        file.write_bytes(whole[: k * len(whole) // 20])
        refused(read_recording, file.parent)
        refused(load_clip, file.parent)


@pytest.mark.parametrize("change", ["points", "topology", "joints", "no joints"])
def test_recordings_whose_messages_do_not_fit(bag, change):
    messages = avatar()
    for topic, _, message in messages:
        if change == "points" and topic.endswith("points"):
            message.point_step = 4
        if change == "topology" and topic.endswith("topology"):
            message.triangles[0].vertex_indices[0] = 2**31
        if change == "joints" and topic.endswith("joint_states"):
            message.position = np.full(2, np.nan)
        if change == "no joints" and topic.endswith("joint_states"):
            message.name = message.name[:1]
    refused(read_recording, bag("MCAP", messages).parent)


def test_recordings_with_points_of_an_unknown_garment(bag):
    messages = [
        (topic.replace("skirt", "shirt") if topic.endswith("points") else topic, *rest)
        for topic, *rest in avatar()
    ]
    refused(read_recording, bag("MCAP", messages).parent, match="no topology")


def test_mcap_chunks_that_grow(tmp_path, bag):
    """Blocks of one byte that stand for 128 KiB each."""
    file = bag("MCAP")
    blocks = b"".join((2 << 0 | (2**17 << 3)).to_bytes(3, "little") + b"x" for _ in range(20_000))
    frame = struct.pack("<IB", 0xFD2FB528, 0xE0) + struct.pack("<Q", 20_000 * 2**17) + blocks
    chunk = struct.pack("<QQQI", 0, 1, 20_000 * 2**17, 0) + struct.pack("<I", 4) + b"zstd"
    chunk += struct.pack("<Q", len(frame)) + frame
    head = b"\x89MCAP0\r\n" + b"\x01" + struct.pack("<Q", 12) + struct.pack("<I", 4) + b"ros2"
    head += struct.pack("<I", 0)
    foot = b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + b"\x89MCAP0\r\n"
    file.write_bytes(head + b"\x06" + struct.pack("<Q", len(chunk)) + chunk + foot)
    refused(load_clip, file.parent, match="grow")
    refused(load_clip, file, match="grow")
    refused(read_recording, file.parent, match="grow")


def _zeros(size):
    """That many zero bytes, compressed."""
    return zstd.compress(bytes(2**20)) * (size // 2**20)


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_compressed_files_that_grow(bag, plugin):
    file = bag(plugin, compressed="FILE")
    assert file.suffix == ".zstd"
    file.write_bytes(_zeros(8 * 2**30))  # of 700 KB
    refused(load_clip, file.parent, match="grow")
    refused(read_recording, file.parent, match="grow")


def test_compressed_messages_that_grow(bag):
    file = bag("SQLITE3", compressed="MESSAGE")
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("UPDATE messages SET data = ?", (_zeros(2**30),))
    refused(load_clip, file.parent, match="grow")
    refused(read_recording, file.parent, match="grow")


@pytest.mark.parametrize(
    ("compressed", "words"), [("FILE", "has the ending"), ("MESSAGE", "not Zstandard")]
)
def test_what_is_not_compressed_as_it_says(bag, compressed, words):
    file = bag("SQLITE3")
    metadata = file.parent / "metadata.yaml"
    text = metadata.read_text()
    changed = text.replace("compression_format: ''", "compression_format: zstd")
    written(metadata, changed.replace("compression_mode: ''", f"compression_mode: {compressed}"))
    refused(load_clip, file.parent, match=words)
    written(metadata, changed.replace("compression_mode: ''", "compression_mode: lines"))
    refused(load_clip, file.parent, match="compression_mode 'lines'")
    changed = text.replace("compression_format: ''", "compression_format: lz4")
    written(metadata, changed.replace("compression_mode: ''", f"compression_mode: {compressed}"))
    refused(load_clip, file.parent, match="compression_format 'lz4'")


def test_an_index_that_names_a_chunk_many_times(bag):
    """Each time, the reader would unpack it again."""
    file = bag("MCAP")
    data = file.read_bytes()
    records, place = [], 8
    while place < len(data) - 8:
        kind, length = struct.unpack_from("<BQ", data, place)
        records.append((kind, data[place : place + 9 + length]))
        place += 9 + length
    index = next(record for kind, record in records if kind == 0x08)
    cut = data.index(index) + len(index)
    file.write_bytes(data[:cut] + index * 1000 + data[cut:])
    refused(load_clip, file, match="index names")


def test_databases_that_compute_what_they_show(bag):
    file = bag("SQLITE3")
    with sqlite3.connect(file) as database:
        database.execute("ALTER TABLE messages RENAME TO kept")
        database.execute(
            "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM "
            "n) SELECT i AS id, 1 AS topic_id, i AS timestamp, zeroblob(1000000) AS data FROM n"
        )
    database.close()
    refused(load_clip, file.parent, match="computes")
    refused(read_recording, file.parent, match="computes")


@pytest.mark.parametrize("name", ["../x.mcap", "/dev/zero", "metadata.yaml", "a\\nb.mcap", ""])
def test_metadata_that_names_other_files(tmp_path, name):
    metadata = f'rosbag2_bagfile_information: {{relative_file_paths: ["{name}"]}}\n'
    refused(load_clip, folder_with(tmp_path, metadata))


def signed(file):
    """A forged file with the digest that it should have."""
    file.write_bytes(file.read_bytes() + hashlib.sha256(file.read_bytes()).digest())


def test_cached_arrays_of_which_some_are_left_out(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    wanted = {"x": np.arange(20.0), "y": np.ones(3)}
    disk_cache.cached_arrays("f", "key", lambda: wanted)
    (file,) = tmp_path.rglob("*.npz")
    data = bytearray(file.read_bytes())
    end = data.rindex(b"PK\5\6")
    for count in (0, 1):
        data[end + 8 : end + 12] = struct.pack("<HH", count, count)
        file.write_bytes(data)
        assert disk_cache.cached_arrays("f", "key", lambda: wanted).keys() == wanted.keys()


@pytest.mark.parametrize("shape", ["(100000000000,)", "(3, 99999999999999999999)", "(-1,)", "()"])
def test_cached_arrays_with_a_forged_header(tmp_path, monkeypatch, shape):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    wanted = {"x": np.arange(20.0)}
    disk_cache.cached_arrays("f", "key", lambda: wanted)
    (file,) = tmp_path.rglob("*.npz")
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    forged = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + bytes(160)
    with zipfile.ZipFile(file, "w") as stored:
        stored.writestr("x.npy", forged)
    signed(file)
    found = disk_cache.cached_arrays("f", "key", lambda: wanted)
    np.testing.assert_array_equal(found["x"], wanted["x"])


def test_cached_arrays_that_are_packed(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    wanted = {"x": np.arange(20.0)}
    disk_cache.cached_arrays("f", "key", lambda: wanted)
    (file,) = tmp_path.rglob("*.npz")
    # Nothing packed is taken, whatever it holds: here it would be read and is another array.
    np.savez_compressed(file, x=np.zeros(20))
    signed(file)
    found = disk_cache.cached_arrays("f", "key", lambda: wanted)
    np.testing.assert_array_equal(found["x"], wanted["x"])
