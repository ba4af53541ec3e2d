"""Another publisher of the same topic: one is followed, the other takes over when that is gone."""

import time

from ros_input.clock_source import SECOND, ClockSource
from ros_input.processes import Probe, wait_until

from soak.avatar import Avatar
from soak.report import Row, at_least, at_most

_SECONDS = 10.0


def run(lengths):
    with Avatar("/soak_two") as avatar:
        avatar.start("collider_node")
        avatar.start("cloth_node")
        first = ClockSource(avatar.probe, clock=False)
        avatar.follow(since=first.stamp)
        alone = _rate(avatar)
        other = Probe("/soak_two")
        second = ClockSource(other, clock=False)
        second.jump(first.stamp - second.stamp + 3 * SECOND)
        before = avatar.fresh()
        wait_until(
            lambda: (
                "2 publishers" in avatar.probe.diagnostics(avatar.nodes["collider_node"]).message
            ),
            "both publishers on /diagnostics",
        )
        rate = _rate(avatar)
        after = avatar.fresh()
        ignored = avatar.fresh("collider_node")["rejected.other_publisher"]
        first.close()
        taken = avatar.follow(since=second.stamp + SECOND)
        rows = [
            at_least("messages of the other, left out", ignored, 60.0),
            at_most("times that garments were put on", after["resets"] - before["resets"], 0.0),
            at_least("frames that moved beside it", rate, 0.8 * alone, "Hz"),
            Row("the other is followed when the first is gone", f"after {taken:.1f} s"),
            *avatar.ends(),
        ]
        second.close()
        other.close()
        return rows


def _rate(avatar):
    """Frames that move in a second, over a while."""
    frames, began = avatar.moved, time.monotonic()
    while time.monotonic() - began < _SECONDS:
        avatar.fresh()
    return (avatar.moved - frames) / (time.monotonic() - began)
