"""Joint states to the channels of a rig, by name."""

import numpy as np

from garment_sim_ros.body.rig import Dofs
from garment_sim_ros.errors import MessageError
from garment_sim_ros.ros.conversions import StampedJoints

UNKNOWN = "name_unknown"
DUPLICATED = "name_duplicated"
MISSING = "name_missing"
_SHOWN = 5


class JointChannels:
    """Values of a rig's channels, gathered from messages that may carry a part of them.

    Args:
        dofs: The channels; those that mimic others are not waited for.

    Attributes:
        values: Latest values [rad or m], shape [d].
    """

    def __init__(self, dofs: Dofs) -> None:
        self.values = np.zeros(len(dofs))
        self._channel = {name: i for i, name in enumerate(dofs.names)}
        self._names = dofs.names
        self._missing = dofs.mimic_source < 0
        self._last_names: tuple[str, ...] | None = None
        self._from = np.zeros(0, np.intp)
        self._to = np.zeros(0, np.intp)

    def check(self, joints: StampedJoints) -> None:
        """See whether `take` can use a message.

        Raises:
            MessageError: A name is there twice, or none is known.
        """
        if joints.names == self._last_names:
            return
        seen: set[str] = set()
        for name in joints.names:
            if name in seen:
                raise MessageError(DUPLICATED, f"{name!r} is there twice; allowed: once")
            seen.add(name)
        known = [i for i, name in enumerate(joints.names) if name in self._channel]
        if not known:
            found = ", ".join(joints.names[:_SHOWN]) or "no names"
            raise MessageError(UNKNOWN, f"found {found}; allowed: joints of robot_description")
        self._from = np.array(known, dtype=np.intp)
        self._to = np.array([self._channel[joints.names[i]] for i in known], dtype=np.intp)
        self._last_names = joints.names

    def take(self, joints: StampedJoints) -> None:
        """Take the values of a checked message over."""
        self.values[self._to] = joints.values[self._from]
        self._missing[self._to] = False

    @property
    def is_complete(self) -> bool:
        """Whether every channel has had a value."""
        return not self._missing.any()

    def unknown(self) -> list[str]:
        """Names of the last message that are no channels."""
        return [name for name in self._last_names or () if name not in self._channel]

    def missing(self) -> list[str]:
        """Channels that no message has had yet."""
        return [self._names[i] for i in np.flatnonzero(self._missing)]
