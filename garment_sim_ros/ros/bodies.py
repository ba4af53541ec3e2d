"""Bodies that others track, each in a namespace of its own: dressed when they come.

They are where REP-155 has people's bodies: ``/humans/bodies/<id>/joint_states``, with the
`robot_description` of their skeleton beside it.
"""

import re
import time
from collections.abc import Callable, Mapping
from typing import Any

import rclpy

from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.ros.one_process import OneProcess

_TOPIC = re.compile(r"(/humans/bodies/[a-zA-Z][a-zA-Z0-9_]*)/joint_states")
_GONE = 2.0
"""A body without a publisher for so long has gone [s]."""
_PERIOD = 0.5
"""Between two looks [s]."""
_PATIENCE = 30.0
"""Until a body that could not be dressed is tried again [s]."""


class Bodies:
    """Gives a process's avatars to bodies as they come, and takes them away as they go.

    Args:
        process: The process.
        parameters: What the nodes of each are given, by name.
        most: So many are dressed at once; those that come then wait.
        warn: Takes a line on a body that cannot be dressed.
    """

    def __init__(
        self,
        process: OneProcess,
        parameters: Mapping[str, Mapping[str, Any]],
        most: int,
        warn: Callable[[str], object],
    ) -> None:
        self._process = process
        self._parameters = parameters
        self._most = most
        self._warn = warn
        self._node = rclpy.create_node(
            "bodies", context=process.context, use_global_arguments=False
        )
        self._seen: dict[str, float] = {}
        self._not_before: dict[str, float] = {}
        self._looked = -_PERIOD

    def __enter__(self) -> "Bodies":
        return self

    def __exit__(self, *error: object) -> None:
        self._node.destroy_node()

    def look(self) -> None:
        """See who is there, from time to time."""
        now = time.monotonic()
        if now - self._looked < _PERIOD:
            return
        self._looked = now
        for topic, _ in self._node.get_topic_names_and_types():
            found = _TOPIC.fullmatch(topic)
            if found and self._node.count_publishers(topic):
                self._seen[found[1]] = now
        self._seen = {body: seen for body, seen in self._seen.items() if now - seen < _GONE}
        self._not_before = {b: t for b, t in self._not_before.items() if b in self._seen}
        for namespace in self._process.namespaces - self._seen.keys():
            self._process.remove(namespace)
        for namespace in sorted(self._seen.keys() - self._process.namespaces):
            if len(self._process.namespaces) < self._most:
                self._dress(namespace, now)

    def _dress(self, namespace: str, now: float) -> None:
        if now < self._not_before.get(namespace, 0.0):
            return
        try:
            self._process.add(namespace, self._parameters)
        except GarmentSimError as error:
            self._not_before[namespace] = now + _PATIENCE
            self._warn(f"{namespace} is not dressed: {error}")
