"""Poses for cloth_node, sent at a fixed rate, and its messages read."""

import struct
import time

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.capsules.capsules import fit_capsules
from garment_sim_ros.colliders.description import to_json
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.ros.serialize import Poses
from garment_sim_ros.ros.topics import COLLIDER_POSES

NAMESPACE = "/cloth_test"


SECOND = 10**9


RATE = 60.0


INPUT_PERIOD = SECOND // 100


GARMENTS = ("skirt", "shirt")


OUTFIT = """
version: 1
garments:
  - {name: skirt, generator: short_skirt, options: {vertices: 500}}
  - {name: shirt, generator: tshirt, options: {vertices: 500}}
"""


def stamp_of(data):
    """Stamp [ns] of a serialized message that begins with a header."""
    seconds, rest = struct.unpack_from("<iI", data, 4)
    return seconds * SECOND + rest


def points_of(data):
    """Positions in a serialized PointCloud2, shape [v, 3]."""
    message = deserialize_message(data, PointCloud2)
    return np.frombuffer(bytes(message.data), np.float32).reshape(message.width, -1)


class Avatar:
    """A mannequin's colliders, swaying."""

    def __init__(self, delta=0.0):
        self.body = load_body("mannequin")
        self.colliders = fit_capsules(self.body, delta=delta)
        self.description = String(data=to_json(self.colliders))
        poser = ColliderPoser(self.colliders, self.body)
        self.rest = poser.poses(rest_transforms(self.body.rig)).copy()
        self._message = Poses(len(self.colliders), "world")

    def at(self, seconds):
        """Poses at a time: 0.2 m to and fro in 2 s."""
        shift = np.array([0.2 * np.sin(np.pi * seconds), 0.0, 0.0])
        return ColliderPoses(
            position=self.rest.position + shift, orientation=self.rest.orientation
        )

    def message(self, stamp, poses):
        return self._message.fill(stamp, poses)


class Feeder:
    """Sends poses at a fixed rate, with a timer of the probe's node, whatever the test does."""

    def __init__(self, probe, avatar):
        self.probe = probe
        self.avatar = avatar
        self.stamp = 1000 * SECOND
        self.origin = np.zeros(3)
        self._timer = None

    def start(self, period=INPUT_PERIOD):
        self.stop()
        self._period = period
        self._due = time.monotonic_ns() + period
        self._timer = self.probe.node.create_timer(1e-9 * max(period, INPUT_PERIOD), self._send)

    def stop(self):
        if self._timer is not None:
            self.probe.node.destroy_timer(self._timer)
            self._timer = None

    def _send(self):
        """All that is due: stamps follow the time even where the timer does not."""
        while self._due <= time.monotonic_ns():
            self._due += self._period
            self.stamp += self._period
            poses = self.avatar.at(1e-9 * self.stamp)
            poses.position += self.origin
            self.probe.publish(COLLIDER_POSES, self.avatar.message(self.stamp, poses))


def resets(probe):
    """Times the garments were put on again, as of the next frame."""
    status = probe.next("quality")[0].status[0]
    return next(int(v.value) for v in status.values if v.key == "resets")
