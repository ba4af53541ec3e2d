"""Threads that give way to those with a time to keep."""

import os
import threading
from pathlib import Path

import pytest

from garment_sim_ros.stepping_back import SMALL, libraries_step_back, step_back

pytestmark = pytest.mark.skipif(
    not hasattr(os, "SCHED_BATCH"), reason="only Linux has priorities of threads"
)


def _priority(thread: int) -> tuple[int, int]:
    return os.sched_getscheduler(thread), os.getpriority(os.PRIO_PROCESS, thread)


def test_a_thread_steps_back_and_the_one_that_started_it_does_not():
    here = _priority(threading.get_native_id())
    found = {}

    def work(nice):
        step_back(nice)
        found[nice] = _priority(threading.get_native_id())

    for nice in (0, SMALL):
        thread = threading.Thread(target=work, args=(nice,))
        thread.start()
        thread.join()
    assert found == {n: (os.SCHED_BATCH, max(n, here[1])) for n in (0, SMALL)}
    assert _priority(threading.get_native_id()) == here


def test_threads_of_libraries_step_back_and_those_of_python_stay(monkeypatch):
    ended, started = threading.Event(), threading.Event()
    found = {}

    def work():
        started.set()
        ended.wait()
        found["after"] = _priority(threading.get_native_id())

    before = _priority(threading.get_native_id())
    thread, library = threading.Thread(target=work), threading.Thread(target=ended.wait)
    thread.start()
    library.start()
    started.wait()
    # A thread that Python does not list is as one that a library has started.
    monkeypatch.setattr(
        threading,
        "enumerate",
        lambda: [threading.current_thread(), threading.main_thread(), thread],
    )
    libraries_step_back()
    assert library.native_id is not None
    assert _priority(library.native_id) == (os.SCHED_BATCH, max(SMALL, before[1]))
    ended.set()
    for t in (thread, library):
        t.join()
    assert found["after"] == _priority(threading.get_native_id()) == before


def test_a_thread_that_has_ended_or_a_system_that_refuses_is_left_alone(monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    before = _priority(threading.get_native_id())
    step_back(SMALL)
    assert _priority(threading.get_native_id()) == before
    monkeypatch.undo()
    monkeypatch.setattr("garment_sim_ros.stepping_back._THREADS", Path("/nowhere"))
    libraries_step_back()
