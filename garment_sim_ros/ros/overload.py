"""What a node says of time that it had not the time for."""

from collections.abc import Callable

from garment_sim_ros.stamps import SECOND

LEAST = SECOND // 10
"""Less time than this between two looks is a hiccup, and not told [ns]."""
QUIET = 60 * SECOND
"""Time in which it is logged once [ns]."""


class Overload:
    """Compares, from look to look, how much time was simulated coarsely or passed over.

    Args:
        log: Takes a line of text.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._coarse = self._skipped = 0
        self._logged: int | None = None

    def look(self, coarse: int, skipped: int, now: int) -> str:
        """What was lost since the look before, in words; empty where that is next to nothing.

        Args:
            coarse: Time that was simulated in coarse steps, so far [ns].
            skipped: Time that was passed over, so far [ns].
            now: On a clock that only runs forward [ns].
        """
        # New garments begin to count anew.
        coarser = coarse - (self._coarse if coarse >= self._coarse else 0)
        passed = skipped - (self._skipped if skipped >= self._skipped else 0)
        self._coarse, self._skipped = coarse, skipped
        if coarser + passed < LEAST:
            return ""
        told = [f"{coarser / SECOND:.2f} s in coarse steps"] if coarser else []
        told += [f"{passed / SECOND:.2f} s passed over"] if passed else []
        text = f"too slow: {' and '.join(told)}"
        if self._logged is None or now >= self._logged + QUIET:
            self._logged = now
            self._log(f"{text}; a cheaper preset, a lower rate or fewer vertices would keep time")
        return text
