"""Which side of a garment its body parts are on: under it, or outside."""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import IntArray
from garment_sim_ros.contact.packed import PackedShapes
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.contact.sides import OPPOSED, PASSING, UNDER
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.geometry.transforms import transform_points
from garment_sim_ros.sim.placement import GarmentLike, rest_transforms

_CLEARLY = 0.6
_RIDES = 0.3
"""A vertex that follows a bone with this weight lies on it, whatever its normal says."""


def shape_sides(
    garment: GarmentLike, colliders: ColliderSet, shapes: PackedShapes
) -> tuple[IntArray, NDArray[np.int8]]:
    """On which side of each vertex the shapes are in the garment's rest pose.

    A skirt has both legs under it; the side of a shirt has the chest under it and the arm against
    it, the sleeve the other way round. Passing are the shapes on bones that the garment says pass
    it by; opposed those on bones that it is attached to elsewhere, towards which the vertex normal
    points. Anything else is under it.

    Args:
        garment: The garment.
        colliders: The body's colliders.
        shapes: Those of them that can be touched, m.

    Returns:
        A row number for each vertex in file order, shape [v]; and for each row the side of every
        shape, shape [r, m]. Vertices with the same sides share a row.
    """
    x = np.ascontiguousarray(garment.vertices, dtype=np.float64)
    normal = np.empty_like(x)
    vertex_normals(x, np.ascontiguousarray(garment.triangles, dtype=np.int32), normal)
    frame_of = {name: f for f, name in enumerate(garment.frames)}
    weight = np.zeros((len(x), len(garment.frames)))
    np.add.at(weight, (np.arange(len(x))[:, None], garment.frame_index), garment.frame_weight)

    T_world_rest = rest_transforms([garment], colliders)
    side = np.full((len(x), len(shapes.kind)), UNDER, dtype=np.int8)
    for k, index in enumerate(shapes.collider):
        c = colliders.colliders[index]
        if c.bone in garment.passed_by:
            side[:, k] = PASSING
            continue
        if not np.isfinite(T_world_rest[index]).all():
            continue
        f = frame_of.get(c.bone, frame_of.get(c.name, -1))
        if f < 0:
            continue
        start, end = transform_points(T_world_rest[index], shapes.bound[k, :6].reshape(2, 3))
        along = end - start
        t = np.clip((x - start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        away = x - start - t[:, None] * along
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        facing_away = np.einsum("vi,vi->v", away, normal) / length
        secondary = weight[:, f] < weight.max(axis=1)
        across = (facing_away <= 0.0) & (weight[:, f] < _RIDES) | (facing_away < _CLEARLY)
        side[secondary & across, k] = OPPOSED
    rows, row = np.unique(side, axis=0, return_inverse=True)
    return row.reshape(-1).astype(np.int32), rows
