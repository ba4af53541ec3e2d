"""Recordings that were interrupted and are gone on with from their last whole second.

What is written so far lies hidden beside where the recording goes; the state of the simulation,
which nobody else can use, in the user's cache.
"""

import fcntl
import hashlib
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from garment_sim_ros.disk_cache import code_digest, keep_newest, replace_file, user_cache
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.frozen_state import freeze, thaw
from garment_sim_ros.ros.offline.making import Making

_KEPT = 20
"""States, of all recordings; those not changed for longest go first."""


class Unfinished:
    """One recording that can be gone on with.

    Args:
        folder: Where it is made, nobody else's while it is.

    Attributes:
        folder: As given.
        is_kept: Whether there is anything to go on from.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        name = hashlib.sha256(str(folder.absolute()).encode()).hexdigest()[:32]
        self._state = user_cache("unfinished") / name
        self.is_kept = False

    def kept(self, setup: str) -> Making | None:
        """What to go on with; None, and nothing is left of it, where it begins anew.

        Args:
            setup: What it is made with.
        """
        self._head = head = _head(setup)
        making: Making | None = None
        with suppress(Exception):  # whatever damaged bytes lead to
            data = self._state.read_bytes()
            digest, data = data[: len(head)], data[len(head) :]
            # Written by this version from the same input, in this cache: nobody else's bytes.
            making = thaw(data) if digest == head else None
        if making is not None:
            making.gone_on_from = making.frames
        else:
            self.forget()
            for left in self.folder.iterdir():
                if left.is_dir():
                    shutil.rmtree(left)
        self.is_kept = making is not None
        return making

    def keep(self, making: Making) -> None:
        """Keep how far it is; after `kept`.

        Raises:
            OSError: There is no room for it.
        """
        replace_file(self._state, self._head + freeze(making))
        keep_newest(self._state.parent.iterdir(), _KEPT)
        self.is_kept = True

    def forget(self) -> None:
        """Keep nothing any more."""
        self._state.unlink(missing_ok=True)


def _head(setup: str) -> bytes:
    """What a state begins with: it fits one version and one input."""
    return hashlib.sha256(f"{code_digest('.')}\0{setup}".encode()).digest()


@contextmanager
def to_go_on_with(out: Path) -> Iterator[Unfinished]:
    """Where a recording is made that an interruption leaves as far as it is.

    Args:
        out: Where it goes in the end.

    Raises:
        InputFileError: Another process makes it, or it cannot be written.
    """
    folder = out.absolute().with_name(f".unfinished-{out.name}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("wb")
    except OSError as error:
        raise InputFileError(
            f"--out {out}", error.strerror or str(error), "allowed: a folder to write into"
        ) from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputFileError(
                f"--out {out}", "is being made by another process", "allowed: one at a time"
            ) from None
        unfinished = Unfinished(folder)
        try:
            yield unfinished
        except BaseException:
            if not unfinished.is_kept:
                shutil.rmtree(folder, ignore_errors=True)
            raise
        if out.is_dir() and not out.is_symlink():
            shutil.rmtree(out)
        (folder / out.name).replace(out)
        unfinished.forget()
        shutil.rmtree(folder)
