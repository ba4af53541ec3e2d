"""Waiting for what processes do, as long as they run."""

import subprocess
import time
from collections.abc import Callable
from typing import Any


def until(
    found: Callable[[], Any], *processes: subprocess.Popen[Any], longest: float = 120.0
) -> Any:
    """What a condition gives once it holds, while processes run."""
    end = time.monotonic() + longest
    while not (value := found()):
        assert all(p.poll() is None for p in processes)
        assert time.monotonic() < end
        time.sleep(0.02)
    return value
