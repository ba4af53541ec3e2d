"""Each kernel is compiled once, however many processes need it at the same time.

Processes that start together, as the nodes of an avatar or the workers of a test run do, want the
same kernels, find none of them on disk and would all compile them. Here the first one compiles
and the others wait, and then read what it wrote.

A process that compiles a kernel may need those that it calls. It holds the locks of its callers
only, so that no two processes ever wait for each other.
"""

import contextlib
import functools
import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numba.core import sigutils
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

try:
    import fcntl
except ImportError:  # no such locks on this system: all compile, as without this file
    fcntl = None  # type: ignore[assignment]

_PACKAGE = __name__.partition(".")[0]
_held: set[Path] = set()


def compile_once() -> None:
    """From now on kernels of this package are compiled by one process at a time."""
    plain = Dispatcher.compile
    if fcntl is None or hasattr(plain, "__wrapped__"):
        return

    @functools.wraps(plain)
    def compile(self: Any, sig: Any) -> Any:
        path = _lock_of(self)
        if path is None or tuple(sigutils.normalize_signature(sig)[0]) in self.overloads:
            return plain(self, sig)
        # Two threads of a process take turns here; what they hold is the process's.
        with global_compiler_lock, _alone(path):
            return plain(self, sig)

    Dispatcher.compile = compile  # type: ignore[method-assign]


def _lock_of(kernel: Any) -> Path | None:
    """The lock's file, beside what is kept of a kernel; None where nothing is kept."""
    function = kernel.py_func
    folder = getattr(kernel._cache, "cache_path", None)
    if not folder or not str(function.__module__).startswith(_PACKAGE):
        return None
    name = f"{function.__module__}.{function.__qualname__}"
    return Path(folder) / f"{hashlib.sha256(name.encode()).hexdigest()[:16]}.lock"


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """No other process is here with the same path."""
    if path in _held:
        yield
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("a")
    except OSError:  # a folder that cannot be written: nothing is shared
        yield
        return
    with file:
        fcntl.flock(file, fcntl.LOCK_EX)
        _held.add(path)
        try:
            yield
        finally:
            _held.discard(path)
