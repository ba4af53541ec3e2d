"""Player, `collider_node` and `cloth_node` of one avatar, in one process and in step."""

from collections.abc import Mapping
from typing import Any

from rclpy.context import Context

from garment_sim_ros.params import ClothNodeParameters
from garment_sim_ros.ros.cloth_node import ClothNode
from garment_sim_ros.ros.collider_node import ColliderNode
from garment_sim_ros.ros.handover import Handover
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.mocap_player import MocapPlayer
from garment_sim_ros.ros.node_turns import NodeTurns
from garment_sim_ros.ros.place import Place
from garment_sim_ros.ros.process import autostart
from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_POSES,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
)
from garment_sim_ros.stamps import SECOND

_HEAD_START = 0.6
"""How long before the cloth is due its poses are, as a share of its period: in between it is
simulated."""


class AvatarNodes:
    """The nodes of one namespace; messages are handed from one to the next.

    Cloth takes turns of its own: putting garments on takes longer than many a pose.

    Args:
        context: Their context.
        namespace: Their namespace.
        parameters: What each is given, by name; without `mocap_player` joint states come from
            elsewhere.
        origin: A time of the grid that they tick on [ns].

    Attributes:
        namespace: As given.
        parts: What takes turns: poses, then cloth.
        cloth: The cloth's node.
    """

    def __init__(
        self,
        context: Context,
        namespace: str,
        parameters: Mapping[str, Mapping[str, Any]],
        origin: int,
    ) -> None:
        self.namespace = namespace
        plays = "mocap_player" in parameters
        within = (COLLIDER_DESCRIPTION, COLLIDER_POSES)
        handover = Handover((*within, JOINT_STATES, ROBOT_DESCRIPTION) if plays else within)

        def place(name: str, late: int = 0) -> Place:
            return Place(
                context=context,
                namespace=namespace,
                parameters=parameters[name],
                handover=handover,
                origin=origin + late,
            )

        made: list[ManagedNode[Any]] = []
        try:
            if plays:
                made.append(MocapPlayer(place("mocap_player")))
            made.append(ColliderNode(place("collider_node")))
            rate = parameters["cloth_node"].get("rate", ClothNodeParameters().rate)
            self.cloth = ClothNode(place("cloth_node", round(_HEAD_START * SECOND / rate)))
        except BaseException:
            for node in made:
                node.destroy_node()
            raise
        self._nodes = (*made, self.cloth)
        self.parts = (NodeTurns(context, made), NodeTurns(context, [self.cloth]))

    def start(self) -> None:
        """Configure and activate the nodes that are to do so by themselves.

        Raises:
            GarmentSimError: One cannot be.
        """
        for node in reversed(self._nodes):  # who listens first
            if node.autostart:
                autostart(node)

    def destroy(self) -> None:
        """End the nodes; nothing of them is left."""
        for part in self.parts:
            part.destroy()
