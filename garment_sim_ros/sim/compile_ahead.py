"""Compiling a scene's kernels in several processes at once, into the cache that all share.

The compiler takes one core, whatever there is. A process of its own finds which kernels the scene
calls, by running them as plain Python, and has them compiled by as many others as there are cores.
"""

import hashlib
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

from numba.core.dispatcher import Dispatcher

from garment_sim_ros import jit
from garment_sim_ros.sim import settle
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.warm_up import Scene, warm_up

_MOST_PROCESSES = 4
_LONGEST_SEARCH = 20
"""A process that has not found all kernels after this time ends [s]."""
_wanted: list[tuple[Any, tuple[Any, ...]]] = []


def compile_ahead(
    scene: Scene,
    solver: str,
    parameters: Parameters | None,
    tell: Callable[[str], object],
    *,
    also: tuple[Callable[[], None], ...] = (),
) -> None:
    """Has a scene's kernels compiled where that has not been done yet; `warm_up` finds them then.

    It gives up silently where processes or the cache cannot be had: `warm_up` compiles, too.

    Args:
        scene: What there is.
        solver: Name of the solver.
        parameters: Outer forces and settings; defaults where None.
        tell: Takes how far it is, in words.
        also: Functions of modules, whose kernels are compiled, too.
    """
    asked = pickle.dumps((scene, solver, parameters, also))
    if jit.cache_folder is None or _cores() < 2:
        return
    others = [f"{function.__module__}.{function.__qualname__}" for function in also]
    named = repr((sorted(scene.kinds), sorted(scene.garments), solver, parameters, others))
    done = jit.cache_folder / f"all-{hashlib.sha256(named.encode()).hexdigest()[:16]}"
    if done.exists():
        return
    try:
        with subprocess.Popen(
            [sys.executable, "-m", "garment_sim_ros.sim.compile_ahead"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        ) as process:
            assert process.stdin is not None
            assert process.stdout is not None
            # It stays open: the process ends when this one does.
            process.stdin.write(asked)
            process.stdin.flush()
            for line in process.stdout:
                tell(line.decode().strip())
        if process.returncode == 0:
            done.touch()
    except OSError:
        return


def main() -> int:
    """Entry point of the process: reads a scene, compiles, prints how far it is."""
    scene, solver, parameters, also = pickle.load(sys.stdin.buffer)

    def run() -> None:
        warm_up(scene, solver, parameters)
        for function in also:
            function()

    # Plain Python is slow, and a few steps call all that there is.
    settle._STEP_LIMIT = 3
    signal.alarm(_LONGEST_SEARCH)
    _wanted.extend(jit.kernels_of(run))
    signal.alarm(0)
    # The longest first, so that none is left alone with it in the end.
    order = sorted(range(len(_wanted)), key=lambda i: -_size(_wanted[i][0], set()))
    processes = min(_cores(), len(order), _MOST_PROCESSES)
    with multiprocessing.get_context("fork").Pool(processes) as pool:
        threading.Thread(target=_end_with_caller, args=(pool,), daemon=True).start()
        for count, _ in enumerate(pool.imap_unordered(_compile, order, chunksize=1)):
            print(f"{count + 1} of {len(order)} kernels", flush=True)
    return 0


def _compile(index: int) -> None:
    kernel, types = _wanted[index]
    try:
        kernel.compile(types)
    except Exception:
        return  # The caller's own `warm_up` says what is wrong.


def _size(kernel: Any, seen: set[Any]) -> int:
    """How much there is to compile: its code and that of all kernels that it calls [bytes]."""
    seen.add(kernel)
    function = kernel.py_func
    called = (function.__globals__.get(name) for name in function.__code__.co_names)
    return len(function.__code__.co_code) + sum(
        _size(other, seen)
        for other in called
        if isinstance(other, Dispatcher) and other not in seen
    )


def _end_with_caller(pool: Any) -> None:
    """The caller never writes again: reading ends when it does."""
    os.read(sys.stdin.fileno(), 1)
    pool.terminate()
    os._exit(1)


def _cores() -> int:
    return len(os.sched_getaffinity(0))


if __name__ == "__main__":
    sys.exit(main())
