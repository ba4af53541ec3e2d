"""Reading serialized garments: right, and never trusting a byte."""

import contextlib
import struct

import numpy as np
import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2, PointField
from shape_msgs.msg import Mesh, MeshTriangle

from garment_sim_ros.errors import MessageError
from garment_sim_ros.ros.garment_conversions import figures_from, mesh_from, points_from
from garment_sim_ros.ros.serialize import PointCloud

X = np.arange(12, dtype=np.float32).reshape(4, 3) / 8
STAMP = 3 * 10**9 + 7


def mesh(vertices=X, triangles=((0, 1, 2), (1, 3, 2))):
    return serialize_message(
        Mesh(
            triangles=[MeshTriangle(vertex_indices=np.array(t, np.uint32)) for t in triangles],
            vertices=[Point(x=float(x), y=float(y), z=float(z)) for x, y, z in vertices],
        )
    )


def points(x=X, **changes):
    message = PointCloud2(
        height=1,
        width=len(x),
        fields=[
            PointField(name=n, offset=4 * k, datatype=PointField.FLOAT32, count=1)
            for k, n in enumerate("xyz")
        ],
        point_step=12,
        row_step=12 * len(x),
        data=np.asarray(x, np.float32).tobytes(),
        is_dense=True,
    )
    message.header.frame_id = "world"
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(STAMP, 10**9)
    for key, value in changes.items():
        setattr(message, key, value)
    return serialize_message(message)


def figures(**values):
    status = DiagnosticStatus(
        name="shirt", values=[KeyValue(key=k, value=v) for k, v in values.items()]
    )
    return serialize_message(DiagnosticArray(status=[status]))


def test_a_mesh():
    vertices, triangles = mesh_from(mesh())
    assert vertices == pytest.approx(X)
    assert triangles.tolist() == [[0, 1, 2], [1, 3, 2]]


@pytest.mark.parametrize("normals", [False, True])
def test_points_as_the_cloth_node_writes_them(normals):
    written = PointCloud(len(X), "world", normals=normals).fill(STAMP, X, X if normals else None)
    found = points_from(bytes(written), len(X))
    assert found.stamp == STAMP
    assert found.frame_id == "world"
    assert (found.points == X).all()


def test_points():
    assert (points_from(points(), len(X)).points == X).all()


def test_figures():
    stamp, found = figures_from(
        figures(step_ms="2.5", pierced_by="0", word="xpbd", none="nan", far="inf", long="1" * 100)
    )
    assert found == {"shirt": {"step_ms": 2.5, "pierced_by": 0.0}}
    assert stamp == 0


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (mesh(triangles=()), "length_mismatch"),
        (mesh(triangles=((0, 1, 4),)), "length_mismatch"),
        (mesh(triangles=((0, 1, 2**32 - 1),)), "length_mismatch"),
        (mesh(X * np.float32(np.nan)), "not_finite"),
        (mesh(X * np.float32(1e30)), "out_of_range"),
        (b"\0\1\0\0" + struct.pack("<I", 2**32 - 1), "malformed"),
        (b"\0\1\0\0" + struct.pack("<I", 2_000_000) + bytes(24_000_000), "too_many"),
        (b"", "malformed"),
        (b"\0\1\0\0", "malformed"),
        (b"\xff" * 64, "malformed"),
    ],
    # Padding of messages differs from process to process, which the names of tests may not.
    ids=lambda value: value if isinstance(value, str) else "message",
)
def test_a_mesh_that_cannot_be_used(message, reason):
    with pytest.raises(MessageError) as caught:
        mesh_from(message)
    assert caught.value.reason == reason


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"width": 5}, "length_mismatch"),
        ({"width": 2**32 - 1, "height": 2**32 - 1}, "length_mismatch"),
        ({"width": 0}, "length_mismatch"),
        ({"point_step": 0}, "length_mismatch"),
        ({"point_step": 2**32 - 1}, "length_mismatch"),
        ({"row_step": 1}, "length_mismatch"),
        ({"data": b"\0" * 47}, "length_mismatch"),
        ({"data": b""}, "length_mismatch"),
        ({"fields": []}, "malformed"),
        ({"is_bigendian": True}, "malformed"),
        ({"x": X + np.float32(np.inf)}, "not_finite"),
        ({"x": X * np.float32(1e7)}, "out_of_range"),
    ],
)
def test_points_that_cannot_be_used(changes, reason):
    with pytest.raises(MessageError) as caught:
        points_from(points(**changes), len(X))
    assert caught.value.reason == reason


def test_figures_of_too_many():
    status = DiagnosticStatus(values=[KeyValue(key="k", value="1")] * 300)
    with pytest.raises(MessageError, match="too_many: 300 values"):
        figures_from(serialize_message(DiagnosticArray(status=[status])))
    with pytest.raises(MessageError, match="too_many: 65 statuses"):
        figures_from(serialize_message(DiagnosticArray(status=[DiagnosticStatus()] * 65)))


@settings(max_examples=300, deadline=None)
@given(
    which=st.sampled_from(["mesh", "points", "figures"]),
    at=st.integers(0, 400),
    byte=st.integers(0, 255),
    cut=st.integers(0, 400),
)
def test_damaged_messages_are_used_or_rejected(which, at, byte, cut):
    whole = {"mesh": mesh(), "points": points(), "figures": figures(a="1", b="x")}[which]
    data = bytearray(whole)
    data[at % len(data)] = byte
    data = bytes(data[: len(data) - cut % 8])
    read = {
        "mesh": mesh_from,
        "points": lambda d: points_from(d, len(X)),
        "figures": figures_from,
    }[which]
    with contextlib.suppress(MessageError):
        read(data)
