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
_FIRST, _FIRST_WORN = 40, 10
"""Rounds after which a node has what it keeps: of all, and of those that garments are worn in."""
_ONE_WORN = 10
"""Garments are worn in one more round for so many others, but see `_FIRST_WORN`."""
_FEW = 10
"""The memory of so many rounds is compared: garments that are just being made come and go."""
_GROWTH = 4.0
"""Allowed from then on, however many rounds [MiB]."""


def run(lengths):
    """Rounds in which garments are worn first: what is loaded for them, once, is there after."""
    rows = []
    for name in NODES:
        with Avatar(f"/soak_rounds_{name}") as avatar:
            rounds = _Rounds(avatar, name, time.monotonic() + lengths.longest)
            if name == "cloth_node":
                worn = max(_FIRST_WORN + 2 * _FEW, lengths.rounds // _ONE_WORN)
                rounds.go(worn, "worn rounds", first=_FIRST_WORN, wear=True)
            rounds.go(lengths.rounds, "rounds", first=_FIRST)
            rows += rounds.told()
    return rows


class _Rounds:
    """Of one node."""

    def __init__(self, avatar, name, end):
        self._avatar, self._name, self._end = avatar, name, end
        self._node = avatar.start(name, autostart=False)
        self._process = psutil.Process(self._node.pid)
        self._rows = []

    def go(self, count, what, *, first, wear=False):
        """So many rounds, but for the time limit.

        Args:
            count: Number of rounds.
            what: What they are called.
            first: Number of rounds after which nothing may be added.
            wear: In each, wait until garments are worn.
        """
        colliders = Colliders() if wear else None
        found = []
        while len(found) < count and time.monotonic() < self._end:
            for transition in _ROUND:
                self._change(transition)
                if colliders and transition == Transition.TRANSITION_ACTIVATE:
                    _wear(self._avatar, colliders)
            process = self._process
            found.append(
                (process.num_threads(), process.num_fds(), process.memory_info().rss / 2**20)
            )
        found = np.reshape(found, (-1, 3))
        early, late = found[first : first + _FEW], found[-_FEW:]
        threads, files, memory = np.median(late, axis=0) - np.median(early, axis=0)
        what = f"{self._name}: {what}"
        self._rows += [
            Row(what, f"{len(found)}", f"at least {first + _FEW}", len(found) >= first + _FEW),
            at_most(f"{what}: memory more", memory, _GROWTH, "MiB"),
            # One that makes garments may be at work at any time, never two.
            at_most(f"{what}: threads more", threads, 1.0),
            at_most(f"{what}: open files more", files, 2.0),
        ]

    def _change(self, transition):
        request = ChangeState.Request(transition=Transition(id=transition))
        done = self._avatar.probe.call(ChangeState, f"{self._name}/change_state", request)
        if not done.success:
            raise AssertionError(f"{self._name} refused transition {transition}")

    def told(self):
        """What was found in all rounds."""
        running = self._node.is_running
        fell = Row(
            f"{self._name}: fell over",
            "no" if running else "yes",
            "no",
            running and "Traceback" not in self._node.output,
        )
        return [*self._rows, fell]


def _wear(avatar, colliders):
    """Sends what it takes, until cloth moves."""
    avatar.probe.publish(COLLIDER_DESCRIPTION, colliders.description)
    feeder, before = Feeder(avatar.probe, colliders), avatar.moved
    feeder.start()
    wait_until(lambda: avatar.moved > before + 10, "cloth", limit=120.0)
    feeder.stop()
