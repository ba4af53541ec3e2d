"""Reading glTF 2.0 files (.gltf, .glb, .vrm): container, buffers and accessors.

Follows the Khronos glTF 2.0 specification, sections 3.6 (binary data) and 4 (GLB). Every size,
index and offset in the file is checked against what is really there before memory is taken.
"""

import base64
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.input_file import MAX_FILE_BYTES, checked_size, read_bytes
from garment_sim_ros.plain_data import PlainDataError, parse_json

MAX_ELEMENTS = 20_000_000
"""Largest number of elements in one accessor."""

MAX_STRIDE = 252
"""Largest distance of elements in a buffer that glTF allows [bytes]."""

_NUMBERS_PER_BYTE = 16
_FREE_NUMBERS = 100_000
"""Numbers that accessors may give in all, per byte of the file and beside: the same bytes may be
shown many times, which takes as much work as if they were there."""

DRACO = "KHR_draco_mesh_compression"
SUPPORTED_EXTENSIONS = frozenset({DRACO, "KHR_mesh_quantization", "VRM"})
"""Required extensions that are understood; `gltf_draco` understands that of Draco."""

_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "EXT_lights_", "VRMC_")
"""How the names of extensions begin that do not change the geometry."""

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class GltfFile:
    """A parsed glTF file.

    Args:
        path: A .gltf, .glb or .vrm file.

    Attributes:
        size: Bytes of the file and of those files beside it that were read.

    Raises:
        InputFileError: The file is missing, truncated, not glTF 2.0, or needs an unsupported
            extension.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = path
        data = read_bytes(path)
        self.size = len(data)
        self._binary: bytes | None = None
        self._lists: dict[str, list[Any]] = {}
        if data[:4] == b"glTF":
            data = self._glb_json(data)
        self._json = self._parse(data)
        version = str(self._object(self._json.get("asset", {}), "asset").get("version", "?"))
        if not version.startswith("2."):
            raise self.error(f"is glTF version {version!r}", "allowed: 2.x")
        required = set(self.list_of("extensionsRequired", kind=str)) - SUPPORTED_EXTENSIONS
        unknown = sorted(name for name in required if not name.startswith(_LOOKS))
        if unknown:
            raise self.error(
                f"needs the extension {', '.join(unknown)}",
                "allowed: files exported without it; of mesh compressions, Draco is read",
            )
        self._buffers: dict[int, bytes] = {}
        self._given = 0
        self._decoded: dict[int, NDArray[Any]] = {}

    def error(self, problem: str, allowed: str = "") -> InputFileError:
        """An error about this file."""
        return InputFileError(self.path, problem, allowed)

    @property
    def extensions(self) -> dict[str, Any]:
        """The file's extension objects."""
        return self._object(self._json.get("extensions", {}), "extensions")

    def list_of(self, key: str, kind: type = dict) -> list[Any]:
        """A top-level list (`nodes`, `meshes`, ...), empty where absent."""
        if key not in self._lists:
            self._lists[key] = self.items(self._json, key, kind)
        return self._lists[key]

    def items(self, owner: dict[str, Any], key: str, kind: type) -> list[Any]:
        """The list `owner[key]` of elements of one type, empty where absent."""
        value = owner.get(key, [])
        if not isinstance(value, list) or not all(
            isinstance(v, kind) and not (kind is int and isinstance(v, bool)) for v in value
        ):
            raise self.error(f"{key} is malformed", f"allowed: a list of {kind.__name__}")
        return value

    def numbers(self, owner: dict[str, Any], key: str, count: int) -> NDArray[np.float64] | None:
        """The `count` finite numbers `owner[key]`, None where absent."""
        value = owner.get(key)
        if value is None:
            return None
        try:
            array = np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            array = np.zeros(0)
        if array.shape != (count,) or not np.isfinite(array).all():
            raise self.error(f"{key} is malformed", f"allowed: {count} finite numbers")
        return array

    def index(self, owner: dict[str, Any], key: str, count: int) -> int:
        """The index `owner[key]` into a list of `count`."""
        value = owner.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < count:
            raise self.error(f"{key} is {value!r:.60}", f"allowed: 0 to {count - 1}")
        return value

    def accessor(self, owner: dict[str, Any], key: str, kind: str) -> NDArray[Any]:
        """The values of the accessor whose index is `owner[key]`.

        Args:
            owner: The JSON object that refers to the accessor.
            key: The reference's name.
            kind: Element type wanted: SCALAR, VEC3, VEC4 or MAT4.

        Returns:
            float64 where the file holds floats or normalised integers, else int64; shape
            [count, width], [count] for SCALAR.

        Raises:
            InputFileError: Wrong type, or the data does not lie within the file.
        """
        accessors = self.list_of("accessors")
        accessor = accessors[self.index(owner, key, len(accessors))]
        if accessor.get("type") != kind:
            raise self.error(f"{key} has type {accessor.get('type')!r}", f"allowed: {kind}")
        component = accessor.get("componentType")
        if not isinstance(component, int) or component not in _COMPONENTS:
            raise self.error(f"{key} has componentType {component!r}")
        count = self._size(accessor, "count")
        if not 0 < count <= MAX_ELEMENTS:
            raise self.error(f"{key} declares {count} elements", f"allowed: 1 to {MAX_ELEMENTS}")
        width = _WIDTH[kind]
        dtype = np.dtype(_COMPONENTS[component])
        if (decoded := self._decoded.get(owner[key])) is not None:
            raw, count = decoded.astype(dtype, copy=False), len(decoded)
            if raw.shape[1] != width:
                raise self.error(f"{key} has {raw.shape[1]} numbers each", f"allowed: {width}")
        elif "bufferView" in accessor:
            raw = self._elements(accessor, dtype, width, count)
        elif "sparse" in accessor:
            if count > self.size:
                raise self.error(
                    f"{key} declares {count} elements without data", f"allowed: {self.size}"
                )
            raw = np.zeros((count, width), dtype)
        else:
            raise self.error(f"{key} has no bufferView", "allowed: accessors with data")
        self._given += count * width
        if self._given > _NUMBERS_PER_BYTE * self.size + _FREE_NUMBERS:
            raise self.error(f"shows its {self.size} bytes of data too many times")
        if "sparse" in accessor:
            raw = self._sparse(self._object(accessor["sparse"], "sparse"), raw)
        if dtype.kind == "f":
            values = raw.astype(np.float64)
        elif accessor.get("normalized") is True:
            values = np.maximum(raw / float(np.iinfo(dtype).max), -1.0)
        else:
            values = raw.astype(np.int64)
        return values[:, 0] if kind == "SCALAR" else values

    def extension_of(self, owner: dict[str, Any], name: str) -> dict[str, Any] | None:
        """An extension of a part of the file, None where it has none of that name."""
        extensions = self._object(owner.get("extensions", {}), "extensions")
        value = extensions.get(name)
        return None if value is None else self._object(value, name)

    def lacks_data(self, index: Any) -> bool:
        """Whether an accessor is there, and has neither data in the file nor any given."""
        accessors = self.list_of("accessors")
        if not isinstance(index, int) or not 0 <= index < len(accessors):
            return False
        return accessors[index].keys().isdisjoint(("bufferView", "sparse")) and (
            index not in self._decoded
        )

    def view_of(self, owner: dict[str, Any]) -> bytes:
        """The bytes of the buffer view that `owner` names."""
        views = self.list_of("bufferViews")
        size = self._size(views[self.index(owner, "bufferView", len(views))], "byteLength")
        return self._elements(owner, np.dtype("<u1"), 1, size).tobytes()

    def give(self, index: int, values: NDArray[Any]) -> None:
        """Data of an accessor that the file holds in another way, shape [count, width]."""
        self._decoded[index] = values
        self.size += values.nbytes
        if self.size > MAX_FILE_BYTES:
            raise self.error(
                f"has {self.size} bytes of data", f"allowed: at most {MAX_FILE_BYTES}"
            )

    def _glb_json(self, data: bytes) -> bytes:
        if len(data) < 20:
            raise self.error("is truncated", "allowed: a GLB file of at least 20 bytes")
        version, length = struct.unpack_from("<II", data, 4)
        if version != 2:
            raise self.error(f"is GLB version {version}", "allowed: 2")
        if length > len(data):
            raise self.error(f"is truncated: {len(data)} bytes of {length}")
        chunks: dict[bytes, bytes] = {}
        offset = 12
        while offset + 8 <= length:
            size, kind = struct.unpack_from("<I4s", data, offset)
            if offset + 8 + size > length:
                raise self.error(f"is truncated: a chunk of {size} bytes passes the file's end")
            chunks.setdefault(kind, data[offset + 8 : offset + 8 + size])
            offset += 8 + size + (-size) % 4
        if b"JSON" not in chunks:
            raise self.error("has no JSON chunk")
        self._binary = chunks.get(b"BIN\0")
        return chunks[b"JSON"]

    def _parse(self, data: bytes) -> dict[str, Any]:
        try:
            content = parse_json(data.decode("utf-8-sig"))
        except (PlainDataError, UnicodeDecodeError) as error:
            raise self.error(f"is not glTF ({error})", "allowed: glTF 2.0 JSON or GLB") from None
        return self._object(content, "the file")

    def _object(self, value: Any, label: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise self.error(f"{label} is malformed", "allowed: a JSON object")
        return value

    def _size(self, owner: dict[str, Any], key: str) -> int:
        value = owner.get(key, 0)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise self.error(f"{key} is {value!r:.60}", "allowed: a whole number from 0")
        return value

    def _elements(
        self, owner: dict[str, Any], dtype: np.dtype[Any], width: int, count: int
    ) -> NDArray[Any]:
        """`count` elements of `width` components from the buffer view that `owner` names."""
        views = self.list_of("bufferViews")
        view = views[self.index(owner, "bufferView", len(views))]
        buffer = self._buffer(self.index(view, "buffer", len(self.list_of("buffers"))))
        view_offset = self._size(view, "byteOffset")
        view_end = view_offset + self._size(view, "byteLength")
        start = view_offset + self._size(owner, "byteOffset")
        element = width * dtype.itemsize
        stride = self._size(view, "byteStride") or element
        if stride > max(MAX_STRIDE, element):
            raise self.error(f"byteStride is {stride}", f"allowed: up to {MAX_STRIDE}")
        end = start + (count - 1) * stride + element
        if stride < element or end > view_end or view_end > len(buffer):
            raise self.error(
                f"an accessor of {count} elements ends at byte {end}",
                f"allowed: within its view ({view_end}) and buffer ({len(buffer)} bytes)",
            )
        return np.ndarray(
            (count, width), dtype, buffer, offset=start, strides=(stride, dtype.itemsize)
        )

    def _sparse(self, sparse: dict[str, Any], raw: NDArray[Any]) -> NDArray[Any]:
        """A copy of `raw` with the sparse substitutions done."""
        count = self._size(sparse, "count")
        if not 0 < count <= len(raw):
            raise self.error(f"a sparse accessor has {count} of {len(raw)} elements")
        indices = self._object(sparse.get("indices"), "sparse indices")
        component = indices.get("componentType")
        if component not in (5121, 5123, 5125):
            raise self.error(f"sparse indices have componentType {component!r}")
        where = self._elements(indices, np.dtype(_COMPONENTS[component]), 1, count)[:, 0]
        if where.max() >= len(raw):
            raise self.error(f"a sparse index is {where.max()}", f"allowed: below {len(raw)}")
        values = self._object(sparse.get("values"), "sparse values")
        raw = raw.copy()
        raw[where] = self._elements(values, raw.dtype, raw.shape[1], count)
        return raw

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self.list_of("buffers")[index].get("uri")
            if uri is None:
                if index != 0 or self._binary is None:
                    raise self.error(f"buffer {index} has no data")
                self._buffers[index] = self._binary
            elif not isinstance(uri, str):
                raise self.error(f"buffer {index} has uri {uri!r}")
            elif uri.startswith("data:"):
                self._buffers[index] = self._embedded(uri)
            else:
                self._buffers[index] = self._beside(uri)
        return self._buffers[index]

    def _embedded(self, uri: str) -> bytes:
        header, _, payload = uri.partition(",")
        if not header.endswith(";base64"):
            raise self.error("has a data URI that is not base64")
        try:
            return base64.b64decode(payload, validate=True)
        except ValueError as error:
            raise self.error(f"has a data URI that is not base64 ({error})") from error

    def _beside(self, uri: str) -> bytes:
        name = Path(unquote(uri))
        if "://" in uri or name.is_absolute() or ".." in name.parts:
            raise self.error(f"names the buffer {uri!r}", "allowed: files below its own folder")
        path = Path(self.path).parent / name
        self.size += checked_size(path)
        if self.size > MAX_FILE_BYTES:
            raise self.error(
                f"has {self.size} bytes of data", f"allowed: at most {MAX_FILE_BYTES}"
            )
        return read_bytes(path)
