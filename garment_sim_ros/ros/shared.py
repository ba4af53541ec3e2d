"""Files that several nodes of a process use: read once, and kept while one of them has it."""

import threading
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

Read = TypeVar("Read")

_kept: "weakref.WeakValueDictionary[tuple[Any, ...], Any]" = weakref.WeakValueDictionary()
_lock = threading.Lock()


def shared(read: Callable[..., Read], source: str, **options: Any) -> Read:
    """What `read(source, **options)` returns, or has returned to a node that still has it.

    Args:
        read: Reads a file, or makes what a name stands for. What it returns nobody changes.
        source: The file or name; a file that was written meanwhile is read again.
        options: Passed on; those that cannot be compared are not shared.

    Raises:
        GarmentSimError: What `read` raises.
    """
    key = (read, source, _state_of(source), tuple(sorted(options.items())))
    try:
        hash(key)
    except TypeError:
        return read(source, **options)
    with _lock:  # who comes second waits for the first
        found: Read | None = _kept.get(key)
        if found is None:
            found = _kept[key] = read(source, **options)
        return found


def _state_of(source: str) -> tuple[int, int] | None:
    """Changes when a file does; None where there is none."""
    try:
        state = Path(source).stat()
    except (OSError, ValueError):
        return None
    return state.st_mtime_ns, state.st_size
