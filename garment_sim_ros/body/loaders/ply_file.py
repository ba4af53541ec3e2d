"""Reading PLY files, text and binary: positions and polygons.

Format: Turk 1994, "The PLY Polygon File Format", 1.0. Sizes that a file declares are compared with
its length before memory is taken.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.loaders.polygons import (
    MAX_MESH_BYTES,
    MAX_VERTICES,
    Polygons,
    checked,
)
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.input_file import read_bytes

_TYPES = {
    **{"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"},
    **{"float": "f", "double": "d", "int8": "b", "uint8": "B", "int16": "h"},
    **{"uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER_BYTES = 64 * 2**10
_MAX_PROPERTIES = 200


@dataclass
class _Element:
    """One kind of element: how many, and type and name of each property.

    The type of a list is those of its count and its items, separated by a space.
    """

    name: str
    count: int
    properties: list[tuple[str, str]]


def read_ply(path: str | Path) -> Polygons:
    """The polygons of a PLY file.

    Raises:
        InputFileError: Missing, not PLY, truncated, not finite, or an index out of range.
    """
    data = read_bytes(path, limit=MAX_MESH_BYTES)
    end = data.find(b"end_header", 0, _MAX_HEADER_BYTES)
    if not data.startswith(b"ply") or end < 0:
        raise InputFileError(path, "is not PLY, or truncated", "allowed: a PLY header and data")
    start = end + len(b"end_header")
    start += 2 if data[start : start + 2] == b"\r\n" else 1
    try:
        order, elements = _header(data[:end].decode("ascii", "replace"))
        body: _Text | _Binary = _Binary(data, start, order) if order else _Text(data[start:])
        polygons = _polygons(elements, body, len(data) - start)
    except (LookupError, ValueError, OverflowError, struct.error) as error:
        raise InputFileError(
            path, f"is malformed or truncated ({error})", "allowed: PLY 1.0"
        ) from None
    return checked(path, polygons)


def _header(text: str) -> tuple[str, list[_Element]]:
    """Byte order (empty for text) and elements."""
    order = None
    elements: list[_Element] = []
    for words in map(str.split, text.splitlines()[1:]):
        if words[:1] == ["format"]:
            order = _ORDERS[words[1]]
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            properties = elements[-1].properties
            if words[1] == "list":
                _, _, count, item, name = words
                properties.append((f"{_TYPES[count]} {_TYPES[item]}", name))
            else:
                _, kind, name = words
                properties.append((_TYPES[kind], name))
            if len(properties) > _MAX_PROPERTIES:
                raise ValueError(f"over {_MAX_PROPERTIES} properties")
    if order is None:
        raise ValueError("no format")
    return order, elements


def _polygons(elements: Sequence[_Element], body: "_Text | _Binary", available: int) -> Polygons:
    vertices = np.zeros((0, 3))
    colours = None
    corners: list[Sequence[float]] = []
    for element in elements:
        # Every element takes at least one byte per property, in text as in binary.
        most = min(MAX_VERTICES, available // max(len(element.properties), 1))
        if not element.properties or not 0 <= element.count <= most:
            raise ValueError(
                f"declares {element.count} elements {element.name!r} in {available} bytes, "
                f"allowed: {most}"
            )
        if any(" " in kind for kind, _ in element.properties):
            for _ in range(element.count):
                for kind, name in element.properties:
                    size, _, item = kind.rpartition(" ")
                    values = body.some(item, int(body.some(size, 1)[0]) if size else 1)
                    if element.name == "face" and name in ("vertex_indices", "vertex_index"):
                        corners.append(values)
        else:
            table = body.table([kind for kind, _ in element.properties], element.count)
            if element.name == "vertex":
                names = [name for _, name in element.properties]
                columns = [table(names.index(axis)) for axis in "xyz"]
                vertices = np.stack(columns, axis=1).astype(np.float64)
                colours = _colours(element.properties, table)
    flat = np.array([c for polygon in corners for c in polygon], np.float64)
    if not (np.abs(flat) <= MAX_VERTICES).all():
        raise ValueError("a vertex index out of range")
    return Polygons(
        vertices=vertices,
        corners=flat.astype(np.int64),
        sizes=np.array([len(c) for c in corners], np.int64),
        colours=colours,
    )


def _colours(
    properties: Sequence[tuple[str, str]], table: Callable[[int], NDArray[Any]]
) -> FloatArray | None:
    """Colours of the vertices from 0 to 1, shape [v, 3]; None where the file has none."""
    names = [name for _, name in properties]
    if not {"red", "green", "blue"} <= set(names):
        return None
    columns = [names.index(name) for name in ("red", "green", "blue")]
    found: FloatArray = np.stack([table(c) for c in columns], axis=1).astype(np.float64)
    if not np.isfinite(found).all():
        return None
    if all(properties[c][0] not in "fd" for c in columns):  # whole numbers, of a byte
        found /= 255.0
    return np.clip(found, 0.0, 1.0)


class _Text:
    """Numbers of a text body, from its begin."""

    def __init__(self, body: bytes) -> None:
        self._words = body.split()
        self._next = 0

    def some(self, _kind: str, count: int) -> Sequence[float]:
        """The next numbers."""
        words = self._words[self._next : self._next + max(count, 0)]
        if len(words) != count:
            raise ValueError("fewer numbers than declared")
        self._next += count
        return [float(word) for word in words]

    def table(self, kinds: Sequence[str], count: int) -> Callable[[int], NDArray[Any]]:
        """The columns of the next `count` rows, by number."""
        values = np.array(self.some("", count * len(kinds))).reshape(count, len(kinds))
        return lambda column: values[:, column]


class _Binary:
    """Numbers of a binary body, from its begin."""

    def __init__(self, data: bytes, start: int, order: str) -> None:
        self._data, self._next, self._order = data, start, order

    def some(self, kind: str, count: int) -> Sequence[float]:
        """The next numbers."""
        if not 0 <= count <= len(self._data):
            raise ValueError(f"a list of {count} items")
        layout = f"{self._order}{count}{kind}"
        values = struct.unpack_from(layout, self._data, self._next)
        self._next += struct.calcsize(layout)
        return values

    def table(self, kinds: Sequence[str], count: int) -> Callable[[int], NDArray[Any]]:
        """The columns of the next `count` rows, by number."""
        dtype = np.dtype([(f"{i}", self._order + kind) for i, kind in enumerate(kinds)])
        rows = np.frombuffer(self._data, dtype, count, self._next)
        self._next += count * dtype.itemsize
        return lambda column: rows[f"{column}"]
