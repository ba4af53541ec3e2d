"""The body below the garments: its posed skin, and how deep points are in it.

Making one compiles, or loads what is compiled: that is done beside the thread that keeps the page
up to date.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.skin_from_poses import SkinFromPoses
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.geometry.mesh_distance import MeshDistance


class Wearer:
    """A body that is posed by its colliders.

    Args:
        colliders: The set whose poses are known.
        body: The body that it was fitted to.
        measures: Whether depths will be asked for.

    Attributes:
        colliders: As given.
        measures: As given.
        triangles: Of the skin, shape [t, 3].

    Raises:
        GeometryError: The colliders are another body's.
    """

    def __init__(self, colliders: ColliderSet, body: Body, *, measures: bool) -> None:
        self.colliders, self.measures = colliders, measures
        self.triangles: IntArray = body.skin.triangles
        self._skin = SkinFromPoses(colliders, body)
        x = self._skin.vertices(ColliderPoses.identity(len(colliders)))
        if measures:
            self._distance = MeshDistance(body.skin.vertices, body.skin.triangles)
            self._distance.refit(x)
            self._distance.signed_distance(x[:1])

    def vertices(self, poses: ColliderPoses) -> SingleArray:
        """Skin vertices in the world [m], shape [v, 3]."""
        return self._skin.vertices(poses).astype(np.float32)

    def pose(self, poses: ColliderPoses) -> None:
        """Pose the skin that `depth` is measured in."""
        self._distance.refit(self._skin.vertices(poses))

    def depth(self, x: SingleArray) -> FloatArray:
        """Depth of points in the skin as posed last [m], shape [n]; positive inside."""
        return -self._distance.signed_distance(np.asarray(x, np.float64))[0]
