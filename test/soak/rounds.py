"""Each node is configured and cleaned up again and again: nothing piles up."""

import time

import numpy as np
import psutil
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from ros_input.cloth import Avatar as Colliders
from ros_input.cloth import Feeder
from ros_input.processes import wait_until

from garment_sim_ros.ros.topics import COLLIDER_DESCRIPTION
from soak.avatar import NODES, Avatar
from soak.report import Row, at_most

_ROUND = (
    Transition.TRANSITION_CONFIGURE,
    Transition.TRANSITION_ACTIVATE,
    Transition.TRANSITION_DEACTIVATE,
    Transition.TRANSITION_CLEANUP,
)
_WORN_EVERY = 50
"""In one round of so many, the first one too, `cloth_node` goes on until its garments are worn:
what it loads for that, once, depends on the machine's speed in all others."""
_FIRST = 40
"""Rounds after which a node has what it keeps."""
_FEW = 10
"""The memory of so many rounds is compared: garments that are just being made come and go."""
_GROWTH = 4.0
"""Allowed from then on, however many rounds [MiB]."""


def run(lengths):
    rows = []
    for name in NODES:
        with Avatar(f"/soak_rounds_{name}") as avatar:
            node = avatar.start(name, autostart=False)
            process, found, began = psutil.Process(node.pid), [], time.monotonic()
            colliders = Colliders() if name == "cloth_node" else None
            for number in range(lengths.rounds):
                if time.monotonic() - began > lengths.longest:
                    break
                for transition in _ROUND:
                    request = ChangeState.Request(transition=Transition(id=transition))
                    done = avatar.probe.call(ChangeState, f"{name}/change_state", request)
                    if not done.success:
                        return [*rows, Row(f"{name}: round {number}", "refused", "", False)]
                    if colliders and number % _WORN_EVERY == 0 and transition == _ROUND[1]:
                        _wear(avatar, colliders)
                found.append(
                    (process.num_threads(), process.num_fds(), process.memory_info().rss / 2**20)
                )
            rows += _rows(name, np.array(found), node)
    return rows


def _wear(avatar, colliders):
    """Sends what it takes, until cloth moves."""
    avatar.probe.publish(COLLIDER_DESCRIPTION, colliders.description)
    feeder, before = Feeder(avatar.probe, colliders), avatar.moved
    feeder.start()
    wait_until(lambda: avatar.moved > before + 10, "cloth", limit=120.0)
    feeder.stop()


def _rows(name, found, node):
    early, late = found[_FIRST : _FIRST + _FEW], found[-_FEW:]
    threads, files, memory = np.median(late, axis=0) - np.median(early, axis=0)
    return [
        Row(f"{name}: rounds", f"{len(found)}"),
        at_most(f"{name}: memory that it grew by", memory, _GROWTH, "MiB"),
        # One that makes garments may be at work at any time, never two.
        at_most(f"{name}: threads more", threads, 1.0),
        at_most(f"{name}: open files more", files, 2.0),
        Row(
            f"{name}: fell over",
            "no" if node.is_running else "yes",
            "no",
            node.is_running and "Traceback" not in node.output,
        ),
    ]
