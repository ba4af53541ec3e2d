"""The disk is full while it is recorded to: it is told, and what there is can be read."""

import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.recording.bags import read_recording
from soak.avatar import NODES, Avatar
from soak.report import Row, at_least

_ROOM = 6 * 2**20
"""Bytes that there is room for."""
_LONGEST = 300.0


def run(lengths):
    rows = []
    with Avatar("/soak_disk") as avatar, tempfile.TemporaryDirectory() as folder:
        for name in NODES:
            avatar.start(name)
        avatar.follow()
        rows += _recorded("a limit of a file's size", Path(folder) / "limit", _ROOM)
        with _small_disk(Path(folder) / "disk") as disk:
            if disk is None:
                rows.append(Row("a full disk", "no disk can be made", "needs root"))
            else:
                rows += _recorded("a full disk", disk / "bag", 0)
        return [*rows, *avatar.ends()]


def _recorded(what, bag, room):
    """Record until it ends by itself, and read what there is."""
    done = subprocess.run(
        [sys.executable, "-m", "soak.record", str(bag), str(room)],
        capture_output=True,
        text=True,
        check=False,
        timeout=_LONGEST,
    )
    lines = done.stderr.strip().splitlines()
    is_told = done.returncode == 2 and len(lines) == 1 and str(bag) in lines[0]
    rows = [
        Row(f"{what}: one line that says so", lines[-1][-60:] if lines else "none", "", is_told)
    ]
    try:
        recording = read_recording(bag)
    except GarmentSimError as error:
        return [*rows, Row(f"{what}: can be read", str(error), "", False)]
    return [*rows, at_least(f"{what}: frames that can be read", len(recording.stamp), 10.0)]


@contextmanager
def _small_disk(folder):
    """A file system of few bytes; None where none may be mounted."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={_ROOM}", "tmpfs", str(folder)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        yield None
        return
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=False)
