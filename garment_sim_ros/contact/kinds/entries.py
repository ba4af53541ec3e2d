"""Entries of a collider's geometry from a description that nobody has checked.

Arrays are lists of numbers, but for the samples of a distance: an object with their ``shape`` and,
under ``int16``, the little-endian bytes in base64, x slowest.
"""

import base64
import binascii
from collections.abc import Iterable, Mapping
from typing import Any, NoReturn

import numpy as np

from garment_sim_ros.errors import MessageError
from garment_sim_ros.plain_data import number_kinds

MAX_COORDINATE = 1e6
"""Largest magnitude of any number [m]; more is a unit error or an attack."""
REASON = "collider_description"


class Entries:
    """A geometry's entries, each checked as it is asked for.

    Args:
        value: What should be an object.
        what: Whose geometry it is, for messages.

    Raises:
        MessageError: Not an object; of each method: not what is asked for.
    """

    def __init__(self, value: object, what: str) -> None:
        if not isinstance(value, dict):
            raise MessageError(REASON, f"{what} geometry must be an object")
        self._of: Mapping[str, Any] = value
        self.what = what

    def __contains__(self, key: str) -> bool:
        return key in self._of

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the entries there are."""
        return tuple(self._of)

    def only(self, required: Iterable[str], optional: Iterable[str] = ()) -> None:
        """Refuses missing and other entries."""
        checked_object(self._of, f"{self.what} geometry", required, optional)

    def number(self, key: str, minimum: float, maximum: float = MAX_COORDINATE) -> float:
        """A number within a range."""
        return checked_number(self._of[key], f"{self.what} {key}", minimum, maximum)

    def share(self) -> dict[str, object]:
        """How much of a joint's rotation the collider makes, where that is told."""
        return {"share": self.number("share", 0.0, 1.0)} if "share" in self else {}

    def array(self, key: str) -> np.ndarray:
        """A rectangular array of finite numbers, int64 or float64."""
        return checked_array(self._of[key], f"{self.what} {key}")

    def vector(self, key: str, size: int) -> np.ndarray:
        """So many numbers, float64."""
        return checked_vector(self._of[key], f"{self.what} {key}", size)

    def samples(self, key: str) -> np.ndarray:
        """Samples of a distance, shape [nx, ny, nz], int16."""
        fields = checked_object(self._of[key], f"{self.what} {key}", ("shape", "int16"))
        shape, text = fields["shape"], fields["int16"]
        if (
            not isinstance(shape, list)
            or len(shape) != 3
            or any(type(n) is not int for n in shape)
        ):
            self.refuse(f"{key} shape is {shape!r:.80}; allowed: 3 whole numbers")
        try:
            samples = np.frombuffer(base64.b64decode(text, validate=True), "<i2")
        except (TypeError, ValueError, binascii.Error):
            self.refuse(f"{key} int16 must be 16-bit numbers in base64")
        if min(shape) < 1 or shape[0] * shape[1] * shape[2] != len(samples):
            self.refuse(f"{key} has {len(samples)} samples; its shape is {shape}")
        return samples.reshape(shape).astype(np.int16)

    def refuse(self, words: str) -> NoReturn:
        """Refuses the geometry, in words that follow its owner's name."""
        raise MessageError(REASON, f"{self.what} {words}")


def checked_object(
    value: Any, what: str, required: Iterable[str], optional: Iterable[str] = ()
) -> dict[str, Any]:
    """An object with certain entries; `what` it is, for messages."""
    required = set(required)
    if not isinstance(value, dict) or not required <= set(value) <= required | set(optional):
        found = sorted(value)[:20] if isinstance(value, dict) else type(value).__name__
        raise MessageError(REASON, f"{what} has {found}; required: {sorted(required)}")
    return value


def checked_number(value: Any, what: str, minimum: float, maximum: float) -> float:
    """A number within a range; `what` it is, for messages."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MessageError(REASON, f"{what} is {value!r:.80}; allowed: a number")
    if not minimum <= value <= maximum:  # false for NaN, too
        raise MessageError(REASON, f"{what} is {value!r:.80}; allowed: {minimum} to {maximum}")
    return float(value)


def checked_array(value: Any, what: str) -> np.ndarray:
    """A rectangular array of finite numbers, int64 or float64; `what` it is, for messages."""
    if not number_kinds(value) and value != []:
        raise MessageError(REASON, f"{what} must hold numbers only")
    try:
        array = np.asarray(value)
    except (ValueError, OverflowError):
        raise MessageError(REASON, f"{what} must be a rectangular list of numbers") from None
    if array.dtype.kind not in "iuf":
        raise MessageError(REASON, f"{what} must hold numbers of at most 64 bits")
    near = (array >= -MAX_COORDINATE) & (array <= MAX_COORDINATE)
    if not near.all():
        raise MessageError(REASON, f"{what}: magnitudes up to {MAX_COORDINATE:g} are allowed")
    return array


def checked_vector(value: Any, what: str, size: int) -> np.ndarray:
    """So many numbers, float64; `what` they are, for messages."""
    array = checked_array(value, what)
    if array.shape != (size,):
        raise MessageError(REASON, f"{what} has shape {array.shape}; allowed: {size} numbers")
    return array.astype(np.float64)
