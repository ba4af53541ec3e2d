"""Stamps of messages: integer nanoseconds, which neither round nor drift."""

from typing import Protocol

SECOND = 1_000_000_000
"""One second [ns]."""


class Stamp(Protocol):
    """What is read of a builtin_interfaces/Time, of any library's."""

    @property
    def sec(self) -> int:
        """Whole seconds [s]."""

    @property
    def nanosec(self) -> int:
        """The rest [ns]."""


def nanoseconds(stamp: Stamp) -> int:
    """A message's stamp [ns]."""
    return int(stamp.sec) * SECOND + int(stamp.nanosec)
