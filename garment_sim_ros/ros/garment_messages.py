"""Messages about a garment that nodes and recordings without nodes write alike."""

import numpy as np
from geometry_msgs.msg import Point
from shape_msgs.msg import Mesh, MeshTriangle

from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.ros.serialize import TriangleMarker


def garment_marker(garment: Garment, number: int, frame_id: str) -> TriangleMarker:
    """The garment as a marker, to be filled with positions.

    Args:
        garment: The garment.
        number: Its place in the outfit, for its colour.
        frame_id: Frame of its vertices.
    """
    colour = (*garment_colour(number), 1.0)
    return TriangleMarker(garment.triangles, frame_id, garment.name, colour)


def topology(garment: Garment) -> Mesh:
    """Triangles, and vertices in rest shape [m], in the order of the garment's file."""
    return Mesh(
        triangles=[
            MeshTriangle(vertex_indices=np.asarray(triangle, dtype=np.uint32))
            for triangle in garment.triangles
        ],
        vertices=[Point(x=float(x), y=float(y), z=float(z)) for x, y, z in garment.vertices],
    )
