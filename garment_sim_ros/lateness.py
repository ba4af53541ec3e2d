"""When a frame is late: the one rule, for the node that counts and for all that read its count.

A frame is due at a time of its node's timer grid. It is late where its garments are published
more than half a period after that, or left out because the one before took too long. Only the
node knows when a frame was due, so only the node judges. It tells its count in every message on
`quality`; how many frames of a recording were late is the difference between two such counts.
"""

from garment_sim_ros.arrays import FloatArray

ALLOWED = 0.5
"""Part of a period after which a frame is late."""
SETTLING = 1.0
"""Frames of so much time at the start of a recording do not count [s]."""


class LateFrames:
    """Counts the late frames of a node.

    Attributes:
        count: Late frames so far.
    """

    def __init__(self) -> None:
        self.count = 0
        self._latest: int | None = None

    def begin(self, due: int, period: int, left_out: int) -> None:
        """A frame begins.

        Args:
            due: When it was due [ns].
            period: Time between two frames [ns].
            left_out: Frames that were due since the one before, and left out.
        """
        self.count += left_out
        self._latest = due + round(ALLOWED * period)

    def published(self, now: int) -> None:
        """The frame that began has been published at a time [ns]; others are not due at any."""
        if self._latest is not None:
            self.count += now > self._latest
            self._latest = None


def late_of(told: FloatArray, rate: float) -> int:
    """Late frames of a recording, without those of the start.

    Args:
        told: The node's count in each of its messages, shape [n].
        rate: Of the frames [Hz].
    """
    return int(told[-1] - told[min(round(SETTLING * rate), len(told) - 1)])
