"""A thread that keeps a time goes before others, unless it uses most of a core."""

import os
import threading
from types import SimpleNamespace

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


def test_a_thread_that_uses_most_of_a_core_goes_as_others_and_asks_again_later(monkeypatch, asked):
    """Later each time, up to a minute; the time is the test's."""
    now, used = 10**15, 0
    clock = SimpleNamespace(monotonic_ns=lambda: now, thread_time_ns=lambda: used)
    monkeypatch.setattr(going_first, "time", clock)

    def until(policy, share):
        """How long it is until the system is asked for a policy [s], using a share of a core."""
        nonlocal now, used
        asked.clear()
        for tick in range(100 * 60):
            go_first(1)
            if asked:
                assert asked == [(policy, int(policy == os.SCHED_RR))]
                return tick / 60
            now += 10**9 // 60
            used += round(share * 10**9 / 60)
        return None

    def work():
        until(os.SCHED_RR, 0.3)
        assert until(os.SCHED_OTHER, 0.7) is None, "it leaves room for others"
        waits = []
        for _ in range(7):
            assert until(os.SCHED_OTHER, 0.9) < 1.1
            assert "most of a core" in how_it_goes()
            waits.append(until(os.SCHED_RR, 0.9))
            assert how_it_goes() == "real time"
        return waits

    assert in_a_thread(work) == pytest.approx([4.0, 8.0, 16.0, 32.0, 64.0, 64.0, 64.0], abs=0.05)


@granted
def test_the_system_takes_the_priority_back(monkeypatch):
    times = iter(range(1, 10))
    clock = SimpleNamespace(
        monotonic_ns=lambda: 10**9 * next(times), thread_time_ns=lambda: 10**18 * next(times)
    )
    monkeypatch.setattr(going_first, "time", clock)

    def work():
        return [(go_first(1), policy())[1] for _ in range(2)]

    assert in_a_thread(work) == [os.SCHED_RR, os.SCHED_OTHER]


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
