"""Serialization of messages in Common Data Representation, little endian, every byte defined.

The middleware's own serializer leaves whatever was in memory in the gaps that align numbers, so
that the same message may have other bytes next time. This one, written after the types that a
message declares, puts zeros there. It is slow; `serialize` uses it once per template. (CDR:
OMG, DDS-XTypes 1.3, 7.4.1, "plain CDR" version 1, as ROS 2 uses it.)
"""

import struct
from typing import Any

from rosidl_parser.definition import (
    AbstractSequence,
    AbstractString,
    Array,
    BasicType,
    NamespacedType,
)

_FORMATS = {
    **{"boolean": "?", "octet": "B", "uint8": "B", "int8": "b", "char": "B"},
    **{"uint16": "H", "int16": "h", "uint32": "I", "int32": "i"},
    **{"uint64": "Q", "int64": "q", "float": "f", "double": "d"},
}


def encode(message: Any, padding: bytes = b"\0") -> bytes:
    """The bytes of a message.

    Args:
        message: Any ROS message without wide strings.
        padding: The byte that fills gaps.
    """
    out = bytearray()
    _message(out, message, padding)
    return b"\x00\x01\x00\x00" + bytes(out)


def _message(out: bytearray, message: Any, padding: bytes) -> None:
    for slot, kind in zip(message.__slots__, message.SLOT_TYPES):
        if slot != "_check_fields":
            _value(out, getattr(message, slot), kind, padding)


def _value(out: bytearray, value: Any, kind: Any, padding: bytes) -> None:
    if isinstance(kind, BasicType):
        _numbers(out, value if isinstance(value, bytes) else (value,), kind, padding)
    elif isinstance(kind, AbstractString):
        text = value.encode() + b"\0"
        _numbers(out, (len(text),), BasicType("uint32"), padding)
        out += text
    elif isinstance(kind, NamespacedType):
        _message(out, value, padding)
    elif isinstance(kind, AbstractSequence | Array):
        if isinstance(kind, AbstractSequence):
            _numbers(out, (len(value),), BasicType("uint32"), padding)
        if isinstance(kind.value_type, BasicType):
            _numbers(out, value, kind.value_type, padding)
        else:
            _items(out, value, kind.value_type, padding)
    else:
        raise TypeError(f"cannot serialize {kind}")


def _items(out: bytearray, items: Any, kind: Any, padding: bytes) -> None:
    for done, item in enumerate(items):
        start = len(out)
        _value(out, item, kind, padding)
        # One object many times over, as in a template, has the same bytes again and again.
        if done == 1 and len(out) % 8 == start % 8 and all(other is item for other in items):
            out += out[start:] * (len(items) - 2)
            return


def _numbers(out: bytearray, values: Any, kind: BasicType, padding: bytes) -> None:
    if len(values):
        code = _FORMATS[kind.typename]
        out += padding * (-len(out) % struct.calcsize(code))
        out += struct.pack(f"<{len(values)}{code}", *values)
