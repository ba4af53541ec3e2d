"""Log lines while something takes long."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

_PERIOD = 3.0
_WORTH_TELLING = 0.5


@contextmanager
def reporting(log: Callable[[str], Any], what: str) -> Iterator[Callable[[str], None]]:
    """Log every few seconds that work goes on, and in the end how long it took.

    Args:
        log: Takes a line of text.
        what: The work, as in "compile".

    Yields:
        Takes how far the work is, in words.
    """
    far = [what]
    done = threading.Event()
    began = time.monotonic()

    def report() -> None:
        while not done.wait(_PERIOD):
            log(f"{far[-1]}: {time.monotonic() - began:.0f} s so far")

    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    try:
        yield lambda words: far.append(f"{what}, {words}")
    finally:
        done.set()
        thread.join()
    took = time.monotonic() - began
    if took > _WORTH_TELLING:
        log(f"{what}: done in {took:.1f} s")
