"""The text of a BVH file as names, offsets, channels and numbers, in the file's own units.

Format: M. Meredith, S. Maddock, Motion Capture File Formats Explained (University of Sheffield,
2001), section on Biovision BVH. The text is never trusted: every count is compared with what the
file can hold before memory is taken for it.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.input_file import read_bytes
from garment_sim_ros.mocap.clip_name import plain_name

MAX_BYTES = 256 * 2**20
_MAX_HIERARCHY_BYTES = 4 * 2**20
_MAX_JOINTS = 650
_MAX_DEPTH = 300
_MAX_COORDINATE = 1e6
_CHUNK_BYTES = 4 * 2**20
_SPACE = re.compile(rb"\s")

CHANNEL_NAMES = tuple(f"{axis}{what}" for what in ("position", "rotation") for axis in "XYZ")


@dataclass
class BvhText:
    """A parsed file.

    Attributes:
        names: Unique joint names, parents before children.
        parent: Parent of each joint, -1 for roots.
        offset: Offset of each joint from its parent [file units], length n of 3 numbers.
        channels: Channel names of each joint (of `CHANNEL_NAMES`), in file order.
        end_sites: Joint index and offset of each End Site.
        frame_time: Declared time between frames [s].
        values: One row per frame, shape [f, c]; angles in degrees.
        notes: Repairs, one sentence each.
    """

    names: list[str] = field(default_factory=list)
    parent: list[int] = field(default_factory=list)
    offset: list[list[float]] = field(default_factory=list)
    channels: list[tuple[str, ...]] = field(default_factory=list)
    end_sites: list[tuple[int, list[float]]] = field(default_factory=list)
    frame_time: float = 0.0
    values: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    notes: list[str] = field(default_factory=list)


def parse_bvh(path: str | Path) -> BvhText:
    """Read a BVH file.

    Raises:
        InputFileError: The file is missing, too large, cut off, or is no BVH.
    """
    data = read_bytes(path, limit=MAX_BYTES)
    motion = re.search(rb"^[ \t]*MOTION[ \t]*\r?$", data, re.MULTILINE)
    head = data[: motion.start()] if motion else data
    if not re.match(rb"(\xef\xbb\xbf)?\s*HIERARCHY\b", head[:200]):
        raise InputFileError(path, "does not begin with HIERARCHY", "allowed: a BVH file")
    if motion is None:
        raise InputFileError(path, "has no MOTION section; it is cut off or no BVH file")
    if len(head) > _MAX_HIERARCHY_BYTES:
        raise InputFileError(
            path,
            f"has a hierarchy of {len(head)} bytes",
            f"allowed: at most {_MAX_HIERARCHY_BYTES}",
        )
    bvh = _parse_hierarchy(path, head.decode("utf-8-sig", errors="replace"))
    _parse_motion(path, data[motion.end() :], bvh)
    return bvh


def _parse_hierarchy(path: str | Path, text: str) -> BvhText:
    bvh = BvhText()
    seen: dict[str, int] = {}
    # Each open brace belongs to a joint, or to an End Site of the joint (second entry true).
    stack: list[tuple[int, bool]] = []
    opening: tuple[int, bool] | None = None
    lines = re.sub(r"([{}])", r"\n\1\n", text).splitlines()
    for line in lines:
        words = line.split()
        if not words or words[0] == "HIERARCHY":
            continue
        word = words[0]
        if opening is not None and word != "{":
            raise InputFileError(path, f"'{_cut(line)}' stands where '{{' must")
        if word in ("ROOT", "JOINT"):
            inside = len(stack) > 0
            if inside != (word == "JOINT") or (inside and stack[-1][1]):
                raise InputFileError(path, f"'{_cut(line)}' stands in the wrong place")
            if len(words) < 2:
                raise InputFileError(path, f"a {word} has no name")
            if len(bvh.names) >= _MAX_JOINTS:
                raise InputFileError(
                    path, f"has more than {_MAX_JOINTS} joints", f"allowed: {_MAX_JOINTS}"
                )
            name = plain_name("_".join(words[1:]))
            seen[name] = seen.get(name, 0) + 1
            if seen[name] > 1:
                bvh.notes.append(f"Joint name '{_cut(name)}' occurs again; renamed.")
                name = f"{name}__{seen[name]}"
                seen[name] = 1
            opening = (len(bvh.names), False)
            bvh.names.append(name)
            bvh.parent.append(stack[-1][0] if inside else -1)
            bvh.offset.append([0.0, 0.0, 0.0])
            bvh.channels.append(())
        elif word == "End":
            if not stack or stack[-1][1]:
                raise InputFileError(path, "an End Site stands in the wrong place")
            opening = (stack[-1][0], True)
            bvh.end_sites.append((stack[-1][0], [0.0, 0.0, 0.0]))
        elif word == "{":
            if opening is None:
                raise InputFileError(path, "has a '{' that no joint precedes")
            if len(stack) >= _MAX_DEPTH:
                raise InputFileError(
                    path, f"nests joints deeper than {_MAX_DEPTH}", f"allowed: {_MAX_DEPTH}"
                )
            stack.append(opening)
            opening = None
        elif word == "}":
            if not stack:
                raise InputFileError(path, "has a '}' too many")
            stack.pop()
        elif word == "OFFSET" and stack:
            offset = _three_numbers(path, line, words[1:])
            joint, is_end = stack[-1]
            if is_end:
                bvh.end_sites[-1][1][:] = offset
            else:
                bvh.offset[joint] = offset
        elif word == "CHANNELS" and stack and not stack[-1][1]:
            joint = stack[-1][0]
            bvh.channels[joint] = _channels(path, bvh.names[joint], words[1:])
        else:
            raise InputFileError(path, f"'{_cut(line)}' is not part of a BVH hierarchy")
    if stack or opening is not None:
        raise InputFileError(path, "has a '{' that is never closed; the file is cut off")
    if not bvh.names:
        raise InputFileError(path, "has no joints", "allowed: at least one ROOT")
    return bvh


def _cut(text: str) -> str:
    """Text from the file, short and printable for a message."""
    return ascii(text.strip()[:60])[1:-1]


def _three_numbers(path: str | Path, line: str, words: list[str]) -> list[float]:
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not all(abs(number) <= _MAX_COORDINATE for number in numbers):
        raise InputFileError(
            path, f"'{_cut(line)}' is no offset", f"allowed: 3 numbers up to {_MAX_COORDINATE:g}"
        )
    return numbers


def _channels(path: str | Path, joint: str, words: list[str]) -> tuple[str, ...]:
    by_lower_case = {name.lower(): name for name in CHANNEL_NAMES}
    names = tuple(by_lower_case.get(word.lower(), "") for word in words[1:])
    count = words[0] if words else ""
    if count != str(len(names)) or "" in names or len(set(names)) != len(names):
        raise InputFileError(
            path,
            f"joint '{_cut(joint)}' has channels '{_cut(' '.join(words))}'",
            f"allowed: their count, then each at most once of {', '.join(CHANNEL_NAMES)}",
        )
    return names


def _parse_motion(path: str | Path, data: bytes, bvh: BvhText) -> None:
    header = re.match(
        rb"\s*Frames\s*:\s*(\S+)\s+Frame[ \t]+Time\s*:\s*(\S+)", data[:1000], re.IGNORECASE
    )
    if header is None:
        raise InputFileError(path, "has no 'Frames:' and 'Frame Time:' lines after MOTION")
    try:
        frames, bvh.frame_time = int(header[1]), float(header[2])
    except ValueError:
        raise InputFileError(
            path,
            f"declares frames '{_cut(header[1].decode(errors='replace'))}', frame time "
            f"'{_cut(header[2].decode(errors='replace'))}'",
            "allowed: a whole number and seconds",
        ) from None
    if not 0.0 <= bvh.frame_time <= 3600.0:
        raise InputFileError(
            path, f"has a frame time of {bvh.frame_time} s", "allowed: 0 to 3600 s"
        )
    if not 1 <= frames <= MAX_BYTES:
        raise InputFileError(path, f"has {_cut(str(frames))} frames", f"allowed: 1 to {MAX_BYTES}")
    width = sum(len(channels) for channels in bvh.channels)
    if width == 0:
        raise InputFileError(path, "has no channels", "allowed: at least one")
    body = data[header.end() :]
    # A number takes at least a digit and a separator: more cannot be there.
    if frames * width > (len(body) + 1) // 2:
        raise InputFileError(
            path,
            f"declares {frames} frames of {width} channels but holds only {len(body)} bytes of "
            "them; it is cut off or its count is wrong",
        )
    numbers = _numbers(path, body, frames * width)
    if len(numbers) < frames * width:
        raise InputFileError(
            path,
            f"declares {frames} frames but holds only {len(numbers) // width}; it is cut off or "
            "its count is wrong",
        )
    bvh.values = numbers.reshape(frames, width)
    if not np.isfinite(bvh.values).all():
        row = int(np.argmin(np.isfinite(bvh.values).all(axis=1)))
        raise InputFileError(path, f"frame {row + 1} has a number that is not finite")
    if np.abs(bvh.values).max() > _MAX_COORDINATE:
        row = int(np.argmax(np.abs(bvh.values).max(axis=1)))
        raise InputFileError(
            path,
            f"frame {row + 1} has a number of {np.abs(bvh.values[row]).max():g}",
            f"allowed: up to {_MAX_COORDINATE:g}",
        )


def _numbers(path: str | Path, data: bytes, count: int) -> FloatArray:
    """The first `count` numbers, or all there are; read in pieces to bound the memory."""
    numbers = np.empty(count)
    filled, start = 0, 0
    while start < len(data) and filled < count:
        end = min(start + _CHUNK_BYTES, len(data))
        gap = _SPACE.search(data, end)
        end = gap.start() if gap else len(data)
        if end - start > 2 * _CHUNK_BYTES:
            raise InputFileError(path, "has motion values that are no numbers")
        words = data[start:end].split()[: count - filled]
        try:
            numbers[filled : filled + len(words)] = np.fromiter(map(float, words), np.float64)
        except ValueError as error:
            raise InputFileError(
                path, f"has a motion value that is no number ({_cut(str(error))})"
            ) from None
        filled += len(words)
        start = end
    return numbers[:filled]
