"""Reading files that nobody has checked: size before memory, one clear error."""

from pathlib import Path

from garment_sim_ros.errors import InputFileError

MAX_FILE_BYTES = 512 * 2**20
"""Largest body, rig or weight file that is read."""


def read_bytes(path: str | Path, *, limit: int = MAX_FILE_BYTES) -> bytes:
    """The content of a regular, not empty file of at most `limit` bytes.

    Raises:
        InputFileError: Missing, a folder, unreadable, empty or too large.
    """
    file = Path(path)
    try:
        if not file.exists():
            raise InputFileError(path, "does not exist", "allowed: an existing file")
        if not file.is_file():
            raise InputFileError(path, "is not a regular file", "allowed: a file")
        size = file.stat().st_size
        if size == 0:
            raise InputFileError(path, "is empty")
        if size > limit:
            raise InputFileError(path, f"has {size} bytes", f"allowed: at most {limit} bytes")
        return file.read_bytes()
    except (OSError, ValueError) as error:
        raise InputFileError(path, f"cannot be read ({error})") from error


def read_text(path: str | Path, *, limit: int = MAX_FILE_BYTES) -> str:
    """The content of a UTF-8 text file; see `read_bytes`.

    Raises:
        InputFileError: As `read_bytes`, or the file is not text.
    """
    try:
        text = read_bytes(path, limit=limit).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputFileError(path, f"is not UTF-8 text ({error.reason})") from error
    if "\0" in text:
        raise InputFileError(path, "holds zero bytes", "allowed: UTF-8 text")
    return text
