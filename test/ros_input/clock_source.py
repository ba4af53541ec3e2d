"""The built-in walk, played with a clock of its own, as a player of bags publishes it."""

import threading
import time

from builtin_interfaces.msg import Time
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.ros.serialize import Joints
from garment_sim_ros.ros.topics import CLOCK, JOINT_STATES, ROBOT_DESCRIPTION

SECOND = 10**9
BEGIN = 1000 * SECOND
"""Where the source's time begins [ns]."""
_LONGEST = 0.4
"""A stall of this process is no gap in the source's time: so much of it goes by at most [s]."""


class ClockSource:
    """Sends `/clock`, 100 times a second, and `joint_states`; steered from outside.

    What a message shows is that of its stamp: the walk goes round and round from time 0 on,
    wherever the source's time jumps.

    Args:
        probe: Whose node sends.
        period: Time between two messages in the source's time [ns].
        clock: Whether `/clock` is sent.

    Attributes:
        stamp: The source's time [ns].
        rate: The source's time over real time.
        playing: Whether time goes on.
        loop: Times between which it goes round and round [ns], or None.
        rounds: Times that it went round.
        sends: Whether joint states go out; the clock does anyway.
        late: How long after its time a message goes out [ns]; below 0: before it.
        swaps: Whether of two messages the later goes first.
        period, probe: As given; may be set.
    """

    def __init__(self, probe, *, period=SECOND // 60, clock=True):
        self.probe, self.period, self._tells = probe, period, clock
        self.stamp, self.rate, self.playing, self.loop = BEGIN, 1.0, True, None
        self._due = BEGIN
        self.rounds, self.sends = 0, True
        self.late, self.swaps, self._held = 0, False, None
        clip = load_clip("walk")
        self._sampler = ClipSampler(clip, "loop")
        self._message = Joints(clip.rig.dofs.names, "world")
        self._lock, self._ended = threading.Lock(), threading.Event()
        probe.publish(ROBOT_DESCRIPTION, String(data=urdf_from_clip(clip)))
        self._tell()
        probe.publish(JOINT_STATES, self.joints(self.stamp))
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def joints(self, stamp):
        """The message with a stamp [ns]."""
        return self._message.fill(stamp, self._sampler.sample(stamp / SECOND))

    def step(self, count=1):
        """So many messages on, at once."""
        with self._lock:
            for _ in range(count):
                self.stamp += self.period
                self._tell()
                self.probe.publish(JOINT_STATES, self.joints(self.stamp))
            self._due = self.stamp + self.period

    def jump(self, by):
        """Set the time by some time [ns]; the next message is of then."""
        with self._lock:
            self.stamp += by
            self._due = self.stamp

    def close(self):
        self._ended.set()
        self._thread.join()

    def _tell(self):
        if self._tells:
            now = Time(sec=self.stamp // SECOND, nanosec=self.stamp % SECOND)
            self.probe.publish(CLOCK, Clock(clock=now))

    def _run(self):
        before = time.monotonic()
        while not self._ended.wait(0.01):
            now = time.monotonic()
            with self._lock:
                if self.playing:
                    went_by = min((now - before) * self.rate, _LONGEST)
                    self._play(self.stamp + round(went_by * SECOND))
            before = now

    def _play(self, until):
        """Messages that are due, then the clock; round again at the end of a loop."""
        if self.loop is not None and until >= self.loop[1]:
            until, self.rounds = self.loop[0], self.rounds + 1
            self._due = until
        self.stamp = until
        while self._due <= until - self.late:
            if self.sends:
                self._send(self._due)
            self._due += self.period
        self._tell()

    def _send(self, stamp):
        if self.swaps and self._held is None:
            self._held = stamp
            return
        for which in (stamp, self._held):
            if which is not None:
                self.probe.publish(JOINT_STATES, self.joints(which))
        self._held = None
