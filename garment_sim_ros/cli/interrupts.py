"""Ctrl-C where something must not be cut short."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Ctrl-C and SIGTERM take effect at the end: nothing is left half done.

    Raises:
        KeyboardInterrupt: One came.
    """
    came: list[int] = []
    signs = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(sign, lambda number, frame: came.append(number)) for sign in signs]
    try:
        yield
    finally:
        for sign, handler in zip(signs, before):
            signal.signal(sign, handler)
    if came:
        raise KeyboardInterrupt


@contextmanager
def interrupts_kept() -> Iterator[Callable[[], None]]:
    """Ctrl-C and SIGTERM interrupt, and are not lost where that is swallowed.

    It is where objects end, or where other languages call Python.

    Yields:
        To be called where nothing is under way; raises `KeyboardInterrupt` if one came.
    """
    came = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal came
        came = True
        raise KeyboardInterrupt

    def tell_unless_interrupted(what: "sys.UnraisableHookArgs") -> None:
        # What is cut short in the making may not end well either.
        if not came and not issubclass(what.exc_type, KeyboardInterrupt):
            tell(what)

    def check() -> None:
        if came:
            raise KeyboardInterrupt

    signs = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(sign, interrupt) for sign in signs]
    tell, sys.unraisablehook = sys.unraisablehook, tell_unless_interrupted
    try:
        yield check
    finally:
        if not came:  # else what was cut short is still to end, and so is the process
            sys.unraisablehook = tell
        for sign, handler in zip(signs, before):
            signal.signal(sign, handler)
