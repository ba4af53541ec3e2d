"""A clock that is set, back and forward, again and again."""

import numpy as np
from ros_input.clock_source import SECOND, ClockSource

from soak.avatar import Avatar
from soak.report import Row, at_most

_LARGEST = 3600.0


def run(lengths):
    rows = []
    for policy in ("reset", "keep"):
        with Avatar(f"/soak_clock_{policy}") as avatar:
            avatar.start("collider_node", use_sim_time=True)
            avatar.start("cloth_node", use_sim_time=True, on_time_jump=policy)
            source = ClockSource(avatar.probe)
            source.jump(10_000 * SECOND)
            avatar.follow(since=source.stamp)
            random = np.random.default_rng(1)
            begun, before = source.stamp, avatar.fresh()["time_jumps"]
            for _ in range(lengths.jumps):
                by = random.uniform(1.5, _LARGEST) * random.choice((-1.0, 1.0))
                if source.stamp + by * SECOND < begun // 2:
                    by = -by
                source.jump(round(by * SECOND))
                to = source.stamp
                # Also after a jump back: frames of the time before are of later.
                while not to <= avatar.stamp <= source.stamp:
                    avatar.fresh()
            found = avatar.fresh()
            source.close()
            missed = abs(found["time_jumps"] - before - lengths.jumps)
            rows += [
                Row(f"{policy}: jumps", f"{lengths.jumps}"),
                at_most(f"{policy}: jumps that were not told as such", missed, 0.0),
                *avatar.ends(),
            ]
    return rows
