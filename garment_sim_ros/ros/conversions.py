"""Serialized messages to arrays, every byte distrusted.

Reads what `cdr` writes and any other plain CDR encoder, in either byte order. A message that
cannot be used raises `MessageError` with one of the reasons below. Time and memory grow with a
message's size and no faster; counts are limited before anything is done for each.
"""

import struct
from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.errors import MessageError
from garment_sim_ros.stamps import SECOND

MALFORMED = "malformed"
STAMP_INVALID = "stamp_invalid"
LENGTH_MISMATCH = "length_mismatch"
NOT_FINITE = "not_finite"
OUT_OF_RANGE = "out_of_range"
NOT_UNIT = "orientation_not_unit"
TOO_MANY = "too_many"

MAX_NAMES = 4096
MAX_POSES = 4096
MAX_TEXT = 16 * 2**20
"""Longest text of a message that is one [bytes]."""
MAX_NAME = 1024
"""Longest name in a message [bytes]."""

LARGEST = 1e6
"""Largest magnitude of a position [m] or channel value [m or rad]."""
_UNIT_TOLERANCE = 1e-2


@dataclass(frozen=True, kw_only=True)
class StampedJoints:
    """A JointState.

    Attributes:
        stamp: Its time [ns], 0 where the sender gave none.
        names: Channel names.
        values: Their values [rad or m], shape [n].
    """

    stamp: int
    names: tuple[str, ...]
    values: FloatArray


@dataclass(frozen=True, kw_only=True)
class StampedPoses:
    """A PoseArray.

    Attributes:
        stamp: Its time [ns].
        frame_id: Frame of the poses.
        poses: Finite positions, orientations of unit length.
    """

    stamp: int
    frame_id: str
    poses: ColliderPoses


class Cursor:
    """Reads numbers and text from the front of serialized bytes."""

    def __init__(self, data: bytes) -> None:
        if len(data) < 4 or data[0] != 0 or data[1] > 1:
            raise MessageError(MALFORMED, f"{len(data)} bytes that are not plain CDR")
        self.data = data
        self.at = 4
        self.order = "<" if data[1] else ">"
        self._word = struct.Struct(self.order + "I")

    def take(self, size: int, alignment: int) -> int:
        """Offset of the next `size` bytes, which are then behind."""
        start = self.at + -(self.at - 4) % alignment
        if start + size > len(self.data):
            raise MessageError(MALFORMED, f"ends after {len(self.data)} bytes")
        self.at = start + size
        return start

    def word(self) -> int:
        """An unsigned number of 4 bytes."""
        start = self.take(4, 4)
        return int(self._word.unpack_from(self.data, start)[0])

    def count(self, size: int, most: int, what: str) -> int:
        """A count of things of at least `size` bytes each that follow."""
        count = self.word()
        if size * count > len(self.data):
            raise MessageError(MALFORMED, f"{count} {what} in {len(self.data)} bytes")
        if count > most:
            raise MessageError(TOO_MANY, f"{count} {what}; allowed: up to {most}")
        return count

    def text(self, longest: int = MAX_NAME) -> str:
        """A string."""
        size = self.count(1, longest + 1, "bytes of text")
        start = self.take(size, 1)
        raw = self.data[start : start + size]
        try:
            return (raw[:-1] if raw.endswith(b"\0") else raw).decode()
        except UnicodeDecodeError:
            raise MessageError(MALFORMED, "text that is not UTF-8") from None

    def doubles(self, count: int) -> FloatArray:
        """That many float64, copied."""
        if count == 0:
            return np.zeros(0)
        start = self.take(8 * count, 8)
        return np.frombuffer(self.data, self.order + "f8", count, start).astype(np.float64)

    def stamp(self) -> int:
        """A time [ns]."""
        seconds, nanoseconds = struct.unpack_from(self.order + "iI", self.data, self.take(8, 4))
        if seconds < 0 or nanoseconds >= SECOND:
            raise MessageError(
                STAMP_INVALID, f"{seconds} s, {nanoseconds} ns; allowed: from 0, below 1e9 ns"
            )
        return int(seconds * SECOND + nanoseconds)


def text_from(data: bytes, longest: int = MAX_TEXT) -> str:
    """The text of a std_msgs/String of at most so many bytes.

    Raises:
        MessageError: Malformed, or longer.
    """
    return Cursor(data).text(longest)


def poses_from(data: bytes) -> StampedPoses:
    """A geometry_msgs/PoseArray.

    Raises:
        MessageError: Malformed, not finite, too far away, too many, or orientations that are not
            of unit length within 1 %.
    """
    cursor = Cursor(data)
    stamp, frame_id, count = cursor.stamp(), cursor.text(), cursor.count(56, MAX_POSES, "poses")
    table = cursor.doubles(7 * count).reshape(count, 7)
    _check_range(table, "poses")
    orientation = table[:, 3:].copy()
    length = np.sqrt(np.einsum("nk,nk->n", orientation, orientation))
    wrong = np.abs(length - 1.0) > _UNIT_TOLERANCE
    if wrong.any():
        i = int(np.argmax(wrong))
        raise MessageError(NOT_UNIT, f"pose {i} has an orientation of length {length[i]:.4g}")
    orientation /= length[:, None]
    return StampedPoses(
        stamp=stamp,
        frame_id=frame_id,
        poses=ColliderPoses(position=table[:, :3].copy(), orientation=orientation),
    )


class JointStates:
    """Reads JointState messages; remembers the bytes of the names, which hardly ever change."""

    def __init__(self) -> None:
        self._seen = b""
        self._names: tuple[str, ...] = ()

    def read(self, data: bytes) -> StampedJoints:
        """A sensor_msgs/JointState.

        Raises:
            MessageError: Malformed, as many positions as there are not names, not finite, or far
                too large.
        """
        cursor = Cursor(data)
        stamp = cursor.stamp()
        cursor.text()
        start = cursor.take(0, 4)
        if self._seen and data.startswith(self._seen, start):
            cursor.at = start + len(self._seen)
        else:
            count = cursor.count(4, MAX_NAMES, "names")
            names = tuple(cursor.text() for _ in range(count))
            self._names, self._seen = names, data[start : cursor.at]
        count = cursor.word()
        if count != len(self._names):
            raise MessageError(LENGTH_MISMATCH, f"{count} positions for {len(self._names)} names")
        values = cursor.doubles(count)
        _check_range(values, "positions")
        return StampedJoints(stamp=stamp, names=self._names, values=values)


def _check_range(values: FloatArray, what: str) -> None:
    size = np.abs(values).max(initial=0.0)
    if not np.isfinite(size):
        raise MessageError(NOT_FINITE, f"{what} that are NaN or infinite")
    if size > LARGEST:
        raise MessageError(OUT_OF_RANGE, f"{what} of size {size:.3g}; allowed: to {LARGEST:g}")
