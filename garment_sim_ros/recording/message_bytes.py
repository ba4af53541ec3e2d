"""Messages of which a recording has many, read from their bytes.

The general reader makes an object of every pose and of every word of `quality`, which takes most
of the time in which a recording is opened. (Common Data Representation: OMG, DDS-XTypes 1.3,
7.4.1, "plain CDR" version 1, as ROS 2 uses it.)
"""

import struct
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.stamps import SECOND

_ENCAPSULATION = 4  # bytes before the first one, from which alignment counts
_POSE = 7
"""Numbers of a pose: x, y, z, then the quaternion x, y, z, w."""


class PoseArray(NamedTuple):
    """A geometry_msgs/PoseArray.

    Attributes:
        stamp: Time of its header [ns].
        poses: Positions and quaternions (x, y, z, w), shape [n, 7].
    """

    stamp: int
    poses: FloatArray


class Diagnostics(NamedTuple):
    """A diagnostic_msgs/DiagnosticArray.

    Attributes:
        stamp: Time of its header [ns].
        status: Name of each status, with its keys and values.
    """

    stamp: int
    status: list[tuple[str, list[tuple[str, str]]]]


class _Bytes:
    """What is left of a message; every read that goes beyond its end raises `ValueError`."""

    def __init__(self, data: bytes) -> None:
        if len(data) < _ENCAPSULATION:
            raise ValueError("no message")
        self.order = "<" if data[1] & 1 else ">"
        self._data, self._at = data[_ENCAPSULATION:], 0
        self._count = struct.Struct(self.order + "I")

    def count(self) -> int:
        """A uint32."""
        at = -(-self._at // 4) * 4
        self._at = at + 4
        if self._at > len(self._data):
            raise ValueError("ends early")
        (value,) = self._count.unpack_from(self._data, at)
        return int(value)

    def text(self) -> str:
        """A string."""
        size = self.count()
        at, self._at = self._at, self._at + size
        if not size or self._at > len(self._data):
            raise ValueError("ends early")
        return self._data[at : self._at - 1].decode()

    def skip(self, size: int) -> None:
        """Leave out some bytes."""
        self._at += size

    def stamp(self) -> int:
        """The time of a header, whose frame is read, too."""
        seconds = self.count()
        seconds -= (seconds & 1 << 31) << 1  # an int32
        time = seconds * SECOND + self.count()
        self.text()
        return time

    def doubles(self, count: int) -> FloatArray:
        """So many float64."""
        at = -(-self._at // 8) * 8 if count else self._at
        self._at = at + 8 * count
        found = np.frombuffer(self._data, self.order + "f8", count, at) if count else np.zeros(0)
        return found.astype(np.float64)


def read_poses(data: bytes) -> PoseArray:
    """A PoseArray from its bytes.

    Raises:
        ValueError: It ends early.
    """
    left = _Bytes(data)
    stamp = left.stamp()
    return PoseArray(stamp, left.doubles(_POSE * left.count()).reshape(-1, _POSE))


def read_diagnostics(data: bytes) -> Diagnostics:
    """A DiagnosticArray from its bytes.

    Raises:
        ValueError: It ends early, or has words that are no UTF-8.
    """
    left, status = _Bytes(data), []
    stamp = left.stamp()
    for _ in range(left.count()):
        left.skip(1)  # the level
        name, _message, _hardware = left.text(), left.text(), left.text()
        status.append((name, [(left.text(), left.text()) for _ in range(left.count())]))
    return Diagnostics(stamp, status)
