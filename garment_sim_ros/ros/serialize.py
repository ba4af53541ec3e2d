"""Messages as serialized bytes: a prepared buffer in which only numbers change.

Making a Marker of 15,000 `Point` objects takes tens of milliseconds; writing its bytes takes some
ten microseconds. Each template is a normal message, serialized once with a mark in every place
that will change; the marks are found and overwritten from then on. So nothing here knows the
layout of a message, only that of a stamp and of numbers in a row.
"""

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, Quaternion
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.jit import kernel
from garment_sim_ros.ros.cdr import encode
from garment_sim_ros.stamps import SECOND

_MARK = b"\xa5"
_STAMP_SIZE = 8
_POSE_SIZE = 56
_SCALE_SIZE = 24
_MARKED_NUMBER = struct.unpack("<d", _MARK * 8)[0]
_MARKED_TIME = Time(**dict(zip(("sec", "nanosec"), struct.unpack("<iI", _MARK * _STAMP_SIZE))))


def _marked_pose() -> Pose:
    n = _MARKED_NUMBER
    return Pose(position=Point(x=n, y=n, z=n), orientation=Quaternion(x=n, y=n, z=n, w=n))


class _Template:
    """A serialized message with places to write to.

    Args:
        message: A message that has marks in these places, or its bytes.
        sizes: Lengths of the places in the order of the message [bytes].
    """

    def __init__(self, message: Any, sizes: Sequence[int]) -> None:
        data = message if isinstance(message, bytes) else encode(message)
        offsets, end = [], 0
        for size in sizes:
            offsets.append(data.index(_MARK * size, end))
            end = offsets[-1] + size
        # CDR aligns numbers counting from its 4-byte head; compiled loops want aligned addresses.
        largest = offsets[int(np.argmax(sizes))]
        room = np.empty(len(data) + 8, np.uint8)
        shift = -(room.ctypes.data + largest) % 8
        self._bytes = room[shift : shift + len(data)]
        self._bytes[:] = np.frombuffer(data, np.uint8)
        self._places = [self._bytes[o : o + size] for o, size in zip(offsets, sizes)]

    def _numbers(self, place: int, dtype: type, columns: int) -> NDArray[Any]:
        """A place as an array of numbers, shape [n, columns]."""
        return self._places[place].view(dtype).reshape(-1, columns)

    def _write_stamp(self, place: int, stamp: int) -> None:
        struct.pack_into("<iI", self._places[place], 0, stamp // SECOND, stamp % SECOND)


class PointCloud(_Template):
    """PointCloud2 of float32 x y z, then normal_x normal_y normal_z where asked.

    Args:
        count: Number of points.
        frame_id: Their frame.
        normals: Whether there are normals.
    """

    def __init__(self, count: int, frame_id: str, *, normals: bool = False) -> None:
        names = ["x", "y", "z"] + ["normal_x", "normal_y", "normal_z"] * normals
        message = PointCloud2(height=1, width=count, point_step=4 * len(names), is_dense=True)
        message.header.stamp = _MARKED_TIME
        message.header.frame_id = frame_id
        message.fields = [
            PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1)
            for i, name in enumerate(names)
        ]
        message.row_step = message.point_step * count
        message.data = _MARK * message.row_step
        super().__init__(message, (_STAMP_SIZE, message.row_step))
        self._points = self._numbers(1, np.float32, len(names))

    def fill(self, stamp: int, x: SingleArray, normal: SingleArray | None = None) -> bytes:
        """The message at a time [ns] for points and, where declared, unit normals, [n, 3]."""
        self._write_stamp(0, stamp)
        self._points[:, :3] = x
        if normal is not None:
            self._points[:, 3:] = normal
        return self._bytes.tobytes()


class TriangleMarker(_Template):
    """A TRIANGLE_LIST Marker in one colour.

    Args:
        triangles: Vertex indices, shape [t, 3].
        frame_id: Frame of the vertices.
        namespace: The marker's `ns`.
        colour: Red, green, blue, opacity from 0 to 1.
    """

    def __init__(
        self,
        triangles: IntArray,
        frame_id: str,
        namespace: str,
        colour: tuple[float, float, float, float],
    ) -> None:
        n = _MARKED_NUMBER
        message = Marker(type=Marker.TRIANGLE_LIST, action=Marker.ADD, ns=namespace)
        message.header.stamp = _MARKED_TIME
        message.header.frame_id = frame_id
        message.pose.orientation.w = 1.0
        message.scale.x = message.scale.y = message.scale.z = 1.0
        message.color = ColorRGBA(**dict(zip("rgba", colour)))
        message.points = [Point(x=n, y=n, z=n)] * triangles.size
        super().__init__(message, (_STAMP_SIZE, 24 * triangles.size))
        self._triangles = np.array(triangles, dtype=np.int32, order="C")
        self._corners = self._numbers(1, np.float64, 3)

    def fill(self, stamp: int, x: SingleArray) -> bytes:
        """The message at a time [ns] for vertices, shape [v, 3], float32."""
        self._write_stamp(0, stamp)
        _expand(x, self._triangles, self._corners)
        return self._bytes.tobytes()


class Poses(_Template):
    """PoseArray.

    Args:
        count: Number of poses.
        frame_id: Their frame.
    """

    def __init__(self, count: int, frame_id: str) -> None:
        message = PoseArray(poses=[_marked_pose()] * count)
        message.header.stamp = _MARKED_TIME
        message.header.frame_id = frame_id
        super().__init__(message, (_STAMP_SIZE, _POSE_SIZE * count))
        self._poses = self._numbers(1, np.float64, 7)

    def fill(self, stamp: int, poses: ColliderPoses) -> bytes:
        """The message at a time [ns]."""
        self._write_stamp(0, stamp)
        self._poses[:, :3] = poses.position
        self._poses[:, 3:] = poses.orientation
        return self._bytes.tobytes()


class _OnePose(_Template):
    """A message with one stamp and one pose behind it."""

    def __init__(self, message: Any) -> None:
        super().__init__(message, (_STAMP_SIZE, _POSE_SIZE))
        self._pose = self._numbers(1, np.float64, 7)[0]

    def fill(self, stamp: int, position: FloatArray, orientation: FloatArray) -> bytes:
        """The message at a time [ns] for a position [m] and a unit quaternion."""
        self._write_stamp(0, stamp)
        self._pose[:3] = position
        self._pose[3:] = orientation
        return self._bytes.tobytes()


class StampedPose(_OnePose):
    """PoseStamped in the frame `frame_id`."""

    def __init__(self, frame_id: str) -> None:
        message = PoseStamped(pose=_marked_pose())
        message.header.stamp = _MARKED_TIME
        message.header.frame_id = frame_id
        super().__init__(message)


class RootFrame(_OnePose):
    """TFMessage with one transform.

    Its type need not be installed: the bytes are made from its definition.

    Args:
        parent: Frame in which the transform is.
        child: Frame that is placed.
    """

    def __init__(self, parent: str, child: str) -> None:
        types = get_typestore(Stores.ROS2_JAZZY)
        made = {name.rpartition("/")[2]: kind for name, kind in types.types.items()}
        n = _MARKED_NUMBER
        stamp = made["Time"](sec=_MARKED_TIME.sec, nanosec=_MARKED_TIME.nanosec)
        transform = made["TransformStamped"](
            header=made["Header"](stamp=stamp, frame_id=parent),
            child_frame_id=child,
            transform=made["Transform"](
                translation=made["Vector3"](x=n, y=n, z=n),
                rotation=made["Quaternion"](x=n, y=n, z=n, w=n),
            ),
        )
        message = made["TFMessage"](transforms=[transform])
        data = bytes(types.serialize_cdr(message, "tf2_msgs/msg/TFMessage"))
        super().__init__(data)


class Joints(_Template):
    """JointState with positions only.

    Args:
        names: Channel names.
        frame_id: Frame in its header.
    """

    def __init__(self, names: Sequence[str], frame_id: str) -> None:
        message = JointState(name=list(names), position=[_MARKED_NUMBER] * len(names))
        message.header.stamp = _MARKED_TIME
        message.header.frame_id = frame_id
        super().__init__(message, (_STAMP_SIZE, 8 * len(names)))
        self._values = self._numbers(1, np.float64, 1)[:, 0]

    def fill(self, stamp: int, values: FloatArray) -> bytes:
        """The message at a time [ns] for channel values [rad or m], shape [d]."""
        self._write_stamp(0, stamp)
        self._values[:] = values
        return self._bytes.tobytes()


class PosedMarkers(_Template):
    """MarkerArray of which only the stamps, poses and scales change.

    Args:
        markers: The markers; their stamps and poses are overwritten.
        index: Which of the poses given to `fill` each marker takes, shape [m].

    Attributes:
        scale: Scale of each marker, as given at first; may be written to, m arrays of shape [3].
    """

    def __init__(self, markers: Sequence[Marker], index: IntArray) -> None:
        scales = [(m.scale.x, m.scale.y, m.scale.z) for m in markers]
        for marker in markers:
            marker.header.stamp = _MARKED_TIME
            marker.pose = _marked_pose()
            marker.scale.x = marker.scale.y = marker.scale.z = _MARKED_NUMBER
        super().__init__(
            MarkerArray(markers=list(markers)),
            (_STAMP_SIZE, _POSE_SIZE + _SCALE_SIZE) * len(markers),
        )
        numbers = [self._numbers(2 * i + 1, np.float64, 10)[0] for i in range(len(markers))]
        self._index = index
        self._marker_poses = [n[:7] for n in numbers]
        self.scale = [n[7:] for n in numbers]
        for own, given in zip(self.scale, scales):
            own[:] = given

    def fill(self, stamp: int, poses: ColliderPoses) -> bytes:
        """The message at a time [ns]."""
        for i, pose in enumerate(self._marker_poses):
            self._write_stamp(2 * i, stamp)
            pose[:3] = poses.position[self._index[i]]
            pose[3:] = poses.orientation[self._index[i]]
        return self._bytes.tobytes()


@kernel()
def _expand(x, triangles, corners):
    """Positions of the three corners of every triangle, in a row."""
    for t in range(triangles.shape[0]):
        for c in range(3):
            v = triangles[t, c]
            for k in range(3):
                corners[3 * t + c, k] = x[v, k]
