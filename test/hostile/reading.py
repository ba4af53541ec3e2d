"""How tests read hostile files: refused in one line, within limits of memory and time."""

import re
import resource
import signal
from contextlib import contextmanager
from pathlib import Path

import pytest

from garment_sim_ros.errors import InputFileError

MEMORY = 2**30
"""What a reader may take beyond what the process has [bytes of addresses]."""


@contextmanager
def bounded():
    """What is done within ends and takes little memory; limits are far from what is needed."""

    def stop(*_):
        raise TimeoutError("still reading")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, 60.0)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limits = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def refused(read, *args, match="."):
    """Reads what must be refused in one line that holds some words."""
    with pytest.raises(InputFileError) as error:
        read(*args)
    # Without folders: that of a test is named after it and may hold any of these words.
    assert re.search(match, re.sub(r"\S*/", "", str(error.value)))
    assert str(error.value).isprintable()
    assert len(str(error.value)) < 5000


def written(path, content):
    """A file with some text."""
    path.write_text(content)
    return path


def folder_with(path, metadata):
    """A folder of a bag with these metadata."""
    (path / "bag").mkdir()
    written(path / "bag" / "metadata.yaml", metadata)
    return path / "bag"
