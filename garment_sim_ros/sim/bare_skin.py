"""The skin that leaves a body's shapes, posed once a frame for all garments."""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.mesh.skinned import SkinnedMesh
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.geometry.topology import mesh_topology, triangles_across, vertex_normals


class Patch(NamedTuple):
    """An open mesh as kernels see it.

    Attributes:
        x: Vertices, relative to the simulation's origin [m], shape [v, 3].
        normal: Their unit normals, shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        across: The triangle across each edge ab, bc, ca, -1 at the border, shape [t, 3].
        share: How much of the way over it cloth is shown: 0 at the border, else 1, shape [v].
    """

    x: SingleArray
    normal: SingleArray
    triangles: IntArray
    across: IntArray
    share: SingleArray


class BareSkin:
    """That of one set.

    Attributes:
        patch: As it is posed.

    Args:
        colliders: A set with one collider of kind ``bare_skin``.

    Raises:
        GeometryError: A geometry that cannot be used.
    """

    def __init__(self, colliders: ColliderSet) -> None:
        bare = next(c for c in colliders.colliders if c.record.is_bare)
        self._mesh = SkinnedMesh(colliders, bare)
        triangles = self._mesh.triangles
        count = len(np.asarray(bare.geometry["vertices"]))
        topology = mesh_topology(triangles)
        share = np.ones(count, np.float32)
        share[topology.edges[topology.triangle_count == 1]] = 0.0
        self.patch = Patch(
            x=np.zeros((count, 3), np.float32),
            normal=np.zeros((count, 3), np.float32),
            triangles=triangles,
            across=triangles_across(triangles),
            share=share,
        )

    def pose(self, poses: ColliderPoses, origin: FloatArray) -> None:
        """Poses it.

        Args:
            poses: World poses of the whole set.
            origin: World position that it is to be relative to [m], shape [3].
        """
        self.patch.x[:] = self._mesh.vertices(poses) - origin
        vertex_normals(self.patch.x, self.patch.triangles, self.patch.normal)

    def at_rest(self, T_world_rest: FloatArray) -> FloatArray:
        """World positions of its vertices at rest [m], shape [v, 3].

        Args:
            T_world_rest: Where the set's colliders are at rest, shape [n, 4, 4]; NaN where that is
                not known, and then so are vertices.
        """
        return self._mesh.carried_by(T_world_rest)
