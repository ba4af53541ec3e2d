"""Things that are due at times of their own take turns on a few threads: the earliest due first.

Each has its next turn after the last one ended, and what it missed it leaves out. So where there
is more to do than processors can, all do less, and none waits for longer than the others take for
one turn each.
"""

import heapq
import itertools
import threading
import time
from typing import Protocol

from garment_sim_ros.stamps import SECOND

_WATCH_PERIOD = 0.05
"""Between two looks whether turns take long [s]."""
_LONG = SECOND // 20
"""A turn that takes longer than this takes long [ns]."""


class Due(Protocol):
    """Something that has to be done again and again."""

    def ahead(self) -> int:
        """Time until it is due [ns]; 0 or less where it is."""

    def turn(self) -> None:
        """Do what is due."""


class Turns:
    """Runs what is due, each thing on one thread at a time.

    A turn that takes long is joined by a thread more, so that it holds nobody up.

    Args:
        threads: Number of threads, apart from those.

    Attributes:
        failure: What a turn raised; nothing is run any more.
    """

    def __init__(self, threads: int) -> None:
        self.failure: BaseException | None = None
        self._threads = threads
        self._ended = threading.Event()
        self._order = itertools.count()
        self._waiting: list[tuple[int, int, Due]] = []
        self._known: set[Due] = set()
        self._busy: dict[Due, int] = {}
        self._working: set[threading.Thread] = set()
        self._lock = threading.Lock()
        # One thread waits for what is due next, the others to be needed.
        self._sooner = threading.Condition(self._lock)
        self._needed = threading.Condition(self._lock)
        self._returned = threading.Condition(self._lock)
        self._is_led = False
        self._watching = threading.Thread(target=self._watch, name="watch", daemon=True)
        self._watching.start()

    def add(self, due: Due) -> None:
        """Have something run from now on."""
        with self._lock:
            self._known.add(due)
            self._enter(due)
            self._needed.notify()

    def remove(self, due: Due) -> None:
        """Run something no more; returns when its turn has ended."""
        with self._lock:
            self._known.discard(due)
            self._waiting = [entry for entry in self._waiting if entry[2] is not due]
            heapq.heapify(self._waiting)
            while due in self._busy:
                self._returned.wait()

    def end(self) -> None:
        """Run nothing any more; returns when all turns have ended."""
        self._ended.set()
        self._watching.join()
        with self._lock:
            working = list(self._working)
            self._wake()
        for thread in working:
            thread.join()

    def _wake(self) -> None:
        self._sooner.notify_all()
        self._needed.notify_all()

    def _watch(self) -> None:
        """Start threads as they are needed."""
        while True:
            with self._lock:
                while len(self._working) < self._wanted():
                    thread = threading.Thread(target=self._work, name="turns", daemon=True)
                    self._working.add(thread)
                    thread.start()
            if self._ended.wait(_WATCH_PERIOD):
                return

    def _wanted(self) -> int:
        """How many threads there should be."""
        now = time.monotonic_ns()
        return self._threads + sum(now - began > _LONG for began in self._busy.values())

    def _work(self) -> None:
        while (due := self._next()) is not None:
            try:
                due.turn()
            except BaseException as error:
                self.failure = self.failure or error
                self._ended.set()
            with self._lock:
                del self._busy[due]
                self._returned.notify_all()
                if due in self._known:
                    self._enter(due)
                if self._ended.is_set():
                    self._wake()
            del due  # this thread may wait for long before it has another

    def _enter(self, due: Due) -> None:
        at = time.monotonic_ns() + max(0, due.ahead())
        heapq.heappush(self._waiting, (at, next(self._order), due))
        if self._is_led and self._waiting[0][2] is due:
            self._sooner.notify()

    def _next(self) -> Due | None:
        """What is due next, once it is; None where this thread is to end."""
        with self._lock:
            while not self._ended.is_set() and len(self._working) <= self._wanted():
                if self._is_led or not self._waiting:
                    self._needed.wait()
                    continue
                ahead = self._waiting[0][0] - time.monotonic_ns()
                if ahead > 0:
                    self._is_led = True
                    self._sooner.wait(ahead / SECOND)
                    self._is_led = False
                    continue
                due = heapq.heappop(self._waiting)[2]
                self._busy[due] = time.monotonic_ns()
                if self._waiting:
                    self._needed.notify()
                return due
            self._working.discard(threading.current_thread())
            self._needed.notify()
        return None
