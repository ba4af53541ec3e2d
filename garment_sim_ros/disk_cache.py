"""Arrays that take long to compute, kept in the user's cache folder."""

import contextlib
import hashlib
import io
import math
import os
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from garment_sim_ros.input_file import read_bytes

Arrays = Mapping[str, NDArray[Any]]

_KEPT = 50
"""Files in one folder; those not used for longest go first."""


def user_cache(folder: str) -> Path:
    """A folder of this package in the user's cache; not made yet.

    Raises:
        RuntimeError: The user has no home.
    """
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "garment_sim_ros" / folder


def code_digest(*folders: str) -> str:
    """A digest of the source files in folders of this package: other code, other results."""
    package = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    for folder in folders:
        for file in sorted((package / folder).rglob("*.py")):
            digest.update(str(file.relative_to(package)).encode() + file.read_bytes())
    return digest.hexdigest()


def array_digest(*arrays: NDArray[Any]) -> str:
    """A digest of arrays' types, shapes and values."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.dtype} {array.shape} ".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def cached_arrays(folder: str, key: str, make: Callable[[], Arrays]) -> dict[str, NDArray[Any]]:
    """What `make` returns, from the cache where it was made before.

    A cache that cannot be read or written, or whose file is damaged, only costs the time to make
    the arrays.

    Args:
        folder: Folder in the user's cache.
        key: All that the result depends on, code included; see `code_digest`.
        make: Makes the arrays.
    """
    with contextlib.suppress(Exception):  # whatever a damaged file makes its readers raise
        if (found := kept_arrays(folder, key)) is not None:
            os.utime(_file(folder, key))
            return found
    arrays = dict(make())
    keep_arrays(folder, key, arrays)
    return arrays


def kept_arrays(folder: str, key: str) -> dict[str, NDArray[Any]] | None:
    """What was kept under a key; None where nothing was.

    Args:
        folder: Folder in the user's cache.
        key: As it was kept.

    Raises:
        Exception: The file is damaged; whatever its readers raise.
    """
    try:
        file = _file(folder, key)
    except RuntimeError:
        return None
    return _stored(file) if file.exists() else None


def keep_arrays(folder: str, key: str, arrays: Arrays) -> bool:
    """Keep arrays under a key.

    Args:
        folder: Folder in the user's cache.
        key: All that they depend on.
        arrays: By name.

    Returns:
        Whether they could be written.
    """
    made = io.BytesIO()
    np.savez(made, **arrays)  # type: ignore[arg-type]
    data = made.getvalue()
    try:
        file = _file(folder, key)
        replace_file(file, data + hashlib.sha256(data).digest())
        keep_newest(file.parent.glob("*.npz"), _KEPT)
    except (OSError, RuntimeError):
        return False
    return True


def _file(folder: str, key: str) -> Path:
    """Where arrays are kept.

    Raises:
        RuntimeError: The user has no home.
    """
    return user_cache(folder) / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npz"


def _stored(file: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an .npz file as `np.savez` writes it, none larger than its bytes in the file.

    A digest follows: the format's own checksums do not see that entries are left out.

    Raises:
        Exception: It is missing or damaged.
    """
    content_and_digest = read_bytes(file)
    size = len(content_and_digest) - hashlib.sha256().digest_size
    data, digest = content_and_digest[:size], content_and_digest[size:]
    if hashlib.sha256(data).digest() != digest:
        raise ValueError(f"{file} is damaged")
    arrays = {}
    with zipfile.ZipFile(io.BytesIO(data)) as stored:
        for entry in stored.infolist():
            if entry.compress_type != zipfile.ZIP_STORED:
                raise ValueError(f"{entry.filename} is compressed")
            content = io.BytesIO(stored.read(entry))
            if npy.read_magic(content) != (1, 0):
                raise ValueError(f"{entry.filename} has another version")
            shape, fortran, dtype = npy.read_array_header_1_0(content)
            start = content.tell()
            body = content.getbuffer()
            if dtype.hasobject or math.prod(shape) * dtype.itemsize != len(body) - start:
                raise ValueError(f"{entry.filename} does not fit its header")
            array = np.frombuffer(body, dtype, offset=start).reshape(
                shape, order="F" if fortran else "C"
            )
            arrays[entry.filename.removesuffix(".npy")] = array.copy(order="K")
    return arrays


def replace_file(file: Path, data: bytes) -> None:
    """Writes all of a file or nothing, and never half of it for who reads at the same time.

    Raises:
        OSError: It cannot be written; what was there stays.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".part", delete=False) as partial:
        try:
            partial.write(data)
            partial.close()
            os.replace(partial.name, file)
        except OSError:
            Path(partial.name).unlink(missing_ok=True)
            raise


def keep_newest(files: Iterable[Path], count: int) -> None:
    """Removes all but the `count` files that were changed or used last."""
    for old in sorted(files, key=lambda file: file.stat().st_mtime)[:-count]:
        old.unlink(missing_ok=True)
