"""Writing a rosbag2 (mcap) as ROS 2 itself does, that can be read whatever becomes of the disk.

`rosbags` writes the file; here its metadata is made what rosbag2 of the message types' own
distribution writes, and a recording that runs out of room ends after its last whole chunk. Used
of `rosbags` beside its documented interface: the storage class that `Writer.STORAGE_PLUGINS`
names, with its file and chunks. (rosbag2's metadata, version 9; MCAP 0, mcap.dev/spec.)
"""

import os
from collections import defaultdict
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter, PendingChunk

DISTRO = "jazzy"
"""Whose message types are written."""
_FOREIGN, _OWN = "ros_distro: rosbags", f"ros_distro: {DISTRO}"
_NEVER = 2**63 - 1
"""A time after all others [ns]."""


class _Whole(NamedTuple):
    """How far a file can be read once it has its index."""

    end: int
    chunks: int
    first: int
    last: int
    counts: dict[int, int]


class _Storage(McapWriter):
    """An mcap file that can go back to what is whole."""

    def __init__(self, path: Path, compression: CompressionMode) -> None:
        super().__init__(path, compression)
        self._whole: list[_Whole] = []
        self._note()

    def close_chunk(self) -> None:
        """Write what has been gathered, to the disk's end of the file."""
        super().close_chunk()
        self._note()

    def _note(self) -> None:
        self.bio.flush()
        self._whole.append(
            _Whole(
                self.bio.tell(),
                len(self.chunks),
                self.message_start_time,
                self.message_end_time,
                dict(self.channel_stats),
            )
        )

    def close(self, version: int, metadata: str) -> None:
        """Write the index, with metadata as rosbag2 has them."""
        super().close(version, metadata.replace(_FOREIGN, _OWN))

    def __getstate__(self) -> dict[str, Any]:
        """What writing goes on from, beside the file up to here."""
        self.bio.flush()
        return {**self.__dict__, "bio": self.bio.tell()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Go on from there; what was written after it is left.

        Raises:
            OSError: The file is missing or shorter.
        """
        self.__dict__ = dict(state)
        if self.path.stat().st_size < state["bio"]:
            raise OSError(f"{self.path} is shorter than it was")
        os.truncate(self.path, state["bio"])
        self.bio = self.path.open("ab")

    def go_back(self) -> bool:
        """Leave what was written after the last whole chunk, or that one, too, the next time.

        Returns:
            Whether there was anything to go back to.
        """
        if not self._whole:
            return False
        whole = self._whole.pop()
        # What waits to be written is not: the buffer knows that its file is closed.
        self.bio.raw.close()
        os.truncate(self.path, whole.end)
        self.bio = self.path.open("ab")
        self.chunks = self.chunks[: whole.chunks]
        self.chunk = PendingChunk(_NEVER, 0, BytesIO(), defaultdict(list))
        self.message_start_time, self.message_end_time = whole.first, whole.last
        known = dict.fromkeys(self.channel_stats, 0)
        self.channel_stats = {**known, **whole.counts}
        return True


class BagWriter(Writer):
    """A recording in an mcap file with compressed chunks; opened and closed as `Writer` is.

    Args:
        path: Its folder; must not exist.
    """

    STORAGE_PLUGINS = MappingProxyType({StoragePlugin.MCAP: _Storage})

    def __init__(self, path: Path) -> None:
        super().__init__(path, version=9, storage_plugin=StoragePlugin.MCAP)
        self.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._mcap: Any = None

    def open(self) -> None:
        """Open for writing."""
        super().open()
        self._mcap = self.storage

    def close(self) -> None:
        """Write index and metadata.

        Raises:
            OSError: There is no room for them.
        """
        super().close()
        metadata = self.metapath.read_text("utf8").replace(_FOREIGN, _OWN)
        new = self.metapath.with_suffix(".yaml.tmp")
        new.write_text(metadata, "utf8")
        new.replace(self.metapath)

    def keep_what_is_whole(self) -> int:
        """Close after writing failed: the recording ends where there was room for it.

        Returns:
            The number of messages in it.

        Raises:
            OSError: There is no room for any.
        """
        failure: OSError | None = None
        while self._mcap is not None and self._mcap.go_back():
            self.storage = self._mcap
            self.counts = dict(self._mcap.channel_stats)
            self.min_timestamp = self._mcap.message_start_time
            self.max_timestamp = self._mcap.message_end_time
            try:
                self.close()
            except OSError as error:
                failure = error
                with suppress(OSError):
                    self.metapath.with_suffix(".yaml.tmp").unlink()
                continue
            return sum(self.counts.values())
        raise failure or OSError("nothing was written")
