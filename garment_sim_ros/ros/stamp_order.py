"""Whether a stamp may follow those before it."""

from garment_sim_ros.errors import MessageError
from garment_sim_ros.stamps import SECOND

BACKWARDS = "stamp_backwards"
JUMP = "stamp_jump"


class StampOrder:
    """Accepts increasing stamps, and a new time when two messages agree on it.

    One stray stamp far away is rejected. A clip or bag that begins again, or an input that comes
    back after a while, is taken up with its second message.

    Args:
        time_jump: Stamps farther apart belong to different times [s].

    Attributes:
        newest: The last accepted stamp [ns], None before the first.
    """

    def __init__(self, time_jump: float) -> None:
        self.newest: int | None = None
        self._limit = round(time_jump * SECOND)
        self._elsewhere: int | None = None
        self._was_away = False

    def excuse_gap(self) -> None:
        """Take the next later stamp however far it is: its receiver was away, not its sender."""
        self._was_away = True

    def begin(self, stamp: int) -> None:
        """Begin a new time with a stamp [ns]: it is another sender's."""
        self.newest = stamp
        self._elsewhere, self._was_away = None, False

    def accept(self, stamp: int) -> bool:
        """Take a stamp [ns].

        Returns:
            Whether a new time begins with it.

        Raises:
            MessageError: It is not newer than the last one, or far from it for the first time.
        """
        before, self._elsewhere = self._elsewhere, None
        was_away, self._was_away = self._was_away, False
        if self.newest is None:
            self.newest = stamp
            return True
        step = stamp - self.newest
        if 0 < step <= self._limit or (was_away and step > 0):
            self.newest = stamp
            return False
        if -self._limit <= step <= 0:
            raise MessageError(BACKWARDS, f"{1e-9 * step:+.3f} s from the newest; allowed: newer")
        if before is not None and 0 < stamp - before <= self._limit:
            self.newest = stamp
            return True
        self._elsewhere = stamp
        raise MessageError(
            JUMP,
            f"{1e-9 * step:+.3f} s from the newest; allowed: to {1e-9 * self._limit:g} s, or "
            "farther with the next one",
        )
