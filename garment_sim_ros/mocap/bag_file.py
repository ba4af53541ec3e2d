"""Opening rosbag2 recordings that nobody has checked.

The library that reads them opens what `metadata.yaml` names and takes as much memory as a record
says; here that is compared with what is there first. Formats: rosbag2's metadata, versions 1 to 9;
MCAP 0 (mcap.dev/spec); Zstandard frames (RFC 8878); SQLite.
"""

import re
import sqlite3
import struct
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader

from garment_sim_ros.errors import GarmentSimError, InputFileError
from garment_sim_ros.input_file import checked_size, exists, is_folder
from garment_sim_ros.mocap.plain_bag import (
    ENDING,
    FORMAT,
    MODES,
    plain_recording,
    unpacked_message,
)
from garment_sim_ros.plain_data import read_yaml

MAX_BYTES = 4 * 2**30
"""Largest recording, all files together."""

_MAX_METADATA_BYTES = 2**20
_MAX_FILES = 1000
_MAX_TOPICS = 2000
_MAX_RECORDS = 20_000_000
_FREE_BYTES = 64 * 2**20
_EXPANSION = 100
"""Compressed data may grow to this many times the file's size, and `_FREE_BYTES` more."""

_MAGIC = b"\x89MCAP0\r\n"
_CHUNK, _CHUNK_INDEX, _FOOTER = 0x06, 0x08, 0x02
_LARGEST_BLOCK = 128 * 2**10  # of Zstandard
_LZ4_RATIO = 255
_ALLOWED = "allowed: a rosbag2 folder, .mcap or .db3 file"


class Bag:
    """An opened recording.

    Attributes:
        connections: Its topics.
    """

    def __init__(self, reader: Reader, most: int | None = None) -> None:
        """Keep the reader; `most` bytes is what compressed messages may grow to, if they are."""
        self._reader = reader
        self._most = most
        self.connections: list[Connection] = reader.connections

    def messages(
        self, connections: Sequence[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Connection, log time [ns] and content of each message on some connections, by time."""
        left = self._most
        for connection, timestamp, data in self._reader.messages(connections):
            if left is not None:
                data = unpacked_message(data, left)
                left -= len(data)
            yield connection, timestamp, data


@contextmanager
def opened_bag(path: str | Path) -> Iterator[Bag]:
    """A recording to read from.

    Args:
        path: A rosbag2 folder, or its .mcap or .db3 file.

    Raises:
        InputFileError: It is missing, damaged or too large, also where that only shows in the
            block that reads from it.
    """
    try:
        with ExitStack() as stack:
            about: dict[str, Any] = {}
            files = [Path(path)]
            if is_folder(path):
                about = _metadata(Path(path) / "metadata.yaml")
                files = _files_named(Path(path) / "metadata.yaml", about)
            elif not exists(path):
                raise InputFileError(path, "does not exist", _ALLOWED)
            mode = _compression(Path(path) / "metadata.yaml", about)
            most = _EXPANSION * _checked_sizes(path, files, mode) + _FREE_BYTES
            folder, stored = Path(path), files
            if about:
                folder, stored = stack.enter_context(
                    plain_recording(about, files, min(most, MAX_BYTES))
                )
            left = most
            for file, named in zip(stored, files):
                left -= _check_content(file, named, left)
            reader = stack.enter_context(Reader(folder))
            yield Bag(reader, most if mode == "message" else None)
    except GarmentSimError:
        raise
    except MemoryError:
        raise InputFileError(path, "does not fit into memory") from None
    except Exception as error:
        # The reader raises whatever its file format library or a damaged record leads to.
        raise InputFileError(
            path, f"cannot be read as a bag ({_short(error)})", _ALLOWED
        ) from error


def _short(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())[:200]


def _metadata(path: Path) -> dict[str, Any]:
    """What a recording's metadata says."""
    if not exists(path):
        raise InputFileError(path.parent, "has no metadata.yaml", _ALLOWED)
    content = read_yaml(path, limit=_MAX_METADATA_BYTES)
    about: Any = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    return about if isinstance(about, dict) else {}


def _files_named(metadata: Path, about: dict[str, Any]) -> list[Path]:
    """The storage files that a recording's metadata names, which lie beside it."""
    names = about.get("relative_file_paths")
    if (
        not isinstance(names, list)
        or not 0 < len(names) <= _MAX_FILES
        or not all(isinstance(name, str) for name in names)
    ):
        raise InputFileError(metadata, "names no files", f"allowed: 1 to {_MAX_FILES} file names")
    # As the reader does it: older versions wrote paths.
    return [metadata.parent / Path(name).name for name in names]


def _compression(metadata: Path, about: dict[str, Any]) -> str:
    """What is compressed: none, file or message. Chunks inside of files do not count."""
    mode = str(about.get("compression_mode") or "none").lower()
    if mode not in MODES:
        raise InputFileError(
            metadata, f"has the compression_mode {mode[:60]!r}", f"allowed: {', '.join(MODES)}"
        )
    form = str(about.get("compression_format") or "none").lower()
    if mode != "none" and form != FORMAT:
        raise InputFileError(
            metadata, f"has the compression_format {form[:60]!r}", f"allowed: {FORMAT}"
        )
    return mode


def _checked_sizes(path: str | Path, files: list[Path], mode: str) -> int:
    """Size of all files [bytes]; refuses those that are missing, of another kind or too large."""
    total = 0
    for file in files:
        total += checked_size(file, limit=MAX_BYTES)
        packed = ENDING if mode == "file" else ""
        if not file.name.endswith((f".mcap{packed}", f".db3{packed}")):
            raise InputFileError(file, f"has the ending {file.suffix!r}", _ALLOWED)
    if total > MAX_BYTES:
        raise InputFileError(path, f"has {total} bytes", f"allowed: at most {MAX_BYTES}")
    return total


def _check_content(file: Path, named: Path, most: int) -> int:
    """Refuse a storage file that would take too much to open, by the name that it was given.

    Returns:
        What its compressed chunks grow to [bytes].
    """
    try:
        if file.suffix == ".mcap":
            return _check_mcap(file, most)
        _check_sqlite(file)
        return 0
    except (OSError, ValueError, struct.error, sqlite3.Error) as error:
        raise InputFileError(
            named, f"cannot be read as a bag ({_short(error)})", _ALLOWED
        ) from None


def _check_mcap(path: Path, most: int) -> int:
    """What compressed chunks grow to; refuses over `most` bytes, and records that end nowhere."""
    size = path.stat().st_size
    grown = 0
    chunks: dict[int, tuple[int, int, str]] = {}
    with path.open("rb") as file:
        if file.read(8) != _MAGIC:
            raise ValueError("no MCAP file")
        for _ in range(_MAX_RECORDS):
            start = file.tell()
            kind, length = struct.unpack("<BQ", file.read(9))
            if start + 9 + length > size:
                raise ValueError(f"a record of {length} bytes passes the file's end")
            if kind == _FOOTER:
                return grown
            if kind == _CHUNK:
                chunks[start] = grown_size, packed, name = _chunk(file, length)
                grown += max(grown_size, _most_bytes(file, name, packed))
                if grown > most:
                    raise ValueError(f"chunks grow to over {most} bytes")
            elif kind == _CHUNK_INDEX:
                record = file.read(length)
                place = struct.unpack_from("<Q", record, 16)[0]
                skipped = 36 + struct.unpack_from("<I", record, 32)[0] + 8
                (n,) = struct.unpack_from("<I", record, skipped)
                name = record[skipped + 4 : skipped + 4 + n].decode()
                packed, whole = struct.unpack_from("<QQ", record, skipped + 4 + n)
                # Taken out: a chunk that is named again would be unpacked again.
                if chunks.pop(place, None) != (whole, packed, name):
                    raise ValueError(f"its index names a chunk at byte {place}")
            file.seek(start + 9 + length)
    raise ValueError(f"over {_MAX_RECORDS} records")


def _chunk(file: BinaryIO, length: int) -> tuple[int, int, str]:
    """Whole and compressed size of a chunk's content, and how; leaves the file at the content."""
    whole, _crc, n = struct.unpack("<16xQII", file.read(32))
    if n > 16:
        raise ValueError("a chunk names no compression")
    name = file.read(n).decode()
    (packed,) = struct.unpack("<Q", file.read(8))
    if 40 + n + packed > length:
        raise ValueError(f"a chunk of {packed} bytes passes its record's end")
    return whole, packed, name


def _most_bytes(file: BinaryIO, compression: str, packed: int) -> int:
    """The most that compressed content can grow to, from its blocks."""
    if compression == "":
        return packed
    if compression != "zstd":
        return _LZ4_RATIO * packed
    end = file.tell() + packed
    total = 0
    while file.tell() < end:
        magic, head = struct.unpack("<IB", file.read(5))
        if magic & 0xFFFFFFF0 == 0x184D2A50:  # a frame to be skipped
            file.seek(-1, 1)
            file.seek(struct.unpack("<I", file.read(4))[0], 1)
            continue
        if magic != 0xFD2FB528:
            raise ValueError("a chunk is not Zstandard")
        single, sizes = head >> 5 & 1, head >> 6
        file.seek((not single) + (0, 1, 2, 4)[head & 3] + ((single, 2, 4, 8)[sizes]), 1)
        last = 0
        while not last and file.tell() < end:
            block = int.from_bytes(file.read(3), "little")
            last, kind, length = block & 1, block >> 1 & 3, block >> 3
            file.seek(1 if kind == 1 else length, 1)
            total += length if kind < 2 else _LARGEST_BLOCK
        file.seek(4 * (head >> 2 & 1), 1)  # its checksum
    return total


def _check_sqlite(path: Path) -> None:
    """Refuse databases that compute what they show, and topics that stand many times."""
    address = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    with closing(sqlite3.connect(address, uri=True)) as database:
        entries = database.execute("SELECT type, sql FROM sqlite_master LIMIT 100").fetchall()
        for kind, text in entries:
            if kind not in ("table", "index") or re.search(r"(?i)\b(as|virtual)\b", text or ""):
                raise ValueError(f"it holds a {str(kind)[:20]} that computes what it shows")
        topics, different = database.execute(
            "SELECT count(*), count(DISTINCT id) FROM topics"
        ).fetchone()
        if topics != different or topics > _MAX_TOPICS:
            raise ValueError(f"it has {topics} topics with {different} numbers")
