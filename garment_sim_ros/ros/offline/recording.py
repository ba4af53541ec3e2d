"""Simulating into a recording, and simulating a recording again to see whether it is the same."""

from bisect import bisect_left
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from garment_sim_ros.errors import GarmentSimError, InputFileError, MessageError
from garment_sim_ros.mocap.bag_file import Bag, opened_bag
from garment_sim_ros.ros.conversions import text_from
from garment_sim_ros.ros.offline.hashes import (
    SIMULATION,
    STATE_HASH,
    MessageHash,
    SecondHash,
    simulated,
)
from garment_sim_ros.ros.offline.inputs import Input, Message, opened_input
from garment_sim_ros.ros.offline.making import Making, Simulated
from garment_sim_ros.ros.offline.setup import Setup
from garment_sim_ros.ros.offline.unfinished import Unfinished
from garment_sim_ros.ros.offline.work import Work

Progress = Callable[[Iterator[Message], int], Iterator[Message]]
"""Passes messages on, of which there are so many, and shows how far they are."""

_NAME = "simulation"


def _plainly(messages: Iterator[Message], count: int) -> Iterator[Message]:
    """No progress."""
    return messages


def record(
    source: Input,
    setup: Setup,
    out: Path,
    name: object,
    progress: Progress = _plainly,
    unfinished: Unfinished | None = None,
) -> Simulated:
    """Simulate into a recording.

    Args:
        source: What comes in.
        setup: What to simulate with.
        out: Folder of the recording; must not exist, and lie in a folder that is free for it.
        name: The input's name, for messages.
        progress: Shows how far it is.
        unfinished: Keeps each second, to go on from; None: an interruption leaves nothing.

    Raises:
        GarmentSimError: A file or parameter cannot be used, or the input leads to no cloth.
    """
    # Its file has the same name wherever it goes: the name stands in its bytes.
    written = out.with_name(_NAME)
    try:
        making = unfinished.kept(setup.text) if unfinished else None
        if making is None:
            making = Making(Work(setup), setup.text, written, source.namespace)
        messages = islice(progress(source.messages, source.count), making.taken, None)
        for message in messages:
            making.pass_to(message.time)
            if unfinished and making.is_whole:
                unfinished.keep(making)
            making.take(message)
        made = making.end(name)
    except OSError as error:
        raise InputFileError(out, error.strerror or str(error), "allowed: room to write") from None
    written.replace(out)
    return made


@dataclass(frozen=True)
class Recorded:
    """What a recording says of its simulation.

    Attributes:
        setup: What it was made with.
        hashes: Of its seconds.
        contents: The hashes' `messages` as the recording's content has them now.
        namespace: Of its topics.
    """

    setup: Setup
    hashes: list[SecondHash]
    contents: list[str]
    namespace: str


def read_recorded(path: str | Path) -> Recorded:
    """What a recording says of its simulation.

    Raises:
        InputFileError: It cannot be read, or was not simulated.
    """
    with opened_bag(path) as bag:
        space, setup = _setup(path, bag)
        prefix = f"{space}/"
        topics = [c for c in bag.connections if c.topic.startswith(prefix)]
        told = [
            c
            for c in topics
            if c.topic == prefix + STATE_HASH.name and c.msgtype == STATE_HASH.kind
        ]
        times, hashes = [], []
        for _, time, data in bag.messages(told) if told else ():
            times.append(time)
            hashes.append(SecondHash.from_text(_text(path, data), path))
        if not hashes:
            raise InputFileError(
                path, f"holds no {STATE_HASH.name}", "allowed: what simulate wrote"
            )
        counted = [MessageHash() for _ in hashes]
        for connection, time, data in bag.messages([c for c in topics if c not in told]):
            # What came after all hashes is counted in the last: it was not there.
            place = min(bisect_left(times, time), len(hashes) - 1)
            counted[place].add(connection.topic.removeprefix(prefix), time, data)
    return Recorded(
        setup=Setup.from_text(setup, path),
        hashes=hashes,
        contents=[hashed.take() for hashed in counted],
        namespace=space,
    )


def told_setup(path: str | Path) -> str:
    """The text of what a recording was simulated with; empty where there is none."""
    with suppress(GarmentSimError), opened_bag(path) as bag:
        return _setup(path, bag)[1]
    return ""


def _setup(path: str | Path, bag: Bag) -> tuple[str, str]:
    """Namespace and text."""
    for connection in bag.connections:
        space, _, name = connection.topic.rpartition("/")
        if name == SIMULATION.name and connection.msgtype == SIMULATION.kind:
            for _, _, data in bag.messages([connection]):
                return space, _text(path, data)
    raise InputFileError(path, f"holds no {SIMULATION.name}", "allowed: what simulate wrote")


def _text(path: str | Path, data: bytes) -> str:
    try:
        return text_from(data)
    except MessageError as error:
        raise InputFileError(path, str(error)) from None


@contextmanager
def _again(path: str | Path, recorded: Recorded) -> Iterator[Input]:
    with opened_input(
        path, begins_with=recorded.setup.begins_with, namespace=recorded.namespace
    ) as source:
        yield source


def verify(path: str | Path, progress: Progress = _plainly) -> dict[str, Any]:
    """Simulate a recording again from its inputs, and compare every second.

    Args:
        path: What `record` wrote.
        progress: Shows how far it is.

    Returns:
        Seconds compared and the hash of the last state.

    Raises:
        InputFileError: A second differs; the first one is named, and what differs.
        GarmentSimError: The recording, or a file that it was made with, cannot be used.
    """
    recorded = read_recorded(path)
    place = 0
    with _again(path, recorded) as source:
        work = Work(recorded.setup)
        messages = progress(source.messages, source.count)
        for topic, _, data in simulated(work, messages, recorded.setup.text):
            if topic != STATE_HASH.name:
                continue
            found = SecondHash.from_text(text_from(data), path)
            if place == len(recorded.hashes):
                raise _differs(path, found.second, "it is not in the recording")
            told = recorded.hashes[place]
            if recorded.contents[place] != told.messages:
                raise _differs(path, told.second, "messages are not those that were written")
            if (found.second, found.stamp, found.state) != (told.second, told.stamp, told.state):
                raise _differs(path, told.second, "the simulation comes to another state")
            if found.messages != told.messages:
                raise _differs(path, told.second, "the simulation sends other messages")
            place += 1
    if place < len(recorded.hashes):
        raise _differs(path, recorded.hashes[place].second, "the simulation ends before it")
    return {"seconds": place, "frames": work.cloth.frames, "hash": recorded.hashes[-1].state}


def _differs(path: str | Path, second: int, why: str) -> InputFileError:
    return InputFileError(path, f"differs in second {second}: {why}")
