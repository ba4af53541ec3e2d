"""What is published of one garment: points, mesh, topology."""

import numpy as np

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.params import ClothNodeParameters, Material
from garment_sim_ros.recording import worn_watch
from garment_sim_ros.ros.garment_messages import (
    garment_marker,
    topology,
)
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.serialize import PointCloud, TriangleMarker
from garment_sim_ros.ros.topics import GARMENT_MESH, GARMENT_POINTS, GARMENT_TOPOLOGY
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.state import State
from garment_sim_ros.sim.strain import StrainMeter


class GarmentPublishers:
    """Topics of one garment.

    Args:
        node: The node that publishes.
        name: The garment's name.
        p: The node's parameters.
    """

    def __init__(self, node: ManagedNode, name: str, p: ClothNodeParameters) -> None:
        self.name = name
        self._frame_id = p.frame_id
        self._normals = p.normals
        # What is reproducible is so for those who listen, too, however fast the frames come.
        self._points = node.advertise(GARMENT_POINTS, name, keep_all=p.step_on == "poses")
        self._mesh = node.advertise(GARMENT_MESH, name)
        self._topology = node.advertise_always(GARMENT_TOPOLOGY, name)

    def show(self, garment: Garment, number: int) -> None:
        """Publish the topology and prepare the messages.

        Args:
            garment: The garment.
            number: Its place in the outfit, for its colour.
        """
        self._points_message = PointCloud(
            len(garment.vertices), self._frame_id, normals=self._normals
        )
        self._mesh_message = garment_marker(garment, number, self._frame_id)
        self._topology.publish(topology(garment))

    def publish(self, simulation: Simulation, stamp: int) -> SingleArray:
        """Publish points and mesh as they are at a simulated time [ns].

        Returns:
            The points [m], shape [v, 3], which the next call overwrites.
        """
        x = simulation.positions(self.name)
        if self._points.get_subscription_count():
            normal = simulation.normals(self.name) if self._normals else None
            self._points.publish(self._points_message.fill(stamp, x, normal))
        if self._mesh.get_subscription_count():
            self._mesh.publish(self._mesh_message.fill(stamp, x))
        return x


def warm_up() -> None:
    """Compile, or load from the cache, what publishing and judging a frame runs."""
    worn_watch.warm_up()
    vertices = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]])
    triangles = np.array([[0, 1, 2]], dtype=np.int32)
    none = np.zeros(0, np.int32)
    model = build_model(
        "scrap",
        vertices,
        triangles,
        Material(),
        pins=none,
        pin_collider=none,
        pin_position=np.zeros((0, 3)),
    )
    StrainMeter(model).read(State.at(model, vertices, np.zeros(3)))
    marker = TriangleMarker(triangles, "world", "scrap", (*garment_colour(0), 1.0))
    marker.fill(0, vertices.astype(np.float32))
