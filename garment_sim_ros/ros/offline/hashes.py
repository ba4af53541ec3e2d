"""One hash per second of simulated time: of the state, and of the messages that led to it."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass

from std_msgs.msg import String

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.ros.cdr import encode
from garment_sim_ros.ros.offline.inputs import Message
from garment_sim_ros.ros.offline.work import Work
from garment_sim_ros.ros.topics import Topic
from garment_sim_ros.stamps import SECOND

SIMULATION = Topic(name="simulation", type=String, depth=1, latched=True)
STATE_HASH = Topic(name="state_hash", type=String, depth=10)
"""A simulation's setup and its hashes, as JSON; only recordings have them."""

Timed = tuple[str, int, bytes]
"""Relative name, time in the recording [ns] and bytes of a message."""


@dataclass(frozen=True, kw_only=True)
class SecondHash:
    """What a second came to.

    Attributes:
        second: Of simulated time, counted from the first frame.
        stamp: Simulated time of the last frame that is in it [ns].
        state: SHA-256 of positions and velocities of all garments then.
        messages: SHA-256 of all messages since the hash before, inputs too.
    """

    second: int
    stamp: int
    state: str
    messages: str

    @property
    def text(self) -> str:
        """As it is recorded."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str, path: object) -> "SecondHash":
        """What was recorded.

        Raises:
            InputFileError: It is not such a text.
        """
        try:
            told = json.loads(text)
            return cls(
                second=int(told["second"]),
                stamp=int(told["stamp"]),
                state=str(told["state"]),
                messages=str(told["messages"]),
            )
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputFileError(
                path, f"{STATE_HASH.name} cannot be read ({type(error).__name__}: {error})"
            ) from None


class MessageHash:
    """Of messages, in whatever order those of several topics come."""

    def __init__(self) -> None:
        self._topics: dict[str, hashlib._Hash] = {}

    def __bool__(self) -> bool:
        return bool(self._topics)

    def add(self, topic: str, time: int, data: bytes) -> None:
        """Take a message's relative name, time [ns] and bytes."""
        digest = self._topics.setdefault(topic, hashlib.sha256())
        digest.update(time.to_bytes(8, "little", signed=True) + len(data).to_bytes(8, "little"))
        digest.update(data)

    def take(self) -> str:
        """The hash so far; the next begins."""
        whole = hashlib.sha256()
        for topic in sorted(self._topics):
            whole.update(f"{topic}\0".encode() + self._topics[topic].digest())
        self._topics = {}
        return whole.hexdigest()


class Telling:
    """All that a recording of a simulation holds, message by message.

    A second's hash comes behind all messages of the same time in the recording, so that by this
    time it can be told what it counts in.

    Args:
        work: Does it.
        setup: What the simulation is made with.

    Attributes:
        seconds: Hashes told so far.
    """

    def __init__(self, work: Work, setup: str) -> None:
        self._work, self._setup = work, setup
        self._hashes = MessageHash()
        self._begin: int | None = None
        self._second: int | None = None
        self._due: SecondHash | None = None
        self._time: int | None = None
        self.seconds = 0

    @property
    def is_whole(self) -> bool:
        """Whether nothing but what hashes say has been told: the next begins."""
        return not self._hashes

    def passes(self, time: int) -> Iterator[Timed]:
        """What comes before messages of a time [ns]."""
        if self._due is not None and self._time is not None and time > self._time:
            yield self._told(self._due, self._time)
            self._due = None

    def take(self, message: Message) -> Iterator[Timed]:
        """What comes of a message that comes in, that message first; after `passes`."""
        work = self._work
        sent: Iterable[tuple[str, bytes]] = work.take(message)
        if self._time is None:
            setup = encode(String(data=self._setup))
            self._hashes.add(SIMULATION.name, message.time, setup)
            yield SIMULATION.name, message.time, setup
        self._time = message.time
        frames = work.cloth.frames
        for topic, data in sent:
            self._hashes.add(topic, message.time, data)
            yield topic, message.time, data
        stepper = work.cloth.stepper
        if work.cloth.frames == frames or stepper is None or stepper.time is None:
            return
        self._begin = stepper.time if self._begin is None else self._begin
        now = (stepper.time - self._begin) // SECOND
        if self._second is not None and now != self._second:
            self._due = _of(work, self._second)
        self._second = now

    def end(self) -> Iterator[Timed]:
        """What comes after the last message."""
        if self._time is not None and (self._due or self._second is not None) and self._hashes:
            yield self._told(self._due or _of(self._work, self._second or 0), self._time)

    def _told(self, due: SecondHash, time: int) -> Timed:
        self.seconds += 1
        found = SecondHash(**{**asdict(due), "messages": self._hashes.take()})
        return STATE_HASH.name, time, encode(String(data=found.text))


def simulated(work: Work, messages: Iterable[Message], setup: str) -> Iterator[Timed]:
    """All that a recording of a simulation holds; see `Telling`."""
    telling = Telling(work, setup)
    for message in messages:
        yield from telling.passes(message.time)
        yield from telling.take(message)
    yield from telling.end()


def _of(work: Work, second: int) -> SecondHash:
    digest = hashlib.sha256()
    for part in work.cloth.state():
        digest.update(part)
    stepper = work.cloth.stepper
    stamp = stepper.time if stepper is not None and stepper.time is not None else 0
    return SecondHash(second=second, stamp=stamp, state=digest.hexdigest(), messages="")
