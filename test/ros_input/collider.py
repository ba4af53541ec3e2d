"""Joint states for collider_node, and its messages read."""

import numpy as np
from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.ros.topics import COLLIDER_POSES, JOINT_STATES

NAMESPACE = "/collider_test"


STEP = 10_000_000


def stamped(stamp):
    return Header(stamp=Time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="world")


def nanoseconds(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def as_array(message):
    return np.array(
        [
            [getattr(p.position, k) for k in "xyz"] + [getattr(p.orientation, k) for k in "xyzw"]
            for p in message.poses
        ]
    )


class Feeder:
    """Sends joint states of the built-in walk with stamps of its own."""

    def __init__(self, probe, until):
        self.probe = probe
        self.until = until
        self.clip = load_clip("walk")
        self.names = self.clip.rig.dofs.names
        self.urdf = urdf_from_clip(self.clip)
        self.stamp = 1000 * 10**9
        self.sample = 0
        self.poses = probe.listen(COLLIDER_POSES)

    def values(self):
        self.sample = (self.sample + 1) % len(self.clip.times)
        return self.clip.values[self.sample].tolist()

    def send(self, *, advance=STEP, **changes):
        """One message; its stamp."""
        self.stamp += advance
        fields = {"header": stamped(self.stamp), "name": list(self.names)}
        if "position" not in changes and "name" not in changes:
            fields["position"] = self.values()
        self.probe.publish(JOINT_STATES, JointState(**{**fields, **changes}))
        return self.stamp

    def answer(self, stamp):
        """The poses with a stamp."""

        def find():
            found = self.probe.received(self.poses)
            return next((m for m in reversed(found) if nanoseconds(m) == stamp), None)

        return self.until(find, f"poses stamped {stamp}")

    def found(self):
        return self.probe.received(self.poses)

    def until_answered(self):
        """Sends until poses come: a best effort reader misses what comes before it matched."""

        def answered():
            self.send()
            return self.found()

        self.until(answered, "the first poses")
        self.answer(self.send())  # nothing is under way any more
