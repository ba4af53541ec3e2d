"""A thread that keeps a time goes before others, where the system grants it.

Beside a program that takes a core, a thread with work of some milliseconds in each sixtieth of a
second waits for its turn as long as it works. With a real-time priority it does not wait. It could
then keep all others out for good: a thread that uses most of a core has none, and tries again
later, after longer each time.

It is granted to whoever has the right (`ulimit -r`, or the capability SYS_NICE), on Linux.
"""

import os
import threading
import time

from garment_sim_ros.stamps import SECOND

_WATCH = SECOND // 2
"""How often a thread looks at what it uses [ns]."""
_MOST = 0.8
"""Part of a core that is most of it."""
_FIRST_WAIT = 4 * SECOND
"""How long it then has no priority [ns]; twice as long each further time."""
_LONGEST_WAIT = 64 * SECOND
_OTHERS = "as others"
_here = threading.local()


def go_first(priority: int) -> None:
    """Have the calling thread go first; quick, to be called again and again as it works.

    Args:
        priority: Real-time priority, round robin; 0 for none. That of the first call counts.
    """
    if not hasattr(_here, "going"):
        _here.going = _GoingFirst(priority)
    _here.going.watch()


def how_it_goes() -> str:
    """How the calling thread stands to others, in words."""
    return _here.going.state if hasattr(_here, "going") else _OTHERS


class _GoingFirst:
    """The priority of one thread, the one that calls `watch`.

    Args:
        priority: Real-time priority, round robin; 0 for none.

    Attributes:
        state: How it stands, in words.
    """

    def __init__(self, priority: int) -> None:
        self._priority = priority
        self._next = 0 if priority > 0 and hasattr(os, "SCHED_RR") else None
        self.state = _OTHERS
        self._wait = _FIRST_WAIT
        self._is_first = False
        self._since = 0
        self._seen = 0, 0

    def watch(self) -> None:
        """Take the priority, keep it or give it back; quick where it is not time for that."""
        if self._next is None:
            return
        now = time.monotonic_ns()
        if now < self._next:
            return
        used = time.thread_time_ns()
        (at, before), self._seen = self._seen, (now, used)
        if not self._is_first:
            self._begin(now)
        elif used - before > _MOST * (now - at):
            self._end(now)
        else:
            self._next = now + _WATCH
            if now - self._since > 2 * self._wait:
                self._wait = _FIRST_WAIT

    def _begin(self, now: int) -> None:
        try:
            if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK != os.SCHED_OTHER:
                self._next, self.state = None, "as it was started"
                return
            _set(os.SCHED_RR, self._priority)
        except OSError:
            self._next, self.state = None, "as others: the system does not grant real time"
            return
        self._is_first, self.state = True, "real time"
        self._since, self._next = now, now + _WATCH

    def _end(self, now: int) -> None:
        _set(os.SCHED_OTHER, 0)
        self._is_first, self.state = False, "as others: it uses most of a core"
        self._next = now + self._wait
        self._wait = min(2 * self._wait, _LONGEST_WAIT)


def _set(policy: int, priority: int) -> None:
    # Threads that it starts are as others.
    os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
