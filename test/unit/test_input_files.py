"""What every reader does with names and files that it must not even open."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from garment_sim_ros import disk_cache
from garment_sim_ros.body.humanoid import load_humanoid_overrides
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.description import load_colliders
from garment_sim_ros.errors import InputFileError, ParameterError, one_line
from garment_sim_ros.garment.mesh import load_garment_mesh
from garment_sim_ros.garment.outfit_file import read_outfit
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.recording.bags import read_recording

READERS = {
    **{f"body.{kind}": load_body for kind in ("glb", "gltf", "vrm", "urdf", "xml", "obj", "ply")},
    **{f"cloth.{kind}": load_garment_mesh for kind in ("obj", "ply", "glb", "gltf")},
    **{f"clip.{kind}": load_clip for kind in ("bvh", "mcap", "db3")},
    "clip": load_clip,
    "recording": read_recording,
    "recording.mcap": read_recording,
    "outfit.yaml": read_outfit,
    "bones.yaml": load_humanoid_overrides,
    "colliders.json": load_colliders,
}


@pytest.fixture(autouse=True)
def _ends():
    """A reader that waits for ever fails its test."""

    def stop(*_):
        raise TimeoutError("still reading")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, 20.0)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


def pipe(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    os.mkfifo(path)
    return path


def device(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.symlink_to("/dev/zero")
    return path


def folder(path):
    path.mkdir(parents=True)
    return path


NAMES = {
    "pipe": pipe,
    "device": device,
    "folder": folder,
    "missing": lambda path: path,
    "zero byte": lambda path: f"{path.parent}/a\0b{path.name}",
    "long": lambda path: f"{path.parent}/{'x' * 5000}{path.name}",
    "long way": lambda path: f"{path.parent}/{'x/' * 3000}{path.name}",
    "surrogate": lambda path: f"{path.parent}/\ud800{path.name}",
    "lines": lambda path: f"{path.parent}/a\nb\x1b[31m{path.name}",
}


@pytest.mark.parametrize("kind", NAMES)
@pytest.mark.parametrize("name", READERS)
def test_what_is_no_file_is_one_line(tmp_path, name, kind):
    with pytest.raises(InputFileError) as error:
        READERS[name](NAMES[kind](tmp_path / name))
    assert str(error.value).isprintable()
    assert len(str(error.value)) < 2000


@pytest.mark.parametrize("kind", [pipe, device, folder])
def test_files_beside_a_file_are_opened_as_carefully(tmp_path, kind):
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(
        '<robot name="r"><link name="a"><visual><geometry><mesh filename="m.stl"/>'
        "</geometry></visual></link></robot>"
    )
    kind(tmp_path / "m.stl")
    gltf = tmp_path / "body.gltf"
    gltf.write_text(
        '{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0, "skin": 0}], "skins": [{"joints": '
        '[0]}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "accessors": '
        '[{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}], "bufferViews": '
        '[{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": "b.bin"}]}'
    )
    kind(tmp_path / "b.bin")
    human = tmp_path / "human"
    human.mkdir()
    (human / "body.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    kind(human / "rig.mhskel")
    (human / "weights.mhw").write_text("{}")
    for path in (urdf, gltf, human / "body.obj"):
        with pytest.raises(InputFileError):
            load_body(path)


@pytest.mark.parametrize("read", [load_clip, read_recording])
@pytest.mark.parametrize("kind", [pipe, device, folder])
def test_files_of_a_recording_are_opened_as_carefully(tmp_path, read, kind):
    kind(tmp_path / "metadata.yaml")
    with pytest.raises(InputFileError):
        read(tmp_path)


@pytest.mark.parametrize("read", [load_clip, read_recording])
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_storage_of_a_recording_is_opened_as_carefully(tmp_path, read, storage):
    name = f"a.{'mcap' if storage == 'mcap' else 'db3'}"
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {version: 9, storage_identifier: "
        f"{storage}, relative_file_paths: [{name}], duration: {{nanoseconds: 0}}, starting_time: "
        "{nanoseconds_since_epoch: 0}, message_count: 1, topics_with_message_count: []}\n"
    )
    pipe(tmp_path / name)
    with pytest.raises(InputFileError, match="is a pipe"):
        read(tmp_path)


@pytest.mark.parametrize("kind", [pipe, device, folder])
def test_a_cache_that_is_no_file_only_costs_time(tmp_path, monkeypatch, kind):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    wanted = {"x": np.arange(3)}
    disk_cache.cached_arrays("f", "key", lambda: wanted)
    (file,) = tmp_path.rglob("*.npz")
    file.unlink()
    kind(file)
    found = disk_cache.cached_arrays("f", "key", lambda: wanted)
    np.testing.assert_array_equal(found["x"], wanted["x"])


def test_files_larger_than_allowed_are_not_read(tmp_path):
    for name, read in READERS.items():
        if Path(name).suffix:
            with open(tmp_path / name, "wb") as file:
                file.truncate(5 * 2**30)  # takes no room
            with pytest.raises(InputFileError, match=r"allowed: at most \d+ bytes"):
                read(tmp_path / name)


def test_messages_are_one_line_that_can_be_printed():
    for text in ("a\nb", "a\r\n\tb", "a\x1b[31mb", "a\u2028b", "a\ud800b", "a\0b"):
        for error in (InputFileError(text, text, text), ParameterError(text, text, text)):
            assert str(error).isprintable()
            str(error).encode()
    assert one_line("a\nb") == "a\\nb"
    assert one_line("\N{GREEK SMALL LETTER MU}") == "\N{GREEK SMALL LETTER MU}"
    assert len(str(InputFileError("x" * 10**6, "y" * 10**6))) < 5000
