"""All collider shapes of a body as one mesh."""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.contact.ellipsoid_refit import refit_entries
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.transforms import transform_from
from garment_sim_ros.sim.colliders import ColliderState

_DIRECTIONS = 60
_FINEST = 0.025
"""Size of the triangles of sampled shapes [m]."""


class ColliderSurface:
    """Poses the shapes of a set.

    Args:
        colliders: The set.

    Attributes:
        triangles: Vertex indices, shape [t, 3]; empty where no shape has a surface.
    """

    def __init__(self, colliders: ColliderSet) -> None:
        points, triangles, owner, count = [], [], [], 0
        for i, collider in enumerate(colliders.colliders):
            try:
                own, faces = surface(collider, directions=_DIRECTIONS, finest=_FINEST)
            except GeometryError:
                continue  # frames and skins
            points.append(np.asarray(own, np.float64))
            triangles.append(np.asarray(faces, np.int32) + np.int32(count))
            owner.append(np.full(len(own), i))
            count += len(own)
        self._owner = np.concatenate([*owner, np.zeros(0, np.int64)]).astype(np.int64)
        self._points = np.concatenate([*points, np.zeros((0, 3))])
        self.triangles: IntArray = np.concatenate([*triangles, np.zeros((0, 3), np.int32)])
        # Those that change with the pose.
        refit = [i for i in refit_entries(colliders) if i in set(self._owner.tolist())]
        self._state = ColliderState.of(colliders) if refit else None
        self._changing: list[tuple[int, FloatArray]] = []
        if self._state is not None:
            shape_of = {int(i): k for k, i in enumerate(self._state.shapes.collider)}
            for i in refit:
                shape = colliders.colliders[i].shape
                assert shape is not None
                radii = shape.radii
                assert radii is not None
                unit = self._points[self._owner == i] / radii(colliders.colliders[i].geometry)
                self._changing.append((shape_of[i], unit))
        self._rows = [np.flatnonzero(self._owner == i) for i in refit]

    def vertices(self, poses: ColliderPoses) -> SingleArray:
        """Vertices in the world [m], shape [v, 3]."""
        T = transform_from(poses.position, poses.orientation)[self._owner]
        out = np.einsum("nij,nj->ni", T[:, :3, :3], self._points) + T[:, :3, 3]
        state = self._state
        if state is not None:
            for own in (state.start, state.end):
                own.position[:] = poses.position
                own.orientation[:] = poses.orientation
            state.pose()
            for rows, (k, unit) in zip(self._rows, self._changing):
                local = unit * state.shapes.size[k, :3]
                out[rows] = local @ state.posed.rotation[k].T + state.posed.centre[k]
        return out.astype(np.float32)
