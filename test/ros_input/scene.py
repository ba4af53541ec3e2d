"""An avatar of real nodes behind a source that is steered."""

import contextlib
import signal

import numpy as np

from garment_sim_ros.ros.topics import GARMENT_POINTS
from ros_input.clock_source import SECOND, ClockSource
from ros_input.cloth import stamp_of

STEP = SECOND / 180
"""Of the solver [ns]."""
PERIOD = SECOND // 60
_EVENTS = ("time_jumps", "teleports", "resets")
_TOO_MUCH = ("coarse_s", "skipped_s")


def _pierced(told):
    """Frames with a limb through a garment so far."""
    return round(told["pierced"] * told["frames"])


class Scene:
    """The two nodes behind a source, in a simulated time or in the machine's."""

    def __init__(self, namespace, start_node, make_probe, until, *, simulated=True, **parameters):
        self.until = until
        self.colliders = start_node("collider_node", namespace, use_sim_time=simulated)
        self.cloth = start_node("cloth_node", namespace, use_sim_time=simulated, **parameters)
        self.probe = make_probe(namespace)
        self.points = self.probe.listen(GARMENT_POINTS, "skirt", raw=True)
        self.source = ClockSource(self.probe)
        self.follow()

    def next(self, count=1):
        """Stamps of the next frames [ns]."""
        return np.array([stamp_of(data) for data in self.probe.next(self.points, count)])

    def last(self):
        """Stamp of the last frame [ns]."""
        found = self.probe.received(self.points)
        return stamp_of(found[-1]) if found else -1

    def follow(self):
        """Wait until the cloth is where the source is now."""
        now = self.source.stamp
        self.until(
            lambda: now <= self.last() <= self.source.stamp,
            f"the cloth follows the input from {now} on, it is at {self.last()}",
        )

    def value(self, key):
        """A number of the cloth's diagnostics."""
        return self.probe.value(self.cloth, key)

    def fresh(self, node=None):
        """The numbers of the diagnostics that come next, by name."""
        node = node or self.cloth
        before = self.probe.diagnostics(node)
        self.until(lambda: self.probe.diagnostics(node) is not before, "diagnostics")
        values = {}
        for item in self.probe.diagnostics(node).values:
            with contextlib.suppress(ValueError):
                values[item.key] = float(item.value)
        return values

    def counts(self, key, expected, node=None):
        """Wait until a number of the diagnostics is the expected one."""
        node = node or self.cloth
        self.until(
            lambda: self.probe.value(node, key) == expected,
            f"{key} of {node.name} is {expected:g}",
        )

    def settle(self):
        """Wait until the cloth is where the source is, and what has happened is over."""
        self.follow()
        self.calm_down()

    def calm_down(self):
        """Wait until what has happened is over: what the diagnostics count stays as it is."""
        before = {}

        def is_over():
            nonlocal before
            told = self.fresh()
            now = {key: told[key] for key in _EVENTS} | {"pierced": _pierced(told)}
            same, before = now == before, now
            return same

        self.until(is_over, "nothing happens any more")

    def assert_worn(self, before=None):
        """No limb goes through a garment, and the nodes are well.

        While there is more time than the machine can simulate one may, but none stays.

        Args:
            before: What the diagnostics told when the time began; None: there was too much.
        """
        now = self.fresh()
        if before is not None and all(now[key] == before[key] for key in _TOO_MUCH):
            assert _pierced(now) == _pierced(before)
        self.calm_down()
        self.assert_well()

    def assert_well(self):
        """The nodes run, and nothing went wrong in them."""
        for node in (self.colliders, self.cloth):
            assert node.is_running
            assert "Traceback" not in node.output

    def end(self):
        self.source.close()
        for node in (self.colliders, self.cloth):
            node.send(signal.SIGTERM)
        for node in (self.colliders, self.cloth):
            assert node.wait() == 0
