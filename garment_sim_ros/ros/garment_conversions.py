"""Serialized messages about garments to arrays, every byte distrusted; see `conversions`."""

import math
from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.errors import MessageError
from garment_sim_ros.ros.conversions import (
    LARGEST,
    LENGTH_MISMATCH,
    MALFORMED,
    NOT_FINITE,
    OUT_OF_RANGE,
    Cursor,
)

MAX_VERTICES = 1_000_000
MAX_TRIANGLES = 1_000_000
MAX_FIELDS = 64
MAX_STATUSES = 64
MAX_VALUES = 256
_LONGEST_NUMBER = 64
_FLOAT32 = 7
"""`datatype` of a PointField."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StampedPoints:
    """A PointCloud2.

    Attributes:
        stamp: Its time [ns].
        frame_id: Frame of the points.
        points: Finite [m], shape [n, 3].
    """

    stamp: int
    frame_id: str
    points: SingleArray


def mesh_from(data: bytes) -> tuple[FloatArray, IntArray]:
    """Vertices [m], shape [v, 3], and triangles, shape [t, 3], of a shape_msgs/Mesh.

    Raises:
        MessageError: Malformed, without a triangle, too large, not finite, or with triangles on
            vertices that there are not.
    """
    cursor = Cursor(data)
    count = cursor.count(12, MAX_TRIANGLES, "triangles")
    start = cursor.take(12 * count, 4)
    corners = np.frombuffer(data, cursor.order + "u4", 3 * count, start).reshape(-1, 3)
    vertices = cursor.doubles(3 * cursor.count(24, MAX_VERTICES, "vertices")).reshape(-1, 3)
    _check(vertices)
    if not count or corners.max() >= len(vertices):
        raise MessageError(
            LENGTH_MISMATCH, f"{count} triangles on vertices beyond {len(vertices)}, or none"
        )
    return vertices, corners.astype(np.int32)


def points_from(data: bytes, expected: int) -> StampedPoints:
    """A sensor_msgs/PointCloud2 that begins with x, y and z as float32, little endian.

    Args:
        data: The message.
        expected: How many points there have to be.

    Raises:
        MessageError: Malformed, another number of points, or points that are not finite or too
            far away.
    """
    cursor = Cursor(data)
    stamp, frame_id = cursor.stamp(), cursor.text()
    height, width = cursor.word(), cursor.word()
    fields = []
    for _ in range(cursor.count(13, MAX_FIELDS, "fields")):
        name, offset = cursor.text(), cursor.word()
        datatype = data[cursor.take(1, 1)]
        fields.append((name, offset, datatype, cursor.word()))
    big = data[cursor.take(1, 1)]
    step, row = cursor.word(), cursor.word()
    if fields[:3] != [(axis, 4 * k, _FLOAT32, 1) for k, axis in enumerate("xyz")] or big:
        raise MessageError(MALFORMED, "points that do not begin with float32 x y z")
    if width * height != expected:
        raise MessageError(LENGTH_MISMATCH, f"{width * height} points; expected: {expected}")
    size = cursor.word()
    if step < 12 or size != step * expected or row != step * width:
        raise MessageError(LENGTH_MISMATCH, f"{size} bytes for {expected} points of {step}")
    start = cursor.take(size, 1)
    rows = np.frombuffer(data, np.uint8, size, start).reshape(expected, step)
    points = np.ascontiguousarray(rows[:, :12]).view("<f4").astype(np.float32)
    _check(points)
    return StampedPoints(stamp=stamp, frame_id=frame_id, points=points)


def figures_from(data: bytes) -> tuple[int, dict[str, dict[str, float]]]:
    """Time [ns], and finite numbers by name and key, of a diagnostic_msgs/DiagnosticArray.

    Raises:
        MessageError: Malformed, or with more than can be of an avatar.
    """
    cursor = Cursor(data)
    stamp = cursor.stamp()
    cursor.text()
    figures: dict[str, dict[str, float]] = {}
    for _ in range(cursor.count(17, MAX_STATUSES, "statuses")):
        cursor.take(1, 1)
        own = figures.setdefault(cursor.text(), {})
        cursor.text()
        cursor.text()
        for _ in range(cursor.count(8, MAX_VALUES, "values")):
            key, value = cursor.text(), cursor.text()
            if (number := _number(value)) is not None:
                own[key] = number
    return stamp, figures


def _number(text: str) -> float | None:
    """A finite number, None where the text is none."""
    if len(text) > _LONGEST_NUMBER:
        return None
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _check(points: FloatArray | SingleArray) -> None:
    size = np.abs(points).max(initial=0.0)
    if not np.isfinite(size):
        raise MessageError(NOT_FINITE, "points that are NaN or infinite")
    if size > LARGEST:
        raise MessageError(OUT_OF_RANGE, f"points up to {size:.3g}; allowed: to {LARGEST:g} m")
