"""Cores of body parts: the segments that no garment may be cut by.

The core of a shape is the middle 70 % of its long axis. Where it runs through a garment, the body
part has cloth on both of its sides. Spheres have none.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import matrix_from_quaternion

_MIDDLE = 0.7
"""Share of the long axis that counts as core."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Cores:
    """Cores of a collider set, and the convex solids among its shapes.

    Attributes:
        collider: Collider that carries each core, shape [c].
        bone: Its bone, c names.
        ends: Both ends in the collider's own frame [m], shape [c, 2, 3].
        depth: Least distance from each core to the surface of its shape [m], shape [c].
        solid_collider: Collider that carries each solid, shape [s].
        solid_bone: Its bone, s names.
        planes: Outward unit normals and offsets of all solids in their own frames, so that
            ``n x + d <= 0`` is inside, shape [p, 4].
        plane_start: First plane of each solid and the end, shape [s + 1].
        same_bone: Whether a core and a solid are on one bone, shape [c, s].
    """

    collider: IntArray
    bone: tuple[str, ...]
    ends: FloatArray
    depth: FloatArray
    solid_collider: IntArray
    solid_bone: tuple[str, ...]
    planes: FloatArray
    plane_start: IntArray
    same_bone: NDArray[np.bool_]

    @classmethod
    def of(cls, colliders: ColliderSet) -> "Cores":
        """The cores of a set; hulls, grids and skins are solids, too."""
        ends: list[FloatArray] = []
        depth: list[float] = []
        carrier: list[int] = []
        solids: list[int] = []
        planes: list[FloatArray] = []
        for i, c in enumerate(colliders.colliders):
            if c.shape is not None and c.shape.core is not None:
                core = c.shape.core(c.geometry, _MIDDLE)
                ends.append(core.ends)
                depth.append(core.depth)
                carrier.append(i)
        for i, points in _clouds(colliders):
            ends.append(middle(points))
            carrier.append(i)
            depth.append(0.0)
            with suppress(QhullError):  # of flat ones, which nothing is inside of
                planes.append(ConvexHull(points).equations)
                depth[-1] = -float((ends[-1] @ planes[-1][:, :3].T + planes[-1][:, 3]).max())
                solids.append(i)
        order = np.argsort(carrier, kind="stable")
        bone = [c.bone for c in colliders.colliders]
        core_bone = tuple(bone[carrier[k]] for k in order)
        solid_bone = tuple(bone[i] for i in solids)
        return cls(
            collider=np.array([carrier[k] for k in order], np.int32),
            bone=core_bone,
            ends=np.array([ends[k] for k in order]).reshape(-1, 2, 3),
            depth=np.array([depth[k] for k in order]),
            solid_collider=np.array(solids, np.int32),
            solid_bone=solid_bone,
            planes=np.concatenate([*planes, np.zeros((0, 4))]),
            plane_start=np.cumsum([0, *map(len, planes)], dtype=np.int32),
            same_bone=np.array(core_bone)[:, None] == np.array(solid_bone),
        )

    def posed(self, poses: ColliderPoses) -> FloatArray:
        """Ends of the cores in the world [m], shape [c, 2, 3]."""
        R = matrix_from_quaternion(poses.orientation[self.collider])
        return np.einsum("cij,cej->cei", R, self.ends) + poses.position[self.collider, None]


def middle(points: FloatArray) -> FloatArray:
    """The core of a hull: the middle of the long axis of its vertices [n, 3], shape [2, 3]."""
    centre = points.mean(axis=0)
    axis = np.linalg.svd(points - centre, full_matrices=False)[2][0]
    along = (points - centre) @ axis
    return centre + _MIDDLE * np.array([[along.min()], [along.max()]]) * axis


def _clouds(colliders: ColliderSet) -> Iterator[tuple[int, FloatArray]]:
    """Points whose convex hull stands for a shape, with the collider that carries it."""
    frames = [i for i, c in enumerate(colliders.colliders) if c.is_frame]
    for i, c in enumerate(colliders.colliders):
        for cloud in c.record.clouds(c.geometry):
            yield (i if cloud.frame is None else frames[cloud.frame]), cloud.points
