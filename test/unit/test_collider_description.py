"""JSON of collider sets: canonical, bit for bit, and hostile input."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.colliders.description import (
    from_json,
    load_colliders,
    save_colliders,
    to_json,
)
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.errors import InputFileError, MessageError


def example_set():
    turned = np.array([0.1, -0.2, 0.3, 0.9])
    turned /= np.linalg.norm(turned)
    tetrahedron = {
        "vertices": np.array([[0.1, 0, 0], [0, 1 / 3, 0], [0, 0, 1], [-1, -1, -1.0]]),
        "faces": np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]], np.int32),
    }
    samples = np.arange(64, dtype=np.int16).reshape(4, 4, 4) + np.int16(1)
    samples[1:3, 1:3, 1:3] *= -1
    return ColliderSet(
        thickness=0.002,
        colliders=(
            Collider(name="frame_hips", kind="frame", bone="hips"),
            Collider(name="head", kind="sphere", bone="head", geometry={"radius": 0.1}),
            Collider(
                name="arm",
                kind="capsule",
                bone="arm",
                position=np.array([1 / 3, -0.0, 1e-17]),
                orientation=turned,
                geometry={"radius0": 0.05, "radius1": 0.04, "length": 0.3},
            ),
            Collider(
                name="belly",
                kind="ellipsoid",
                bone="hips",
                geometry={"radii": np.array([0.1, 0.2, 0.3])},
            ),
            Collider(name="chest", kind="hull", bone="chest", geometry=tetrahedron),
            Collider(
                name="shoulder",
                kind="sdf",
                bone="chest",
                geometry={"cell": 0.01, "step": 1 / 3e5, "distance": samples},
            ),
        ),
    )


def test_round_trip_is_bit_for_bit():
    original = example_set()
    text = to_json(original)
    back = from_json(text)
    assert to_json(back) == text
    assert back.revision == original.revision
    for a, b in zip(original.colliders, back.colliders):
        assert a.position.tobytes() == b.position.tobytes()
        assert a.orientation.tobytes() == b.orientation.tobytes()


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    position=st.tuples(*[st.floats(-1e6, 1e6) for _ in range(3)]),
    radius=st.floats(1e-9, 1e6),
    thickness=st.floats(0, 1),
    name=st.text(min_size=1, max_size=20).filter(lambda s: s.isprintable()),
)
def test_any_numbers_and_names_survive(position, radius, thickness, name):
    original = ColliderSet(
        thickness=thickness,
        colliders=(
            Collider(
                name=name,
                kind="sphere",
                bone=name,
                position=np.array(position),
                geometry={"radius": radius},
            ),
        ),
    )
    back = from_json(to_json(original))
    assert back.revision == original.revision
    assert back.colliders[0].position.tobytes() == original.colliders[0].position.tobytes()


def test_layout_is_the_published_one():
    document = json.loads(to_json(example_set()))
    assert list(document) == ["version", "revision", "frame_id", "thickness", "colliders"]
    assert document["colliders"][2]["pose_in_bone"].keys() == {"position", "orientation"}
    assert document["colliders"][0] == {
        "name": "frame_hips",
        "kind": "frame",
        "bone": "hips",
        "pose_in_bone": {"position": [0, 0, 0], "orientation": [0, 0, 0, 1]},
        "geometry": {},
    }


def mutated(path, value):
    document = json.loads(to_json(example_set()))
    target = document
    for key in path[:-1]:
        target = target[key]
    if value is None:
        del target[path[-1]]
    else:
        target[path[-1]] = value
    return json.dumps(document)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (["version"], 2),
        (["version"], True),
        (["revision"], "0" * 64),
        (["revision"], None),
        (["extra"], 1),
        (["frame_id"], ""),
        (["frame_id"], 3),
        (["thickness"], -1.0),
        (["thickness"], "0.1"),
        (["thickness"], 10**400),
        (["colliders"], {}),
        (["colliders"], [1]),
        (["colliders"], [{}] * 5000),
        (["colliders", 0, "kind"], "cube"),
        (["colliders", 0, "kind"], []),
        (["colliders", 0, "name"], "head"),
        (["colliders", 0, "name"], "n" * 300),
        (["colliders", 0, "bone"], None),
        (["colliders", 0, "geometry"], {"radius": 1.0}),
        (["colliders", 1, "geometry", "radius"], 0.0),
        (["colliders", 1, "geometry", "radius"], True),
        (["colliders", 1, "geometry", "radius"], [0.1]),
        (["colliders", 2, "geometry", "length"], -0.1),
        (["colliders", 2, "pose_in_bone", "position"], [0, 0]),
        (["colliders", 2, "pose_in_bone", "position"], [0, 0, "0"]),
        (["colliders", 2, "pose_in_bone", "position"], [0, 0, 1e300]),
        (["colliders", 2, "pose_in_bone", "orientation"], [0, 0, 0, 2]),
        (["colliders", 3, "geometry", "radii"], [0.1, 0.1, -0.1]),
        (["colliders", 4, "geometry", "faces"], [[0, 1, 2]] * 3 + [[0, 1, 4]]),
        (["colliders", 4, "geometry", "faces"], [[0, 1, 2]] * 3 + [[0, 1, -1]]),
        (["colliders", 4, "geometry", "faces"], [[0, 1, 2]] * 3 + [[0, 1, 1.5]]),
        (["colliders", 4, "geometry", "vertices"], [[0, 0, 0], [1, 0]]),
        (["colliders", 4, "geometry", "vertices"], []),
        (["colliders", 5, "geometry", "grid"], {"a": 1}),
    ],
)
def test_hostile_documents_are_rejected(path, value):
    with pytest.raises(MessageError, match="collider_description"):
        from_json(mutated(path, value))


@pytest.mark.parametrize(
    "path",
    [
        ["colliders", 2, "pose_in_bone", "position"],
        ["colliders", 3, "geometry", "radii"],
        ["colliders", 4, "geometry", "vertices"],
    ],
)
@pytest.mark.parametrize("number", [-(2**63), 2**63, 2**64 - 1, -(10**6) - 1, 1e300])
def test_numbers_too_large_are_rejected_under_their_own_revision(path, number):
    value = json.loads(to_json(example_set()))
    for key in path:
        value = value[key]
    value = [[number, 0, 0]] * 4 if isinstance(value[0], list) else [number, 1, 1]
    text = mutated(path, value)
    with pytest.raises(MessageError) as error:
        from_json(text)
    if "revision" in str(error.value):  # the geometry has passed
        revision = str(error.value).rpartition(" ")[2]
        document = json.loads(text)
        document["revision"] = revision
        from_json(json.dumps(document))
        pytest.fail(f"{number} was accepted")
    assert "magnitudes" in str(error.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "null",
        "[]",
        "{",
        "[" * 100_000,
        '{"version": NaN}',
        '{"version": 1, "version": 1}',
        to_json(ColliderSet(colliders=())).replace('"thickness":0.0', '"thickness":1e999'),
        '{"version": ' + "1" * 10_000 + "}",
    ],
)
def test_hostile_texts_are_rejected(text):
    with pytest.raises(MessageError):
        from_json(text)


def test_files(tmp_path):
    save_colliders(tmp_path / "c.json", example_set())
    assert load_colliders(tmp_path / "c.json").revision == example_set().revision
    for name, content in (("empty", b""), ("binary", b"\xff\xfe\x00"), ("list", b"[]")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputFileError, match=name):
            load_colliders(tmp_path / name)
    with pytest.raises(InputFileError):
        load_colliders(tmp_path / "missing.json")
