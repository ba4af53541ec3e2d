"""Opening files that nobody has checked: path, type and size first, then memory; one clear error.

Every reader of the package opens its files here. A pipe or a device would make a program wait or
read for ever, so that nothing but a regular file is opened.
"""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from garment_sim_ros.errors import GeometryError, InputFileError

MAX_FILE_BYTES = 512 * 2**20
"""Largest file that is read where its reader names no limit."""

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def read_bytes(path: str | Path, *, limit: int = MAX_FILE_BYTES) -> bytes:
    """The content of a regular, not empty file of at most `limit` bytes.

    Raises:
        InputFileError: Missing, no path, no regular file, unreadable, empty or too large.
    """
    checked_size(path, limit=limit)
    try:
        # What is there may change after the check: a pipe must not make this wait either.
        handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
        with os.fdopen(handle, "rb") as file:
            status = os.fstat(handle)
            _check(path, status, limit)
            data = file.read(status.st_size + 1)
    except (OSError, ValueError) as error:
        raise InputFileError(path, _reason(error)) from None
    if len(data) > status.st_size:
        raise InputFileError(path, "grows while it is read")
    return data


def read_text(path: str | Path, *, limit: int = MAX_FILE_BYTES) -> str:
    """The content of a UTF-8 text file; see `read_bytes`.

    Raises:
        InputFileError: As `read_bytes`, or the file is not text.
    """
    try:
        text = read_bytes(path, limit=limit).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputFileError(path, f"is not UTF-8 text ({error.reason})") from None
    if "\0" in text:
        raise InputFileError(path, "holds zero bytes", "allowed: UTF-8 text")
    return text


def checked_size(path: str | Path, *, limit: int = MAX_FILE_BYTES) -> int:
    """Size [bytes] of a file that `read_bytes` would read; for readers of other libraries.

    Raises:
        InputFileError: As `read_bytes`.
    """
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise InputFileError(path, "does not exist", "allowed: an existing file") from None
    except (OSError, ValueError) as error:
        raise InputFileError(path, _reason(error)) from None
    _check(path, status, limit)
    return status.st_size


def exists(path: str | Path) -> bool:
    """Whether something has this name; no for what cannot be a path."""
    try:
        os.stat(path)
    except (OSError, ValueError):
        return False
    return True


def is_file(path: str | Path) -> bool:
    """Whether a regular file has this name; no for what cannot be a path."""
    try:
        return stat.S_ISREG(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


def is_folder(path: str | Path) -> bool:
    """Whether a folder has this name; no for what cannot be a path."""
    try:
        return stat.S_ISDIR(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


@contextmanager
def said_of(path: str | Path) -> Iterator[None]:
    """What is wrong with a geometry is said of the file that it is from.

    Raises:
        InputFileError: In the place of a `GeometryError`.
    """
    try:
        yield
    except GeometryError as error:
        problem, _, allowed = str(error).partition("; ")
        raise InputFileError(path, problem, allowed) from error


def _check(path: str | Path, status: os.stat_result, limit: int) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = next((word for test, word in _KINDS if test(status.st_mode)), "no file")
        raise InputFileError(path, f"is {kind}", "allowed: a regular file")
    if status.st_size == 0:
        raise InputFileError(path, "is empty")
    if status.st_size > limit:
        raise InputFileError(
            path, f"has {status.st_size} bytes", f"allowed: at most {limit} bytes"
        )


def _reason(error: OSError | ValueError) -> str:
    if isinstance(error, ValueError):  # a zero byte, or a lone surrogate
        return f"is no path ({error})"
    if error.errno == errno.ENAMETOOLONG:
        return "is too long for a path"
    return f"cannot be read ({error.strerror or error})"
