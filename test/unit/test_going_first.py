"""A thread that keeps a time goes before others, unless it uses most of a core."""

import os
import threading
import time

import pytest

from garment_sim_ros import going_first
from garment_sim_ros.going_first import go_first, how_it_goes

pytestmark = pytest.mark.skipif(
    not hasattr(os, "SCHED_RR"), reason="only Linux has priorities of threads"
)


def policy(thread=0):
    return os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK


def in_a_thread(work):
    found = []
    thread = threading.Thread(target=lambda: found.append(work()))
    thread.start()
    thread.join()
    return found[0]


def is_granted():
    def ask():
        try:
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
        except OSError:
            return False
        return True

    return in_a_thread(ask)


granted = pytest.mark.skipif(
    "not is_granted()", reason="the system does not grant real time to this user"
)


@pytest.fixture
def asked(monkeypatch):
    """What the system is asked for: policy and priority; all is granted."""
    asked = []

    def note(_, policy, parameters):
        asked.append((policy & ~os.SCHED_RESET_ON_FORK, parameters.sched_priority))

    monkeypatch.setattr(os, "sched_setscheduler", note)
    return asked


@granted
def test_a_thread_goes_first_and_neither_those_beside_it_nor_those_it_starts():
    def work():
        go_first(3)
        own = policy(), os.sched_getparam(0).sched_priority, how_it_goes()
        return own, in_a_thread(policy)

    before = policy(), how_it_goes()
    own, started = in_a_thread(work)
    assert own == (os.SCHED_RR, 3, "real time")
    assert started == os.SCHED_OTHER
    assert (policy(), how_it_goes()) == before


def until(condition, busy):
    """Calls `go_first` until a condition holds, for 10 s; keeps the core busy meanwhile or not."""
    end = time.monotonic() + 10.0
    while time.monotonic() < end:
        go_first(1)
        if condition():
            return True
        if not busy:
            time.sleep(0.001)  # leaves its core to others, which is what is tried
    return False


@granted
def test_a_thread_that_uses_most_of_a_core_goes_as_others_and_asks_again_later(monkeypatch):
    monkeypatch.setattr(going_first, "_WATCH", 20_000_000)
    monkeypatch.setattr(going_first, "_FIRST_WAIT", 50_000_000)

    def work():
        go_first(1)
        waits = []
        for _ in range(3):
            assert until(lambda: policy() == os.SCHED_OTHER, busy=True)
            assert "most of a core" in how_it_goes()
            began = time.monotonic()
            assert until(lambda: policy() == os.SCHED_RR, busy=False)
            waits.append(time.monotonic() - began)
        # While it leaves room it stays.
        end = time.monotonic() + 0.2
        assert until(lambda: policy() != os.SCHED_RR or time.monotonic() > end, busy=False)
        assert policy() == os.SCHED_RR
        return waits

    waits = in_a_thread(work)
    assert waits[0] >= 0.05
    assert waits[1] >= 0.1
    assert waits[2] >= 0.2


def test_a_system_that_refuses_is_asked_once(monkeypatch):
    asked = []

    def refuse(*what):
        asked.append(what)
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)

    def work():
        for _ in range(3):
            go_first(1)
        return how_it_goes()

    assert "does not grant" in in_a_thread(work)
    assert len(asked) == 1


@pytest.mark.parametrize("other", ["SCHED_BATCH", "SCHED_IDLE"])
def test_a_thread_that_was_started_in_another_way_stays_so(other):
    def work():
        os.sched_setscheduler(0, getattr(os, other), os.sched_param(0))
        go_first(1)
        return policy(), how_it_goes()

    assert in_a_thread(work) == (getattr(os, other), "as it was started")


def test_without_a_priority_nothing_is_asked(asked):
    assert in_a_thread(lambda: (go_first(0), how_it_goes())[1]) == "as others"
    assert not asked


def test_priority_and_policy_are_those_asked_for(asked):
    assert in_a_thread(lambda: (go_first(7), how_it_goes())[1]) == "real time"
    assert asked == [(os.SCHED_RR, 7)]
