"""Ctrl-C where something must not be cut short."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager


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
