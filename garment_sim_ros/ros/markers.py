"""Collider shapes as markers for people who look."""

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from garment_sim_ros.colliders.surfaces import surface
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.shapes import Collider, ColliderSet
from garment_sim_ros.ros.serialize import PosedMarkers

_COLOUR = ColorRGBA(r=0.35, g=0.55, b=0.85, a=0.35)
_DIRECTIONS = 60


def collider_markers(colliders: ColliderSet) -> PosedMarkers | None:
    """Markers of all shapes of a set, to be filled with poses; None where there are none."""
    markers, index = [], []
    for i, collider in enumerate(colliders.colliders):
        marker = Marker(ns="colliders", id=i, action=Marker.ADD, color=_COLOUR)
        marker.header.frame_id = colliders.frame_id
        try:
            _shape(marker, collider)
        except GeometryError:
            continue  # frames and others without a surface of their own
        markers.append(marker)
        index.append(i)
    return PosedMarkers(markers, np.array(index, dtype=np.int32)) if markers else None


def _shape(marker: Marker, collider: Collider) -> None:
    scale = marker.scale
    if collider.kind in ("sphere", "ellipsoid"):
        key = "radius" if collider.kind == "sphere" else "radii"
        radii = np.broadcast_to(np.asarray(collider.geometry[key], dtype=np.float64), 3)
        marker.type = Marker.SPHERE
        scale.x, scale.y, scale.z = (2.0 * float(r) for r in radii)
        return
    vertices, triangles = surface(collider, directions=_DIRECTIONS)
    marker.type = Marker.TRIANGLE_LIST
    scale.x = scale.y = scale.z = 1.0
    marker.points = [
        Point(x=float(x), y=float(y), z=float(z)) for x, y, z in vertices[triangles.reshape(-1)]
    ]
