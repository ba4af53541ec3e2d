"""Garments are put on a body at rest, which then moves to its first pose, as a person would.

Placed like skin on a pose with hanging arms, a skirt begins with the hands inside of it, and no
contact can tell any more on which side they belong. A body that is already moving in its first
poses has its garments moving, too: at rest they would be left behind, and hit.
"""

import math
from collections.abc import Sequence

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.geometry.transforms import (
    invert_transform,
    quaternion_from_matrix,
    transform_from,
)
from garment_sim_ros.sim.placement import blend
from garment_sim_ros.sim.worn import Worn

_SPEED = 1.5
"""Of the fastest collider on the way to the first pose [m/s]."""
_LONGEST = 1.0
"""Longest time that the way takes [s]."""
_NEAR = 0.01
"""What is nearer to its rest is there [m]."""
_FASTEST = 10.0
"""Skin that is faster than this was put elsewhere; limbs of people are not [m/s]."""


def rest_at(T_world_rest: FloatArray, poses: ColliderPoses, root: int) -> ColliderPoses:
    """The body in the garments' rest pose, its root where it is in other poses.

    Args:
        T_world_rest: World transforms of the colliders at rest, shape [n, 4, 4]; NaN where that is
            not known.
        poses: World poses of the colliders.
        root: The collider that the body is placed by.

    Returns:
        World poses; those of `poses` where the rest is not known.
    """
    rest = poses.copy()
    T = transform_from(poses.position, poses.orientation)
    if len(T) and np.isfinite(T_world_rest[root]).all():
        known = np.isfinite(T_world_rest).all(axis=(1, 2))
        there = T[root] @ invert_transform(T_world_rest[root]) @ T_world_rest[known]
        rest.position[known] = there[:, :3, 3]
        rest.orientation[known] = quaternion_from_matrix(there[:, :3, :3])
    return rest


def time_from(rest: ColliderPoses, poses: ColliderPoses) -> float:
    """How long a body takes from its rest to other poses [s]; 0 where it is there already."""
    if not len(rest.position):
        return 0.0
    way = float(np.linalg.norm(poses.position - rest.position, axis=1).max())
    return 0.0 if way < _NEAR else min(_LONGEST, math.ceil(60.0 * way / _SPEED) / 60.0)


def set_in_motion(
    garments: Sequence[Worn], poses_start: ColliderPoses, poses_end: ColliderPoses, dt: float
) -> None:
    """Gives garments that are at rest the velocity that skin in their place has.

    Args:
        garments: Changed in place; left at rest where any of that skin is faster than people are.
        poses_start: World poses of the colliders as they are.
        poses_end: World poses some time later.
        dt: That time [s].
    """
    for worn in garments:
        way = worn.frames.world(poses_end) - worn.frames.world(poses_start)
        v = blend(worn.garment, way)[worn.model.vertex] / dt
        if np.linalg.norm(v, axis=1).max(initial=0.0) < _FASTEST:
            worn.state.v[:] = v
