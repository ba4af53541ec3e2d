"""Collider sets as JSON text: what `collider_description` carries and `fit --out` writes.

The text is canonical: the same set gives the same bytes, and reading it back gives the same
bits, so that its revision (SHA-256 of the geometry) is checked on arrival. Incoming text is
never trusted. Arrays are lists of numbers, but for the samples of an sdf: an object with their
``shape`` and, under ``int16``, the little-endian bytes in base64, x slowest.
"""

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.contact.ellipsoid_refit import refit_entries
from garment_sim_ros.contact.kinds import KINDS
from garment_sim_ros.contact.kinds.entries import (
    REASON,
    Entries,
    checked_number,
    checked_object,
    checked_vector,
)
from garment_sim_ros.contact.mesh.skinned import SkinnedMesh
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.errors import GeometryError, InputFileError, MessageError
from garment_sim_ros.input_file import read_text
from garment_sim_ros.plain_data import PlainDataError, parse_json

VERSION = 1
MAX_TEXT = 16 * 2**20
"""Longest text that is parsed, in characters."""
MAX_COLLIDERS = 4096
MAX_NAME = 256

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
        raise MessageError(REASON, f"{len(text)} characters; at most {MAX_TEXT} are allowed")
    try:
        document = parse_json(text)
    except PlainDataError as error:
        raise MessageError(REASON, f"not JSON: {error}") from None
    top = checked_object(document, "the document", _TOP_KEYS)
    if type(top["version"]) is not int or top["version"] != VERSION:
        raise MessageError(REASON, f"version {top['version']!r}; allowed: {VERSION}")
    entries = top["colliders"]
    if not isinstance(entries, list) or len(entries) > MAX_COLLIDERS:
        raise MessageError(REASON, f"colliders must be a list of at most {MAX_COLLIDERS}")
    try:
        colliders = ColliderSet(
            colliders=tuple(_collider(entry, i) for i, entry in enumerate(entries)),
            thickness=checked_number(top["thickness"], "thickness", 0.0, 1.0),
            frame_id=_name(top["frame_id"], "frame_id"),
        )
        if colliders.has_skin:
            SkinnedMesh.only(colliders)
        for collider in colliders.colliders:
            if collider.record.is_bare:
                SkinnedMesh(colliders, collider)
        refit_entries(colliders)
    except GeometryError as error:
        raise MessageError(REASON, str(error)) from None
    if top["revision"] != colliders.revision:
        raise MessageError(
            REASON,
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


def _name(value: Any, what: str) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= MAX_NAME:
        raise MessageError(REASON, f"{what} must be a text of 1 to {MAX_NAME} characters")
    return value


def _collider(entry: Any, index: int) -> Collider:
    what = f"collider {index}"
    fields = checked_object(entry, what, _COLLIDER_KEYS)
    kind = fields["kind"]
    if not isinstance(kind, str) or kind not in KINDS:
        raise MessageError(REASON, f"{what} has kind {kind!r:.80}; allowed: {', '.join(KINDS)}")
    pose = checked_object(
        fields["pose_in_bone"], f"{what} pose_in_bone", ("position", "orientation")
    )
    orientation = checked_vector(pose["orientation"], f"{what} orientation", 4)
    if abs(np.linalg.norm(orientation) - 1.0) > 1e-6:
        raise MessageError(REASON, f"{what} orientation must be a unit quaternion")
    geometry = Entries(fields["geometry"], what)
    geometry.only(KINDS[kind].keys, KINDS[kind].optional)
    return Collider(
        name=_name(fields["name"], f"{what} name"),
        kind=kind,
        bone=_name(fields["bone"], f"{what} bone"),
        position=checked_vector(pose["position"], f"{what} position", 3),
        orientation=orientation,
        geometry=KINDS[kind].parse(geometry),
    )
