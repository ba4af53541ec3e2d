"""What a node says about itself on ``/diagnostics``, and the messages that it had to reject."""

import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode

from garment_sim_ros.errors import MessageError
from garment_sim_ros.ros.interfaces import advertise_always
from garment_sim_ros.ros.sources import OTHER_PUBLISHER
from garment_sim_ros.ros.status import status
from garment_sim_ros.ros.topics import DIAGNOSTICS

_PERIOD = 1.0
_LOG_PERIOD = 10.0
_LONGEST_LINE = 400


class Rejections:
    """Counts what was rejected, by reason; logs every reason once, then from time to time.

    Args:
        log: Takes a line of text.
        log_severe: Takes a line that says that nothing can be done until another message comes.

    Attributes:
        counts: Rejections so far, by reason.
    """

    def __init__(self, log: Callable[[str], Any], log_severe: Callable[[str], Any]) -> None:
        self.counts: Counter[str] = Counter()
        self._log = log
        self._log_severe = log_severe
        self._logged: dict[str, float] = {}

    def add(self, what: str, error: MessageError, *, severe: bool = False) -> None:
        """Count one rejection of `what`, a topic or other input.

        Args:
            what: The topic.
            error: Why.
            severe: Whether the node has nothing else to go on with.
        """
        self.counts[error.reason] += 1
        if error.reason != OTHER_PUBLISHER:  # told with names, see `inputs`
            text = in_one_line(str(error))
            so_far = f"({self.counts[error.reason]} so far)"
            self.tell(error.reason, f"rejected {what}: {text} {so_far}", severe=severe)

    def tell(self, key: str, text: str, *, severe: bool = False) -> None:
        """Log a line, unless one of the same key was logged lately."""
        now = time.monotonic()
        if now - self._logged.get(key, -_LOG_PERIOD) >= _LOG_PERIOD:
            self._logged[key] = now
            log = self._log_severe if severe else self._log
            log(text)


def in_one_line(text: str) -> str:
    """Text from outside as one line that is not too long."""
    line = " ".join(text[: 2 * _LONGEST_LINE].split())
    return line if len(line) <= _LONGEST_LINE else line[:_LONGEST_LINE] + " ..."


@dataclass(kw_only=True)
class Condition:
    """How a node is.

    Attributes:
        text: A few words.
        well: Whether nothing is missing.
        stale: Whether what it follows has been silent for too long.
        values: Numbers and words by name.
    """

    text: str
    well: bool = True
    stale: bool = False
    values: Mapping[str, object] = field(default_factory=dict)


class Diagnostics:
    """Publishes a node's condition once a second, whatever state and time the node is in.

    Args:
        node: The node.
        rejections: Its rejections.
        condition: Gives its condition.
    """

    def __init__(
        self, node: LifecycleNode, rejections: Rejections, condition: Callable[[], Condition]
    ) -> None:
        self._node = node
        self._rejections = rejections
        self._condition = condition
        self._reported: Counter[str] = Counter()
        self._publisher = advertise_always(node, DIAGNOSTICS)
        node.create_timer(_PERIOD, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _report(self) -> None:
        condition = self._condition()
        counts = Counter(self._rejections.counts)
        new = counts - self._reported
        self._reported = counts
        text = condition.text
        if new:
            reasons = ", ".join(f"{reason} ({n})" for reason, n in sorted(new.items()))
            text += f"; rejected in the last second: {reasons}"
        values = dict(condition.values)
        values.update({f"rejected.{reason}": n for reason, n in sorted(counts.items())})
        message = DiagnosticArray(
            status=[
                status(
                    self._node.get_fully_qualified_name(),
                    values.items(),
                    text=text,
                    well=condition.well and not new,
                    stale=condition.stale,
                )
            ]
        )
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
