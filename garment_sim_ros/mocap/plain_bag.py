"""Recordings as the library that reads them is to see them: small metadata, nothing compressed.

It unpacks without a limit, and takes a second for every 100 kB of metadata. So it is handed a
folder of its own, with what it needs of them: compressed files are unpacked into it, others are
linked. What is compressed by message is unpacked as it is read. Format: rosbag2's metadata;
Zstandard.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from backports.zstd import ZstdError, ZstdFile

ENDING = ".zstd"
"""What the name of a compressed file ends in, after that of its content."""
MODES = ("none", "file", "message")
FORMAT = "zstd"

_STEP = 2**20  # unpacked at once [bytes]
_MAX_TOPICS = 2000
_KEYS = (
    *("version", "storage_identifier", "duration", "starting_time", "message_count"),
    *("topics_with_message_count", "ros_distro"),
)


@contextmanager
def plain_recording(
    about: dict[str, Any], files: Sequence[Path], most: int
) -> Iterator[tuple[Path, list[Path]]]:
    """A folder like a recording's, with files as they were before they were compressed.

    What is compressed by message stays so, and the metadata there do not say it.

    Args:
        about: What the recording's metadata says.
        files: Its files; those that end in `ENDING` are unpacked.
        most: Bytes that all of them may grow to.

    Yields:
        The folder, there until the block ends, and the files in it.

    Raises:
        ValueError: They grow to more, or are not what they say.
        OSError: A file cannot be read, or there is no room for the folder.
    """
    with TemporaryDirectory(prefix="bag_") as name:
        folder = Path(name)
        unpacked = [folder / file.name.removesuffix(ENDING) for file in files]
        for file, to in zip(files, unpacked):
            if file.suffix == ENDING:
                most -= _unpack(file, to, most)
            else:
                to.symlink_to(file.absolute())
        topics = about.get("topics_with_message_count")
        if isinstance(topics, list) and len(topics) > _MAX_TOPICS:
            raise ValueError(f"metadata with {len(topics)} topics, over {_MAX_TOPICS}")
        changed = {key: about[key] for key in _KEYS if key in about}
        changed["relative_file_paths"] = [file.name for file in unpacked]
        (folder / "metadata.yaml").write_text(  # JSON is YAML
            json.dumps({"rosbag2_bagfile_information": changed})
        )
        yield folder, unpacked


def unpacked_message(data: bytes, most: int) -> bytes:
    """A message as it was before it was compressed.

    Raises:
        ValueError: It grows to over `most` bytes, or is not compressed.
    """
    try:
        with ZstdFile(BytesIO(data)) as file:
            content = file.read(most + 1)
    except (ZstdError, EOFError) as error:
        raise ValueError(f"a message is not Zstandard: {error}") from None
    _check_size(len(content), most)
    return content


def _unpack(file: Path, to: Path, most: int) -> int:
    """Size of the content [bytes]."""
    size = 0
    try:
        with ZstdFile(file) as packed, to.open("xb") as out:
            while piece := packed.read(_STEP):
                size += len(piece)
                _check_size(size, most)
                out.write(piece)
    except (ZstdError, EOFError) as error:
        raise ValueError(f"{file.name} is not Zstandard: {error}") from None
    return size


def _check_size(size: int, most: int) -> None:
    if size > most:
        raise ValueError(f"compressed data grow to over {most} bytes")
