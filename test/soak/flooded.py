"""Hostile and valid messages, a thousand of each a second."""

import subprocess
import sys
import time

import numpy as np
import psutil
from ros_input.hostile import PERIOD, SECOND, Sender
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
_ALONE = 15.0
"""Before and after, without hostile ones, they are counted over so long [s]: a machine that is
busy with other things has fewer."""


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


class Used:
    """Processor time that nodes take, from now on."""

    def __init__(self, avatar, names):
        self._processes = {name: psutil.Process(avatar.nodes[name].pid) for name in names}
        self._began, self._before = time.monotonic(), self._so_far()

    def _so_far(self):
        return {name: sum(p.cpu_times()[:2]) for name, p in self._processes.items()}

    def percent(self):
        """Percent of one core, by node."""
        past, now = time.monotonic() - self._began, self._so_far()
        return {name: 100.0 * (now[name] - self._before[name]) / past for name in now}


def run(lengths):
    with Avatar("/soak_flooded") as avatar:
        avatar.start("collider_node")
        avatar.start("cloth_node")
        good = Good(avatar.probe)
        sender = Sender(good.send)
        sender.start()
        avatar.follow(since=_BEGIN)
        names = ("collider_node", "cloth_node")
        used = Used(avatar, names)
        before = _rates(avatar, _ALONE)
        alone_percent = used.percent()
        command = [sys.executable, "-m", "soak.send_hostile", avatar.namespace, str(good.stamp)]
        hostile = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert hostile.stdout is not None
        hostile.stdout.readline()  # it has begun
        begun = {name: avatar.memory(name) for name in names}
        used = Used(avatar, names)
        rates = _rates(avatar, 60.0 * lengths.minutes)
        percent = used.percent()
        grown = {name: avatar.memory(name) - begun[name] for name in names}
        hostile.terminate()
        told = hostile.communicate()[0].split()
        alone = min(np.mean(before), np.mean(_rates(avatar, _ALONE)))
        rows = [
            Row("hostile messages", told[-1]),
            Row("valid messages", f"{sender.sent}"),
            Row("frames that moved before or after, mean", f"{alone:.1f} Hz"),
            at_least("frames that moved, mean", np.mean(rates), 0.95 * alone, "Hz"),
            Row("frames that moved, median of 3 s", f"{np.median(rates):.1f} Hz"),
            Row("frames that moved, worst 3 s", f"{min(rates):.1f} Hz"),
            *(
                Row(
                    f"processor time of {n}",
                    f"{percent[n]:.0f} %",
                    f"{alone_percent[n]:.0f} % alone",
                )
                for n in names
            ),
            *(at_most(f"memory that {n} grew by", grown[n], 40.0, "MiB") for n in names),
        ]
        sender.end()
        return [*rows, *avatar.ends()]


def _rates(avatar, seconds):
    """Frames that moved in a second, window by window."""
    found, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        moved, began = avatar.moved, time.monotonic()
        time.sleep(_WINDOW)
        found.append((avatar.moved - moved) / (time.monotonic() - began))
    return found
