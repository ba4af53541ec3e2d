"""Collider shapes as markers for people who look."""

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.contact.ellipsoid_refit import refit_entries
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.transforms import quaternion_from_matrix
from garment_sim_ros.ros.serialize import PosedMarkers
from garment_sim_ros.sim.colliders import ColliderState

_COLOUR = ColorRGBA(r=0.35, g=0.55, b=0.85, a=0.35)
_DIRECTIONS = 60
_FINEST = 0.025
"""Size of the triangles of sampled shapes [m]."""


class ColliderMarkers:
    """Markers of all shapes of a set, to be filled with poses.

    Args:
        colliders: The set.
    """

    def __init__(self, colliders: ColliderSet) -> None:
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
        self._message = PosedMarkers(markers, np.array(index, dtype=np.int32)) if markers else None
        # Those that change with the pose: marker, collider, and shape of the posed set.
        refit = set(refit_entries(colliders))
        self._state = ColliderState.of(colliders) if refit else None
        self._changing: list[tuple[int, int, int]] = []
        if self._state is not None:
            shape_of = {int(i): k for k, i in enumerate(self._state.shapes.collider)}
            self._changing = [(m, i, shape_of[i]) for m, i in enumerate(index) if i in refit]

    def fill(self, stamp: int, poses: ColliderPoses) -> bytes | None:
        """The message at a time [ns]; None where there is nothing to see."""
        if self._message is None:
            return None
        state = self._state
        if state is not None:
            for own in (state.start, state.end):
                own.position[:] = poses.position
                own.orientation[:] = poses.orientation
            state.pose()
            poses = state.end
            for marker, i, k in self._changing:
                poses.position[i] = state.posed.centre[k]
                poses.orientation[i] = quaternion_from_matrix(state.posed.rotation[k])
                self._message.scale[marker][:] = 2.0 * state.shapes.size[k, :3]
        return self._message.fill(stamp, poses)


def _shape(marker: Marker, collider: Collider) -> None:
    scale = marker.scale
    if collider.shape is not None and collider.shape.radii is not None:
        radii = collider.shape.radii(collider.geometry)
        marker.type = Marker.SPHERE
        scale.x, scale.y, scale.z = (2.0 * float(r) for r in radii)
        return
    vertices, triangles = surface(collider, directions=_DIRECTIONS, finest=_FINEST)
    marker.type = Marker.TRIANGLE_LIST
    scale.x = scale.y = scale.z = 1.0
    marker.points = [
        Point(x=float(x), y=float(y), z=float(z)) for x, y, z in vertices[triangles.reshape(-1)]
    ]
