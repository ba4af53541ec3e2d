"""What is published of one garment: points, mesh, topology, quality."""

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.params import Material
from garment_sim_ros.recording import worn_watch
from garment_sim_ros.recording.worn_watch import WornWatch
from garment_sim_ros.ros.diagnostics import status
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
from garment_sim_ros.stamps import SECOND


class GarmentPublishers:
    """Topics of one garment.

    Args:
        node: The node that publishes.
        name: The garment's name.
        frame_id: Frame of its vertices.
        normals: Whether points carry normals.
    """

    def __init__(self, node: ManagedNode, name: str, *, frame_id: str, normals: bool) -> None:
        self.name = name
        self._frame_id = frame_id
        self._normals = normals
        self._points = node.advertise(GARMENT_POINTS, name)
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


class GarmentQuality:
    """Figures of one garment, for the topic `quality`.

    Args:
        name: The garment's name.
        simulation: Simulates it.
        watch: Looks whether it stays worn.
    """

    def __init__(self, name: str, simulation: Simulation, watch: WornWatch) -> None:
        self._name = name
        self._simulation = simulation
        self._watch = watch
        self._strain = StrainMeter(simulation.model(name))

    def status(self, figures: dict[str, object], *, resets: int) -> DiagnosticStatus:
        """One frame's status.

        Args:
            figures: What belongs to the frame and not to the garment.
            resets: Times all garments were put on anew.
        """
        health = self._simulation.health(self._name)
        strain = self._strain.read(self._simulation.state(self._name))
        values: dict[str, object] = {
            **figures,
            **self._watch.figures(self._name)._asdict(),
            "pierced_by": len(self._watch.pierced_by(self._name)),
            "inside": self._watch.inside(self._name),
            "strain_p95": strain.p95,
            "strain_max": strain.largest,
            "contacts": health.contacts,
            "rms_speed": health.rms_speed,
            "max_speed": health.max_speed,
            "resets": health.resets + resets,
            "rewound": health.rewound + health.rewound_parts,
            "recovered": health.recovered,
            "held": health.held,
            "let_go": health.let_go,
            "tangled": health.tangled,
            "layer": self._simulation.layer(self._name),
        }
        well = health.resets == 0 and health.recovered == 0
        return status(self._name, values.items(), well=well)


def quality(statuses: list[DiagnosticStatus], stamp: int) -> DiagnosticArray:
    """The message of one frame, shown at a simulated time [ns]."""
    message = DiagnosticArray(status=statuses)
    message.header.stamp = Time(sec=stamp // SECOND, nanosec=stamp % SECOND)
    return message


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
