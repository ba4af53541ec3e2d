"""Things that take turns on a few threads."""

import queue
import threading
import time

import pytest

from garment_sim_ros.ros.turns import Turns

LIMIT = 30.0


class Thing:
    """Due at once, again and again, until it has had its turns."""

    def __init__(self, work=lambda: None, most=10**9):
        self.turns = 0
        self.enough = threading.Event()
        self._work = work
        self._most = most
        self._inside = threading.Lock()

    def ahead(self):
        return 0

    def turn(self):
        assert self._inside.acquire(blocking=False), "on two threads at once"
        self._work()
        self.turns += 1
        if self.turns >= self._most:
            self.enough.set()
        self._inside.release()


@pytest.fixture
def running():
    made = []

    def run(threads, *things):
        made.append(Turns(threads))
        for thing in things:
            made[-1].add(thing)
        return made[-1]

    yield run
    for turns in made:
        turns.end()


class Held:
    """Due at once, again and again; each of its turns lasts until it is let go."""

    def __init__(self, began):
        self._began = began
        self.go = threading.Semaphore(0)
        self._entered = threading.Semaphore(0)

    def ahead(self):
        self._entered.release()
        return 0

    def turn(self):
        assert self._entered.acquire(timeout=LIMIT)
        self._began.put(self)
        assert self.go.acquire(timeout=LIMIT)

    def let_go(self):
        """End its turn; returns when it waits for the next."""
        self.go.release()
        assert self._entered.acquire(timeout=LIMIT)
        self._entered.release()


@pytest.mark.parametrize("threads", [1, 2])
def test_all_have_as_many_turns_where_there_is_too_much_to_do(running, threads, monkeypatch):
    """None is left out, none comes twice before another, whatever the threads are held up by."""
    monkeypatch.setattr("garment_sim_ros.ros.turns._LONG", 10**18)  # no thread more
    began = queue.SimpleQueue()
    things = [Held(began) for _ in range(5)]
    running(threads, *things)
    inside, order = [], []
    while len(order) < 60:
        while len(inside) < threads:
            inside.append(began.get(timeout=LIMIT))
        order.append(things.index(inside[0]))
        inside.pop(0).let_go()
    # Of two that begin at the same time either may be seen first.
    counts = [[order[:n].count(i) for i in range(5)] for n in range(1, 1 + len(order))]
    assert max(max(c) - min(c) for c in counts) <= threads
    for thing in things:
        thing.go.release(1000)


def test_a_turn_that_takes_long_holds_nobody_up(running):
    others = [Thing(lambda: time.sleep(1e-3), most=20) for _ in range(3)]
    came = []

    def long():
        came.append(all(thing.enough.wait(LIMIT) for thing in others))

    turns = running(1, Thing(long, most=1), *others)
    for thing in others:
        assert thing.enough.wait(LIMIT)
    turns.end()
    assert came[0]


def test_what_is_removed_has_had_its_last_turn(running):
    began, goes_on = threading.Event(), threading.Event()

    def work():
        began.set()
        assert goes_on.wait(LIMIT)

    thing, other = Thing(work), Thing(lambda: time.sleep(1e-3), most=5)
    turns = running(2, thing, other)
    assert began.wait(LIMIT)
    removing = threading.Thread(target=turns.remove, args=(thing,))
    removing.start()
    assert other.enough.wait(LIMIT)
    assert removing.is_alive()
    goes_on.set()
    removing.join(LIMIT)
    assert not removing.is_alive()
    assert thing.turns == 1


def test_an_error_ends_all_and_is_kept(running):
    error = ZeroDivisionError("a defect")

    def fail():
        raise error

    other = Thing(lambda: time.sleep(1e-3))
    turns = running(2, other, Thing(fail))
    limit = time.monotonic() + LIMIT
    while turns.failure is None:
        assert time.monotonic() < limit
        time.sleep(1e-3)
    turns.end()
    assert turns.failure is error
    before = other.turns
    turns.end()
    assert other.turns == before


def test_no_thread_is_left(running):
    before = threading.active_count()
    things = [Thing(lambda: time.sleep(1e-3), most=5) for _ in range(8)]
    turns = running(3, *things)
    for thing in things:
        assert thing.enough.wait(LIMIT)
    turns.end()
    assert threading.active_count() == before
