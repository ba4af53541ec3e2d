"""Whether a stamp may follow those before it."""

from garment_sim_ros.errors import MessageError
from garment_sim_ros.stamps import SECOND

BACKWARDS = "stamp_backwards"
JUMP = "stamp_jump"
AWAY = SECOND // 4
"""A receiver that did not look for so long [ns] was away: a machine that stands still, or has too
much to do. Whoever sent meanwhile is not to blame for the gap."""
_WAITING = 50
"""Messages that may have waited for the receiver and be taken first."""
_FOREVER = 2**63
_RUN = SECOND // 10
_FEWEST = 3
"""Old stamps that follow on each other are a time of their own once they are so many and cover so
much [ns]: a clip that is shorter than a jump begins again, or a clock was set back a little."""


class StampOrder:
    """Accepts increasing stamps, and a new time when two messages agree on it.

    One stray stamp far away is rejected. A clip or bag that begins again, or an input that comes
    back after a while, is taken up with its second message; one that goes back by less than a jump
    once its messages have followed on each other for a moment, with no newer one between.

    Args:
        time_jump: Stamps farther apart belong to different times [s].

    Attributes:
        newest: The last accepted stamp [ns], None before the first.
        jumps: New times that began, the first and those of other senders not counted.
    """

    def __init__(self, time_jump: float) -> None:
        self.newest: int | None = None
        self._limit = round(time_jump * SECOND)
        self.jumps = 0
        self._elsewhere: int | None = None
        self._old: list[int] = []
        self._away = self._excused = 0

    def excuse_gap(self, away: int | None = None) -> None:
        """Take one later stamp though it is far: its receiver was away, not its sender.

        Args:
            away: For how long [ns]: one of the next stamps is excused, as some from before may be
                waiting. None: the next one is, however far it is.
        """
        self._away = _FOREVER if away is None else away
        self._excused = 1 if away is None else _WAITING

    def begin(self, stamp: int) -> None:
        """Begin a new time with a stamp [ns]: it is another sender's."""
        self.newest = stamp
        self._elsewhere, self._old, self._away = None, [], 0

    def accept(self, stamp: int) -> bool:
        """Take a stamp [ns].

        Returns:
            Whether a new time begins with it.

        Raises:
            MessageError: It is not newer than the last one, or far from it for the first time.
        """
        before, self._elsewhere = self._elsewhere, None
        self._excused -= 1
        away = self._away if self._excused >= 0 else 0
        if self.newest is None:
            self.newest = stamp
            return True
        step = stamp - self.newest
        if 0 < step <= self._limit + away:
            if step > self._limit:
                self._away = 0
            self.newest = stamp
            self._old = []
            return False
        if -self._limit <= step <= 0:
            if self._old and stamp <= self._old[-1]:
                self._old = []
            self._old.append(stamp)
            if len(self._old) < _FEWEST or stamp - self._old[0] < _RUN:
                raise MessageError(
                    BACKWARDS,
                    f"stamp is {1e-9 * step:+.3f} s from the newest one; allowed: above 0 s",
                )
            return self._jump(stamp)
        if before is not None and 0 < stamp - before <= self._limit:
            return self._jump(stamp)
        self._elsewhere = stamp
        raise MessageError(
            JUMP,
            f"stamp is {1e-9 * step:+.3f} s from the newest one; allowed: up to time_jump, "
            f"{1e-9 * self._limit:g} s, or farther if the next message agrees",
        )

    def _jump(self, stamp: int) -> bool:
        self.begin(stamp)
        self.jumps += 1
        return True
