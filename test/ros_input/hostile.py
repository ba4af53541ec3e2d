"""Hostile messages, and a thread that sends a thousand of whatever a second."""

import struct
import threading
import time

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_POSES,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
)

SECOND = 10**9
PERIOD = SECOND // 1000
"""Time between two messages [ns]."""


class Sender(threading.Thread):
    """Sends at 1 kHz until it is ended; what is late is sent at once."""

    def __init__(self, send):
        super().__init__(daemon=True)
        self._send = send
        self._ended = threading.Event()
        self.sent = 0

    def run(self):
        due = time.monotonic_ns()
        while not self._ended.is_set():
            self._send(self.sent)
            self.sent += 1
            due += PERIOD
            self._ended.wait(max(0, due - time.monotonic_ns()) / SECOND)

    def end(self):
        self._ended.set()
        self.join()


def hostile_messages(stamp, clip):
    """One of each kind, for a time [ns]: topic and message."""
    header = Header(stamp=Time(sec=stamp // SECOND, nanosec=stamp % SECOND), frame_id="world")
    names, zeros = list(clip.rig.dofs.names), [0.0] * len(clip.rig.dofs.names)
    many = [f"joint_{i}" for i in range(4000)]
    pose = Pose(orientation=Quaternion(w=1.0))
    far = Pose(position=Point(x=float("nan")))
    mimics = "".join(
        f"<link name='l{i}'/><joint name='j{i}' type='revolute'><parent link='l{i}'/>"
        f"<child link='l{i + 1}'/><mimic joint='j{(i + 1) % 400}'/></joint>"
        for i in range(400)
    )
    circle = f"<robot name='r'>{mimics}<link name='l400'/></robot>"
    poses = bytearray(serialize_message(PoseArray(header=header, poses=[pose] * 20)))
    struct.pack_into("<I", poses, 24, 2**32 - 1)
    return [
        (JOINT_STATES, JointState(header=header, name=names, position=[1e300, *zeros[1:]])),
        (JOINT_STATES, JointState(header=header, name=names, position=zeros)),
        (JOINT_STATES, JointState(header=header, name=[*many, "joint_7"], position=[0.0] * 4001)),
        (JOINT_STATES, JointState(header=header, name=many * 2, position=[0.0] * 8000)),
        (JOINT_STATES, b"\0\1\0\0\xff\xff"),
        (ROBOT_DESCRIPTION, String(data=circle)),
        (ROBOT_DESCRIPTION, String(data="<robot" * 1000)),
        (COLLIDER_POSES, PoseArray(header=header, poses=[pose] * 20)),
        (COLLIDER_POSES, PoseArray(header=header, poses=[far] * 20)),
        (COLLIDER_POSES, PoseArray(header=header, poses=[pose] * 5000)),
        (COLLIDER_POSES, bytes(poses)),
        (COLLIDER_DESCRIPTION, String(data="[" * 100_000)),
        (COLLIDER_DESCRIPTION, String(data='{"version": 1, "colliders": [-9223372036854775808]}')),
    ]
