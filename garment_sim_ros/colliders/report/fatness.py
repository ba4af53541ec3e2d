"""How fat colliders are: their union's surface and volume against the skin.

Needs no bind pose: any pose of the skin with the colliders' poses that go with it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, LongArray, SingleArray
from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.contact.ellipsoid_refit import EllipsoidRefit
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.contact.union import union_distance
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.transforms import transform_from, transform_points

_SAMPLES = 20000
"""Points on all surfaces together."""
_VOXEL = 0.01
"""Edge of the cells that volumes are counted in [m]."""
_INSIDE = 1e-4
"""A point of a surface this deep in another shape is not on the union's surface [m]."""
_REACH = 10.0
_FIGURES = (
    *("collider_to_skin_mm_mean", "collider_to_skin_mm_median"),
    *("collider_to_skin_mm_p95", "collider_to_skin_mm_max"),
    "volume_excess",
)


class Union:
    """The union of a set's shapes in one pose.

    Args:
        colliders: The set.
        poses: World poses of the whole set.
    """

    def __init__(self, colliders: ColliderSet, poses: ColliderPoses) -> None:
        self._colliders = colliders
        self._poses = poses
        self._shapes = pack(colliders)
        self._posed = PosedShapes.room_for(self._shapes)
        self._refit = EllipsoidRefit(colliders, self._shapes)
        self.move(poses)

    def move(self, poses: ColliderPoses) -> None:
        """Pose the shapes anew."""
        self._poses = poses
        pose(self._shapes, poses, poses, np.zeros(3), self._posed)
        self._refit.pose(poses, np.zeros(3), self._shapes, self._posed)

    def distance(self, points: FloatArray, but: int = -1) -> SingleArray:
        """Least signed distance of points [n, 3] to the shapes, without shape `but`, shape [n]."""
        result = np.empty(len(points), np.float32)
        single = np.ascontiguousarray(points, dtype=np.float32)
        union_distance(self._shapes, self._posed, single, but, np.float32(_REACH), result)
        return result

    def samples(self) -> tuple[FloatArray, LongArray]:
        """Points spread evenly over the union's surface.

        Returns:
            Positions [m], shape [n, 3], and the collider that each is on, shape [n].
        """
        T_world_collider = transform_from(self._poses.position, self._poses.orientation)
        meshes = []
        for index in self._shapes.collider:
            vertices, triangles = surface(self._colliders.colliders[index])
            meshes.append(transform_points(T_world_collider[index], vertices)[triangles])
        areas = [_areas(mesh) for mesh in meshes]
        density = _SAMPLES / sum(area.sum() for area in areas)
        rng = np.random.default_rng(0)
        kept, on = [], []
        for k, (mesh, area) in enumerate(zip(meshes, areas)):
            count = max(int(density * area.sum()), 1)
            chosen = rng.choice(len(area), count, p=area / area.sum())
            points = np.einsum("nc,nck->nk", rng.dirichlet(np.ones(3), count), mesh[chosen])
            kept.append(points[self.distance(points, but=k) > -_INSIDE])
            on.append(np.full(len(kept[-1]), self._shapes.collider[k]))
        return np.concatenate(kept), np.concatenate(on)

    def volume(self, low: FloatArray, high: FloatArray) -> float:
        """Volume of the union within a box, by counting cells [m^3]."""
        axes = [np.arange(low[k] + 0.5 * _VOXEL, high[k], _VOXEL) for k in range(3)]
        across = np.stack(np.meshgrid(axes[0], axes[1], indexing="ij"), axis=-1).reshape(-1, 2)
        count = 0
        for z in axes[2]:  # one sheet at a time bounds the memory
            points = np.column_stack([across, np.full(len(across), z)])
            count += int((self.distance(points) < 0.0).sum())
        return count * _VOXEL**3


def fatness(
    colliders: ColliderSet, poses: ColliderPoses, skin: FloatArray, triangles: NDArray[np.int32]
) -> dict[str, Any]:
    """How far colliders stand off a skin.

    Args:
        colliders: The set.
        poses: Its world poses.
        skin: Skin vertices in the same pose [m], shape [v, 3].
        triangles: Skin triangles, shape [t, 3].

    Returns:
        ``collider_to_skin_mm_mean``, ``_median``, ``_p95`` and ``_max`` over the union's surface,
        positive outside the skin; ``volume_excess``, the union's volume over the skin's, less
        one; under ``shapes`` the ``to_skin_mm_mean`` and ``_max`` of each that the union's
        surface shows.
    """
    if colliders.has_skin:  # the skin itself
        return {**dict.fromkeys(_FIGURES, 0.0), "shapes": {}}
    union = Union(colliders, poses)
    points, on = union.samples()
    distance = 1e3 * MeshDistance(skin, triangles).signed_distance(points)[0]
    a, b, c = (skin - skin.mean(axis=0))[triangles].transpose(1, 0, 2)
    volume = abs(float(np.einsum("tk,tk->", a, np.cross(b, c)))) / 6.0
    union_volume = union.volume(skin.min(axis=0) - 0.1, skin.max(axis=0) + 0.1)
    return {
        "collider_to_skin_mm_mean": round(float(distance.mean()), 3),
        "collider_to_skin_mm_median": round(float(np.median(distance)), 3),
        "collider_to_skin_mm_p95": round(float(np.percentile(distance, 95.0)), 3),
        "collider_to_skin_mm_max": round(float(distance.max()), 3),
        "volume_excess": round(union_volume / max(volume, 1e-12) - 1.0, 4),
        "shapes": {
            colliders.colliders[k].name: {
                "to_skin_mm_mean": round(float(distance[on == k].mean()), 3),
                "to_skin_mm_max": round(float(distance[on == k].max()), 3),
            }
            for k in np.unique(on)
        },
    }


def _areas(mesh: FloatArray) -> FloatArray:
    a, b, c = mesh.transpose(1, 0, 2)
    areas: FloatArray = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return areas
