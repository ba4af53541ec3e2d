"""Threads that step back for one that has a time to keep.

A thread that steps back no longer interrupts others as soon as it has work. Where it holds nothing
that they wait for, it can also be given a smaller part of the processor. Only Linux has priorities
of threads; elsewhere nothing happens. No rights are needed, and there is no way back without them.
"""

import os
import threading
from pathlib import Path

SMALL = 10
"""Niceness with which a thread gets a tenth of what one without gets next to it."""
_THREADS = Path("/proc/self/task")


def step_back(nice: int = 0) -> None:
    """Let the calling thread, and those that it will start, step back.

    Args:
        nice: Its niceness. Not above 0 in a process with a time to keep: whoever waits for the
            interpreter, which this thread may hold, would wait for longer.
    """
    _step_back(threading.get_native_id(), nice)


def libraries_step_back() -> None:
    """Let those threads step back that libraries have started by now, not Python.

    The middleware has several. Each send wakes some, and they would interrupt the thread that
    sends.
    """
    if _THREADS.is_dir():
        ours = {thread.native_id for thread in threading.enumerate()}
        for thread in {int(folder.name) for folder in _THREADS.iterdir()} - ours:
            _step_back(thread, SMALL)


def _step_back(thread: int, nice: int) -> None:
    if not hasattr(os, "SCHED_BATCH"):
        return
    try:
        os.sched_setscheduler(thread, os.SCHED_BATCH, os.sched_param(0))
        kept = os.getpriority(os.PRIO_PROCESS, thread)
        os.setpriority(os.PRIO_PROCESS, thread, max(nice, kept))
    except OSError:
        pass  # it has ended, or a sandbox refuses: then it is as any other
