"""What a node says of time that it had not the time for."""

from collections.abc import Callable

from garment_sim_ros.stamps import SECOND

PERIOD = 9 * SECOND // 10
"""Looks that follow sooner than this say the same again [ns]."""
LEAST = SECOND // 10
"""Less time than this between two looks is a hiccup, and not told [ns]."""
QUIET = 60 * SECOND
"""Time in which it is logged once [ns]."""
EXCUSED = 3 * SECOND // 2
"""After time that nobody could have used, so long nothing is told [ns]."""


class Overload:
    """Compares, from look to look, how much time was simulated coarsely or passed over.

    Args:
        log: Takes a line of text.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._before = (0, 0)
        self._looked: int | None = None
        self._logged: int | None = None
        self._excused = 0
        self._told = ""

    def excuse(self, now: int) -> None:
        """Time is about to be passed over for want of input, or after a pause.

        Args:
            now: On a clock that only runs forward [ns].
        """
        self._excused = now + EXCUSED

    def look(self, coarse: int, skipped: int, now: int) -> str:
        """What was lost since the look before, in words; empty where that is next to nothing.

        Args:
            coarse: Time that was simulated in coarse steps, so far [ns].
            skipped: Time that was passed over, so far [ns].
            now: On a clock that only runs forward [ns].
        """
        if self._looked is not None and now < self._looked + PERIOD:
            return self._told
        self._looked = now
        # New garments begin to count anew.
        coarser, passed = (
            count - before if count >= before else count
            for count, before in zip((coarse, skipped), self._before)
        )
        self._before = coarse, skipped
        self._told = ""
        if coarser + passed < LEAST or now < self._excused:
            return ""
        told = [f"{coarser / SECOND:.2f} s in coarse steps"] if coarser else []
        told += [f"{passed / SECOND:.2f} s passed over"] if passed else []
        self._told = f"too slow: {' and '.join(told)}"
        if self._logged is None or now >= self._logged + QUIET:
            self._logged = now
            self._log(
                f"{self._told}; a cheaper preset, a lower rate or fewer vertices would keep time"
            )
        return self._told
