"""A recording in the making: the simulation and the file that it goes to."""

from dataclasses import dataclass
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_typestore

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.recording.bag_writer import BagWriter
from garment_sim_ros.ros.conversions import text_from
from garment_sim_ros.ros.offered import offered
from garment_sim_ros.ros.offline.hashes import SIMULATION, STATE_HASH, SecondHash, Telling
from garment_sim_ros.ros.offline.inputs import Message
from garment_sim_ros.ros.offline.work import Work
from garment_sim_ros.ros.topics import topic_of

_OWN = {topic.name: topic for topic in (SIMULATION, STATE_HASH)}
"""What only recordings have."""


@dataclass(frozen=True, kw_only=True)
class Simulated:
    """What a simulation came to.

    Attributes:
        frames: Frames of cloth.
        seconds: Simulated time from the first frame to the last [s].
        garments: Number of vertices by garment.
        rejected: Messages that could not be used, by reason.
        resets: Times the garments were put on anew.
        hash: That of the last second's state.
        gone_on_from: Frames that were there, of a recording that was interrupted.
    """

    frames: int
    seconds: float
    garments: dict[str, int]
    rejected: dict[str, int]
    resets: int
    hash: str
    gone_on_from: int


class Making:
    """Simulates into a recording, message by message.

    It can be kept between two messages, see `frozen_state`, and gone on with in another process.

    Args:
        work: Does the nodes' work.
        setup: What it is made with.
        path: Folder of the recording; must not exist.
        namespace: Of its topics.

    Attributes:
        taken: Messages taken so far.
        gone_on_from: Frames that were there when it was gone on with.

    Raises:
        OSError: It cannot be written.
    """

    def __init__(self, work: Work, setup: str, path: Path, namespace: str) -> None:
        self._work, self._namespace = work, namespace
        self._telling = Telling(work, setup)
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._connections: dict[str, Connection] = {}
        self._begin: int | None = None
        self._last, self._final = 0, ""
        self.taken = self.gone_on_from = 0
        self._writer = BagWriter(path)
        self._writer.open()

    @property
    def frames(self) -> int:
        """Frames of cloth so far."""
        return self._work.cloth.frames

    @property
    def is_whole(self) -> bool:
        """Whether a second has just ended."""
        return self._telling.seconds > 0 and self._telling.is_whole

    def pass_to(self, time: int) -> None:
        """Write what comes before messages of a time [ns]."""
        for sent in self._telling.passes(time):
            self._write(*sent)

    def take(self, message: Message) -> None:
        """Write a message and what comes of it; after `pass_to`."""
        for sent in self._telling.take(message):
            self._write(*sent)
        self.taken += 1

    def end(self, name: object) -> Simulated:
        """Close the recording.

        Args:
            name: The input's name, for messages.

        Raises:
            InputFileError: There was no cloth.
            OSError: It cannot be written.
        """
        for sent in self._telling.end():
            self._write(*sent)
        cloth = self._work.cloth
        if not cloth.frames or cloth.stepper is None:
            why = self._work.first_rejection or "no message that moves anything"
            raise InputFileError(name, f"leads to no cloth ({why})")
        self._writer.close()
        return Simulated(
            frames=cloth.frames,
            seconds=(self._last - (self._begin or 0)) * 1e-9,
            garments=cloth.garments,
            rejected=dict(sorted(self._work.rejected.items())),
            resets=cloth.stepper.resets,
            hash=self._final,
            gone_on_from=self.gone_on_from,
        )

    def _write(self, topic: str, time: int, data: bytes) -> None:
        if topic not in self._connections:
            of = _OWN.get(topic) or topic_of(topic)
            assert of is not None
            self._connections[topic] = self._writer.add_connection(
                f"{self._namespace}/{topic}",
                of.kind,
                typestore=self._types,
                offered_qos_profiles=[offered(reliable=True, latched=of.latched, depth=of.depth)],
            )
        self._writer.write(self._connections[topic], time, data)
        cloth = self._work.cloth
        if topic == STATE_HASH.name:
            found = SecondHash.from_text(text_from(data), self._writer.path)
            self._last, self._final = found.stamp, found.state
        elif self._begin is None and cloth.frames and cloth.stepper is not None:
            self._begin = cloth.stepper.time
