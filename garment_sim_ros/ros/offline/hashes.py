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


def simulated(work: Work, messages: Iterable[Message], setup: str) -> Iterator[Timed]:
    """All that a recording of a simulation holds.

    A second's hash comes behind all messages of the same time in the recording, so that by this
    time it can be told what it counts in.

    Args:
        work: Does it.
        messages: What comes in.
        setup: What the simulation is made with.
    """
    hashes = MessageHash()
    begin = second = None
    due: SecondHash | None = None
    time = None
    for message in messages:
        if due is not None and time is not None and message.time > time:
            yield _told(due, hashes, time)
            due = None
        sent: Iterable[tuple[str, bytes]] = work.take(message)
        if time is None:
            setup_data = encode(String(data=setup))
            hashes.add(SIMULATION.name, message.time, setup_data)
            yield SIMULATION.name, message.time, setup_data
        time = message.time
        frames = work.cloth.frames
        for topic, data in sent:
            hashes.add(topic, time, data)
            yield topic, time, data
        stepper = work.cloth.stepper
        if work.cloth.frames == frames or stepper is None or stepper.time is None:
            continue
        begin = stepper.time if begin is None else begin
        now = (stepper.time - begin) // SECOND
        if second is not None and now != second:
            due = _of(work, second)
        second = now
    if time is not None and (due or second is not None) and hashes:
        yield _told(due or _of(work, second or 0), hashes, time)


def _of(work: Work, second: int) -> SecondHash:
    digest = hashlib.sha256()
    for part in work.cloth.state():
        digest.update(part)
    stepper = work.cloth.stepper
    stamp = stepper.time if stepper is not None and stepper.time is not None else 0
    return SecondHash(second=second, stamp=stamp, state=digest.hexdigest(), messages="")


def _told(due: SecondHash, hashes: MessageHash, time: int) -> Timed:
    found = SecondHash(**{**asdict(due), "messages": hashes.take()})
    return STATE_HASH.name, time, encode(String(data=found.text))
