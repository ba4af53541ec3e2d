"""Work in processes of this machine, which end with the one that started them."""

import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context, parent_process
from typing import TypeVar

from garment_sim_ros.errors import GarmentSimError

Task = TypeVar("Task")
Result = TypeVar("Result")

_ENDED = 2
"""Exit code of a process that was told to end."""
_PATIENCE = 5.0
"""For a process to clean up [s]."""
_idle = threading.Event()
"""Whether this process has nothing to clean up."""


def over_processes(
    call: Callable[[Task], Result], tasks: Sequence[Task], jobs: int
) -> Generator[tuple[int, Result | GarmentSimError], None, None]:
    """Call a function for each task in one of some processes.

    Args:
        call: A function of a module.
        tasks: What it is called with.
        jobs: Number of processes.

    Yields:
        A task's place and what came of it, as they come. To be closed: that ends the processes.

    Raises:
        GarmentSimError: A process was ended from outside.
    """
    # Not forked: a process with compiled code and threads cannot be copied safely.
    pool = ProcessPoolExecutor(
        max(1, min(jobs, len(tasks))), mp_context=get_context("spawn"), initializer=_begin
    )
    try:
        waiting = {pool.submit(_work, call, task): k for k, task in enumerate(tasks)}
        for future in as_completed(waiting):
            try:
                result: Result | GarmentSimError = future.result()
            except GarmentSimError as error:
                result = error
            yield waiting[future], result
        pool.shutdown()
    except BrokenProcessPool:
        raise GarmentSimError(
            "--jobs: a process was ended from outside; what is whole stays, --resume does the "
            "others"
        ) from None
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        _end_all()


def _end_all() -> None:
    """End the processes politely, so that they clean up; those that do not listen, at once."""
    processes = active_children()
    for process in processes:
        process.terminate()
    for process in processes:
        process.join(_PATIENCE)
        if process.is_alive():
            process.kill()
            process.join()


def _begin() -> None:
    """Only the process that was started by the user takes Ctrl-C, and then ends the others."""
    _idle.set()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process, too, where its parent was killed and could not do it."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)
    _idle.wait()
    os._exit(_ENDED)


def _end(number: int, frame: object) -> None:
    if _idle.is_set():
        os._exit(_ENDED)
    raise KeyboardInterrupt


def _work(call: Callable[[Task], Result], task: Task) -> Result:
    _idle.clear()
    try:
        return call(task)
    finally:
        _idle.set()
