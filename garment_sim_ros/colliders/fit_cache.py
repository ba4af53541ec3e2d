"""Fits that are kept and used again, as long as body, options and code are the same.

A file lies beside the body's, or in the user's cache folder where that cannot be written or the
body has no file. It is named after the digest of all that the fit depends on, which its first
line holds too; the rest is a collider description, whose revision shows any damage.

The default mannequin's hulls come with the package, so that the first start need not compile what
fits them. Their file is named after no code: `make mannequin` makes it anew.
"""

import contextlib
import dataclasses
import hashlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.description import MAX_TEXT, from_json, to_json
from garment_sim_ros.colliders.fitting import fitted
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.disk_cache import code_digest, keep_newest, replace_file, user_cache
from garment_sim_ros.errors import InputFileError, MessageError
from garment_sim_ros.input_file import exists, is_file, read_text
from garment_sim_ros.params import ColliderOptions

_SUFFIX = ".colliders"
SHIPPED = Path(__file__).resolve().parent / "hulls" / f"mannequin_default{_SUFFIX}"
"""Fit of the default mannequin with the default options."""
_KEPT = 4
"""Files of one body and method in one folder; the oldest go first."""


def cached_fit(
    body: Body,
    options: ColliderOptions,
    source: str | Path | None,
    log: Callable[[str], Any] = lambda text: None,
) -> ColliderSet:
    """What `fit_colliders` returns, from a file where it was kept.

    A file that is damaged or cannot be written only costs the time to fit.

    Args:
        body: Rig and skin.
        options: Method and its settings.
        source: The body's file, or None; what is not a file counts as None.
        log: Is told where the fit comes from.

    Raises:
        GeometryError: The body cannot be fitted.
        ParameterError: An option is out of range.
    """
    key = fit_key(body, options)
    folders = _folders(source)
    label = Path(source).name if len(folders) > 1 and source is not None else body.name
    stem = "".join(c if c.isalnum() or c in "._-" else "_" for c in label)[:80]
    name = f"{stem}.{options.method}.{key[:16]}{_SUFFIX}"
    if (found := _read(SHIPPED, content_key(body, options), lambda text: None)) is not None:
        return found
    for folder in folders:
        if (found := _read(folder / name, key, log)) is not None:
            return found
    fit = fitted(body, options)
    colliders = fit.colliders
    for line in fit.missed:
        log(line)
    for folder in folders:
        try:
            _write(folder, name, kept_text(key, colliders))
        except OSError:
            continue
        log(f"colliders fitted and kept in {folder / name}")
        return colliders
    log("colliders fitted; nowhere to keep them")
    return colliders


def fit_key(body: Body, options: ColliderOptions) -> str:
    """SHA-256 of all that a fit depends on: the body's content, the options, the code."""
    code = code_digest("body", "colliders", "contact", "geometry")
    return hashlib.sha256((content_key(body, options) + code).encode()).hexdigest()


def content_key(body: Body, options: ColliderOptions) -> str:
    """The same without the code."""
    digest = hashlib.sha256()
    for piece in _pieces((body.rig, body.skin, body.humanoid, options)):
        digest.update(piece)
    return digest.hexdigest()


def kept_text(key: str, colliders: ColliderSet) -> str:
    """What the file of a fit holds."""
    return f"{key}\n{to_json(colliders)}"


def _read(file: Path, key: str, log: Callable[[str], Any]) -> ColliderSet | None:
    """The fit in a file; None where there is none, or it is damaged or of something else."""
    try:
        found, text = read_text(file, limit=MAX_TEXT).split("\n", 1)
        if found != key:
            raise ValueError("it is of another fit")
        colliders = from_json(text)
    except (InputFileError, MessageError, ValueError) as error:
        if exists(file):
            log(f"{file} is not used: {error}"[:500])
        return None
    log(f"colliders read from {file}")
    return colliders


def _pieces(value: object) -> Iterator[bytes]:
    """Bytes that differ for different values."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield field.name.encode()
            yield from _pieces(getattr(value, field.name))
    elif isinstance(value, Mapping):
        yield from _pieces(tuple(sorted(value.items())))
    elif isinstance(value, tuple):
        yield f"({len(value)}".encode()
        for item in value:
            yield from _pieces(item)
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    else:
        yield repr(value).encode() + b"|"


def _folders(source: str | Path | None) -> list[Path]:
    """Where a fit may lie, the first choice first."""
    folders = []
    if source is not None and is_file(source):
        folders.append(Path(source).resolve().parent)
    with contextlib.suppress(RuntimeError):  # a user without a home
        folders.append(user_cache("colliders"))
    return folders


def _write(folder: Path, name: str, text: str) -> None:
    """All or nothing; older fits of the same body and method make room."""
    replace_file(folder / name, text.encode())
    body_and_method = name.rsplit(".", 2)[0]
    kept = [f for f in folder.iterdir() if f.name.startswith(f"{body_and_method}.")]
    keep_newest((f for f in kept if f.suffix == _SUFFIX), _KEPT)
