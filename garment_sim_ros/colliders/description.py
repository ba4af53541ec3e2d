"""Collider sets as JSON text: what `collider_description` carries and `fit --out` writes.

The text is canonical: the same set gives the same bytes, and reading it back gives the same
bits, so that its revision (SHA-256 of the geometry) is checked on arrival. Incoming text is
never trusted. Arrays are lists of numbers, but for the samples of an sdf: an object with their
``shape`` and, under ``int16``, the little-endian bytes in base64, x slowest.
"""

import base64
import binascii
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.contact.ellipsoid_refit import REFIT_KEYS, refit_entries
from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.contact.mesh.skinned import SkinnedMesh
from garment_sim_ros.contact.shapes import KINDS, Collider, ColliderSet
from garment_sim_ros.errors import GeometryError, InputFileError, MessageError
from garment_sim_ros.input_file import read_text
from garment_sim_ros.plain_data import PlainDataError, number_kinds, parse_json

VERSION = 1
MAX_TEXT = 16 * 2**20
"""Longest text that is parsed, in characters."""
MAX_COLLIDERS = 4096
MAX_NAME = 256
MAX_COORDINATE = 1e6
"""Largest magnitude of any number [m]; more is a unit error or an attack."""

_REASON = "collider_description"
_TOP_KEYS = {"version", "revision", "frame_id", "thickness", "colliders"}
_COLLIDER_KEYS = {"name", "kind", "bone", "pose_in_bone", "geometry"}


def to_json(colliders: ColliderSet) -> str:
    """Canonical JSON text of a set."""
    document = {
        "version": VERSION,
        "revision": colliders.revision,
        "frame_id": colliders.frame_id,
        "thickness": float(colliders.thickness),
        "colliders": [
            {
                "name": c.name,
                "kind": c.kind,
                "bone": c.bone,
                "pose_in_bone": {
                    "position": c.position.tolist(),
                    "orientation": c.orientation.tolist(),
                },
                "geometry": {key: _plain(c.geometry[key]) for key in sorted(c.geometry)},
            }
            for c in colliders.colliders
        ],
    }
    return json.dumps(document, separators=(",", ":"), allow_nan=False)


def from_json(text: str) -> ColliderSet:
    """A set from untrusted text.

    Raises:
        MessageError: Not JSON, wrong types, sizes, ranges, unknown keys or a revision that is not
            that of the geometry.
    """
    if len(text) > MAX_TEXT:
        raise MessageError(_REASON, f"{len(text)} characters; at most {MAX_TEXT} are allowed")
    try:
        document = parse_json(text)
    except PlainDataError as error:
        raise MessageError(_REASON, f"not JSON: {error}") from None
    top = _object(document, _TOP_KEYS, "the document")
    if type(top["version"]) is not int or top["version"] != VERSION:
        raise MessageError(_REASON, f"version {top['version']!r}; allowed: {VERSION}")
    entries = top["colliders"]
    if not isinstance(entries, list) or len(entries) > MAX_COLLIDERS:
        raise MessageError(_REASON, f"colliders must be a list of at most {MAX_COLLIDERS}")
    try:
        colliders = ColliderSet(
            colliders=tuple(_collider(entry, i) for i, entry in enumerate(entries)),
            thickness=_number(top["thickness"], "thickness", 0.0, 1.0),
            frame_id=_name(top["frame_id"], "frame_id"),
        )
        if any(c.kind == "mesh" for c in colliders.colliders):
            SkinnedMesh(colliders)
        refit_entries(colliders)
    except GeometryError as error:
        raise MessageError(_REASON, str(error)) from None
    if top["revision"] != colliders.revision:
        raise MessageError(
            _REASON,
            f"revision {str(top['revision'])[:80]!r} is not that of its geometry; "
            f"allowed: {colliders.revision}",
        )
    return colliders


def save_colliders(path: str | Path, colliders: ColliderSet) -> None:
    """Write a set to a file."""
    Path(path).write_text(to_json(colliders) + "\n", encoding="utf-8")


def load_colliders(path: str | Path) -> ColliderSet:
    """Read a set from a file.

    Raises:
        InputFileError: Missing, unreadable or not a collider description.
    """
    allowed = "a collider description as `fit --out` writes it"
    try:
        return from_json(read_text(path, limit=MAX_TEXT))
    except MessageError as error:
        raise InputFileError(path, str(error), f"allowed: {allowed}") from None


def _plain(value: object) -> Any:
    array = np.asarray(value)
    if array.dtype == np.int16:
        text = base64.b64encode(array.astype("<i2").tobytes()).decode("ascii")
        return {"shape": list(array.shape), "int16": text}
    return (array if array.dtype.kind in "iu" else array.astype(np.float64)).tolist()


def _object(value: Any, keys: set[str], what: str) -> dict[str, Any]:
    if not isinstance(value, dict) or set(value) != keys:
        found = sorted(value)[:20] if isinstance(value, dict) else type(value).__name__
        raise MessageError(_REASON, f"{what} has {found}; required: {sorted(keys)}")
    return value


def _name(value: Any, what: str) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= MAX_NAME:
        raise MessageError(_REASON, f"{what} must be a text of 1 to {MAX_NAME} characters")
    return value


def _number(value: Any, what: str, minimum: float, maximum: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MessageError(_REASON, f"{what} is {value!r:.80}; allowed: a number")
    if not minimum <= value <= maximum:  # false for NaN, too
        raise MessageError(_REASON, f"{what} is {value!r:.80}; allowed: {minimum} to {maximum}")
    return float(value)


def _array(value: Any, what: str) -> np.ndarray:
    """A rectangular array of finite numbers, int64 or float64."""
    if not number_kinds(value) and value != []:
        raise MessageError(_REASON, f"{what} must hold numbers only")
    try:
        array = np.asarray(value)
    except (ValueError, OverflowError):
        raise MessageError(_REASON, f"{what} must be a rectangular list of numbers") from None
    if array.dtype.kind not in "iuf":
        raise MessageError(_REASON, f"{what} must hold numbers of at most 64 bits")
    near = (array >= -MAX_COORDINATE) & (array <= MAX_COORDINATE)
    if not near.all():
        raise MessageError(_REASON, f"{what}: magnitudes up to {MAX_COORDINATE:g} are allowed")
    return array


def _samples(value: Any, what: str) -> np.ndarray:
    """Samples of a distance [nx, ny, nz]."""
    fields = _object(value, {"shape", "int16"}, what)
    shape, text = fields["shape"], fields["int16"]
    if not isinstance(shape, list) or len(shape) != 3 or any(type(n) is not int for n in shape):
        raise MessageError(_REASON, f"{what} shape is {shape!r:.80}; allowed: 3 whole numbers")
    try:
        samples = np.frombuffer(base64.b64decode(text, validate=True), "<i2")
    except (TypeError, ValueError, binascii.Error):
        raise MessageError(_REASON, f"{what} int16 must be 16-bit numbers in base64") from None
    if min(shape) < 1 or shape[0] * shape[1] * shape[2] != len(samples):
        raise MessageError(_REASON, f"{what} has {len(samples)} samples; its shape is {shape}")
    return samples.reshape(shape).astype(np.int16)


def _vector(value: Any, what: str, size: int) -> np.ndarray:
    array = _array(value, what)
    if array.shape != (size,):
        raise MessageError(_REASON, f"{what} has shape {array.shape}; allowed: {size} numbers")
    return array.astype(np.float64)


def _collider(entry: Any, index: int) -> Collider:
    what = f"collider {index}"
    fields = _object(entry, _COLLIDER_KEYS, what)
    kind = fields["kind"]
    if kind not in KINDS:
        raise MessageError(_REASON, f"{what} has kind {kind!r:.80}; allowed: {', '.join(KINDS)}")
    pose = _object(fields["pose_in_bone"], {"position", "orientation"}, f"{what} pose_in_bone")
    orientation = _vector(pose["orientation"], f"{what} orientation", 4)
    if abs(np.linalg.norm(orientation) - 1.0) > 1e-6:
        raise MessageError(_REASON, f"{what} orientation must be a unit quaternion")
    if not isinstance(fields["geometry"], dict):
        raise MessageError(_REASON, f"{what} geometry must be an object")
    return Collider(
        name=_name(fields["name"], f"{what} name"),
        kind=kind,
        bone=_name(fields["bone"], f"{what} bone"),
        position=_vector(pose["position"], f"{what} position", 3),
        orientation=orientation,
        geometry=_geometry(kind, fields["geometry"], what),
    )


def _geometry(kind: str, geometry: dict[str, Any], what: str) -> Mapping[str, object]:
    """Checked geometry; other kinds than the simple ones are checked by who uses them."""
    simple = {
        "sphere": {"radius"},
        "capsule": {"radius0", "radius1", "length"},
        "ellipsoid": {"radii"},
        "hull": {"vertices", "faces"},
        "sdf": {"cell", "step", "distance"},
        "mesh": {"vertices", "triangles", "frame", "weight", "bind"},
        "frame": set(),
    }
    if kind in simple:
        optional = {"share"} & set(geometry) if kind in ("sphere", "hull", "sdf") else set()
        if kind == "ellipsoid" and "points" in geometry:
            optional = set(REFIT_KEYS)
        _object(geometry, simple[kind] | optional, f"{what} geometry")
    shared: dict[str, object] = {}
    if "share" in geometry and kind in simple:
        shared["share"] = _number(geometry["share"], f"{what} share", 0.0, 1.0)
    if kind == "sphere":
        radius = _number(geometry["radius"], f"{what} radius", 1e-9, MAX_COORDINATE)
        return {"radius": radius, **shared}
    if kind == "capsule":
        values = {
            key: _number(geometry[key], f"{what} {key}", 0.0, MAX_COORDINATE)
            for key in ("radius0", "radius1", "length")
        }
        if max(values["radius0"], values["radius1"]) <= 0.0:
            raise MessageError(_REASON, f"{what}: both radii are 0; one must be positive")
        return values
    if kind == "ellipsoid":
        radii = _vector(geometry["radii"], f"{what} radii", 3)
        if radii.min() <= 0.0:
            raise MessageError(_REASON, f"{what} radii must be positive")
        refit = {k: _array(geometry[k], f"{what} {k}") for k in REFIT_KEYS if k in geometry}
        return {"radii": radii, **refit}
    if kind == "hull":
        vertices = _array(geometry["vertices"], f"{what} vertices").astype(np.float64)
        faces = _array(geometry["faces"], f"{what} faces")
        for label, array in (("vertices", vertices), ("faces", faces)):
            if array.ndim != 2 or array.shape[1] != 3 or len(array) < 4:
                raise MessageError(
                    _REASON, f"{what} {label} has shape {array.shape}; allowed: [4 or more, 3]"
                )
        if faces.dtype.kind == "f" or faces.min() < 0 or faces.max() >= len(vertices):
            raise MessageError(_REASON, f"{what} faces must be indices 0..{len(vertices) - 1}")
        return {"vertices": vertices, "faces": faces.astype(np.int32), **shared}
    if kind == "sdf":
        grid = DistanceGrid(
            cell=_number(geometry["cell"], f"{what} cell", 1e-9, MAX_COORDINATE),
            step=_number(geometry["step"], f"{what} step", 1e-12, MAX_COORDINATE),
            distance=_samples(geometry["distance"], f"{what} distance"),
        )
        return {**grid.geometry(), **shared}
    return {_name(key, f"{what} key"): _array(geometry[key], f"{what} {key}") for key in geometry}
