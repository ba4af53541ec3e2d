"""Avatars as nodes of one process."""

import math
import os
import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any

import rclpy
from rclpy.exceptions import InvalidNamespaceException

from garment_sim_ros.errors import ParameterError
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.sampling import rate_of
from garment_sim_ros.params import ClothNodeParameters, MocapPlayerParameters
from garment_sim_ros.ros.avatar_nodes import AvatarNodes
from garment_sim_ros.ros.measurement import Measurement
from garment_sim_ros.ros.memory import give_back
from garment_sim_ros.ros.mocap_player import read_clip
from garment_sim_ros.ros.own_context import own_context
from garment_sim_ros.ros.process import prepare_process
from garment_sim_ros.ros.shared import shared
from garment_sim_ros.ros.turns import Turns
from garment_sim_ros.stamps import SECOND

_SPREAD = (5**0.5 - 1) / 2
"""Part of a frame between the grids of one avatar and of the next: by the golden ratio they are
spread evenly, however many there are."""
_WORTH = 60.0
"""Poses between which motion is straight enough [Hz]: 50 m/s^2 make 2 mm."""
_NEARLY = 0.01
"""A clip of 59.5 Hz is one of 60."""


class OneProcess:
    """Avatars that live as long as the `with` block, each in a namespace of its own.

    Args:
        threads: Threads that run them; None: one for each processor.

    Attributes:
        context: Theirs, while the block runs.
    """

    def __init__(self, threads: int | None = None) -> None:
        self._count = threads or len(os.sched_getaffinity(0))
        self._made = 0
        self._avatars: dict[str, AvatarNodes] = {}
        self._measurement = Measurement()

    def __enter__(self) -> "OneProcess":
        prepare_process()
        self.context = own_context()
        self._turns = Turns(self._count)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._turns.end()
        for avatar in self._avatars.values():
            avatar.destroy()
        self._avatars.clear()
        rclpy.shutdown(context=self.context)

    def add(self, namespace: str, parameters: Mapping[str, Mapping[str, Any]]) -> None:
        """Start the nodes of an avatar.

        Args:
            namespace: Theirs, of nobody else here.
            parameters: What each is given, by name; without `mocap_player` joint states come from
                elsewhere.

        Raises:
            ParameterError: The namespace cannot be one.
            GarmentSimError: A node cannot be configured.
        """
        clip, parameters = in_step(parameters)
        rate = parameters["cloth_node"].get("rate", ClothNodeParameters().rate)
        origin = time.time_ns() + round(self._made * _SPREAD % 1.0 * SECOND / rate)
        self._made += 1
        try:
            avatar = AvatarNodes(self.context, namespace, parameters, origin)
        except InvalidNamespaceException:
            raise ParameterError(
                "--namespace", f"found {namespace!r}", "allowed: names of letters, digits and _"
            ) from None
        try:
            avatar.start()
        except BaseException:
            avatar.destroy()
            raise
        self._avatars[namespace] = avatar
        self._measurement.add(avatar)
        for part in avatar.parts:
            self._turns.add(part)
        del clip  # the player has it

    def remove(self, namespace: str) -> None:
        """End the nodes of an avatar; nothing of them is left."""
        self._end(self._avatars.pop(namespace))
        give_back()

    def _end(self, avatar: AvatarNodes) -> None:
        self._measurement.drop(avatar)
        for part in avatar.parts:
            self._turns.remove(part)
        avatar.destroy()

    @property
    def namespaces(self) -> set[str]:
        """Of the avatars that there are."""
        return set(self._avatars)

    @property
    def is_dressed(self) -> bool:
        """Whether all avatars have shown cloth."""
        return all(avatar.cloth.shown.count for avatar in self._avatars.values())

    def check(self) -> None:
        """See that all can go on.

        Raises:
            BaseException: What a node's callback raised.
        """
        if self._turns.failure is not None:
            raise self._turns.failure

    def measure(self) -> None:
        """Measure from now on how well avatars run; those that come later from then on."""
        self._measurement = Measurement()
        for avatar in self._avatars.values():
            self._measurement.add(avatar)

    def figures(self) -> dict[str, Any]:
        """What was measured so far; see `Measurement`."""
        return self._measurement.figures()


def in_step(
    parameters: Mapping[str, Mapping[str, Any]],
) -> tuple[Clip | None, dict[str, dict[str, Any]]]:
    """Parameters with which a pose is there when the cloth is due, where none else are given.

    The player sends a pose for each frame, or a whole number of them where the clip has more, up
    to what is worth it. So the cloth need not stay behind the poses.

    Returns:
        The clip, and what each node is given.

    Raises:
        InputFileError: The clip cannot be used.
    """
    nodes = {name: dict(given) for name, given in parameters.items()}
    player, cloth = nodes.get("mocap_player"), nodes["cloth_node"]
    if player is None:
        return None, nodes
    usual = MocapPlayerParameters()
    source, names = player.get("clip", usual.clip), player.get("bone_names", usual.bone_names)
    clip = shared(read_clip, source, bone_names=names)
    rate = cloth.get("rate", ClothNodeParameters().rate)
    cloth.setdefault("delay", 0.0)
    worth = min(rate_of(clip), _WORTH)
    player.setdefault("rate", rate * max(1, math.floor(worth / rate + _NEARLY)))
    return clip, nodes
