"""Hostile and valid messages, a thousand of each a second."""

import time

import numpy as np
from rclpy.serialization import serialize_message
from ros_input.hostile import PERIOD, SECOND, Sender, hostile_messages
from ros_input.processes import Probe
from std_msgs.msg import String

from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.ros.serialize import Joints
from garment_sim_ros.ros.topics import JOINT_STATES, ROBOT_DESCRIPTION
from soak.avatar import Avatar
from soak.report import Row, at_least, at_most

_BEGIN = 1000 * SECOND
_WINDOW = 3.0
"""Frames are counted over so long [s]."""


class Good:
    """The walk, with stamps of its own."""

    def __init__(self, probe):
        self.clip = load_clip("walk")
        self.stamp = _BEGIN
        self._probe, self._sampler = probe, ClipSampler(self.clip, "loop")
        self._message = Joints(self.clip.rig.dofs.names, "world")
        probe.publish(ROBOT_DESCRIPTION, String(data=urdf_from_clip(self.clip)))
        self.send()

    def send(self, _=0):
        self.stamp += PERIOD
        values = self._sampler.sample((self.stamp - _BEGIN) / SECOND)
        self._probe.publish(JOINT_STATES, self._message.fill(self.stamp, values))


def run(lengths):
    with Avatar("/soak_flooded") as avatar:
        avatar.start("collider_node")
        avatar.start("cloth_node")
        good = Good(avatar.probe)
        sender = Sender(good.send)
        sender.start()
        avatar.follow(since=_BEGIN)
        other = Probe(avatar.namespace)
        kinds = []

        def send(number):
            if number % 100 == 0:
                kinds[:] = [
                    (topic, m if isinstance(m, bytes) else serialize_message(m))
                    for topic, m in hostile_messages(good.stamp, good.clip)
                ]
            other.publish(*kinds[number % len(kinds)])

        for topic, message in hostile_messages(good.stamp, good.clip):
            other.publish(topic, message)
        hostile = Sender(send)
        hostile.start()
        names = ("collider_node", "cloth_node")
        begun = {name: avatar.memory(name) for name in names}
        rates, end = [], time.monotonic() + 60.0 * lengths.minutes
        while time.monotonic() < end:
            moved, began = avatar.moved, time.monotonic()
            time.sleep(_WINDOW)
            rates.append((avatar.moved - moved) / (time.monotonic() - began))
        grown = {name: avatar.memory(name) - begun[name] for name in names}
        rows = [
            Row("hostile messages", f"{hostile.sent}"),
            Row("valid messages", f"{sender.sent}"),
            at_least("frames that moved, median of 3 s", float(np.median(rates)), 59.0, "Hz"),
            at_least("frames that moved, mean", float(np.mean(rates)), 57.0, "Hz"),
            Row("frames that moved, worst 3 s", f"{min(rates):.1f} Hz"),
            *(at_most(f"memory that {n} grew by", grown[n], 40.0, "MiB") for n in names),
        ]
        hostile.end()
        sender.end()
        rows += avatar.ends()
        other.close()
        return rows
