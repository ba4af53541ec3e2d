"""Which of several publishers of one topic is followed.

Two that send at once would have their poses mixed, and the body jump to and fro between them. So
one is followed, as long as it sends what can be used; another takes over once that one is gone or
has been silent for a while.
"""

from garment_sim_ros.errors import MessageError
from garment_sim_ros.stamps import SECOND

OTHER_PUBLISHER = "other_publisher"
_MOST_IGNORED = 16
_LONG_AGO = 2**62


class Source:
    """Follows one publisher.

    Times are of a clock that only runs forward [ns]. An empty identity is one of a middleware
    that does not tell: then all are the same.

    Args:
        patience: A publisher without a usable message for this long may be replaced [s].

    Attributes:
        followed: Identity of the followed publisher, None before the first usable message.
        accepted: When its last usable message came.
        ignored: When each of the others last sent something.
    """

    def __init__(self, patience: float) -> None:
        self.followed: bytes | None = None
        self.accepted = 0
        self.ignored: dict[bytes, int] = {}
        self._patience = round(patience * SECOND)

    def check(self, publisher: bytes, now: int) -> None:
        """See whether a publisher's message may be used.

        Raises:
            MessageError: Another is followed.
        """
        if publisher == self.followed or not self.is_held(now):
            return
        if publisher in self.ignored or len(self.ignored) < _MOST_IGNORED:
            self.ignored[publisher] = now
        raise MessageError(OTHER_PUBLISHER, "one publisher is followed, this is another's")

    def is_held(self, now: int) -> bool:
        """Whether there is a followed publisher, and it has not been silent too long."""
        return self.followed is not None and now - self.accepted <= self._patience

    def accept(self, publisher: bytes, now: int) -> None:
        """Follow the publisher of a message that was used."""
        if publisher != self.followed:
            self.ignored.pop(publisher, None)
            self.followed = publisher
        self.accepted = now

    def leave(self) -> None:
        """Follow whoever is next: the followed publisher is gone."""
        self.accepted = -_LONG_AGO

    def others(self, now: int) -> list[bytes]:
        """Publishers that have been ignored lately."""
        self.ignored = {p: t for p, t in self.ignored.items() if now - t <= self._patience}
        return list(self.ignored)
