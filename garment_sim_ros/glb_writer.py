"""Writing glTF 2.0 documents as .glb: one JSON chunk, one binary chunk."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.arrays import AnyArray

GENERATOR = "garment_sim_ros"
VERTICES, INDICES = 34962, 34963
"""What a buffer view may be for: vertex attributes, triangle indices."""

_COMPONENT = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125, "i1": 5120, "i2": 5122}
_KIND = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class GlbWriter:
    """A glTF document under construction.

    Attributes:
        json: The document; lists are made when something is added to them.
        binary: The binary chunk so far.
    """

    def __init__(self) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0", "generator": GENERATOR}}
        self.binary = bytearray()

    def add(self, of: str, entry: dict[str, Any]) -> int:
        """Append to one of the document's lists, such as ``nodes``; the entry's index."""
        entries = self.json.setdefault(of, [])
        entries.append(entry)
        return len(entries) - 1

    def view(self, data: bytes, target: int | None = None) -> int:
        """Append bytes to the binary chunk, aligned to 4; index of their buffer view."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        entry = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        if target is not None:
            entry["target"] = target
        self.binary += data
        return self.add("bufferViews", entry)

    def accessor(
        self,
        array: AnyArray,
        *,
        target: int | None = None,
        bounds: bool = False,
        normalized: bool = False,
    ) -> int:
        """Append an array; index of its accessor.

        Args:
            array: One row for each element, of 1, 2, 3, 4 or 16 numbers (matrices by column).
            target: `VERTICES` or `INDICES` where it is one of these.
            bounds: Tell the least and largest of each column, as positions and times need.
            normalized: Whole numbers stand for 0 to 1, or -1 to 1.
        """
        array = np.ascontiguousarray(array)
        kind = array.dtype.newbyteorder("<").str[1:]
        entry: dict[str, Any] = {
            "bufferView": self.view(array.astype("<" + kind, copy=False).tobytes(), target),
            "componentType": _COMPONENT[kind],
            "count": len(array),
            "type": _KIND[array.size // max(len(array), 1)],
        }
        if bounds:
            rows = array.reshape(len(array), -1)
            entry |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        if normalized:
            entry["normalized"] = True
        return self.add("accessors", entry)

    def write(self, path: str | Path) -> None:
        """Write the file."""
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        end = b"\0" * (-len(self.binary) % 4)
        size = len(self.binary) + len(end)
        total = 12 + 8 + len(text) + 8 + size
        with Path(path).open("wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, total))
            file.write(struct.pack("<I4s", len(text), b"JSON"))
            file.write(text)
            file.write(struct.pack("<I4s", size, b"BIN\0"))
            file.write(self.binary)
            file.write(end)
