"""The one shape of a body without bones, parted into trunk and legs.

Cloth is kept from the core of each shape, the middle of its long axis: that of a whole body runs
on between its legs, where trousers are.
"""

from dataclasses import replace

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.contact.kinds.sdf import SDF
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.pieces import Pieces
from garment_sim_ros.geometry.topology import boundary_loops
from garment_sim_ros.geometry.transforms import transform_from, transform_points

_LOW, _INNER = 0.5, 0.18
"""A leg's opening is lower than this, and not so far aside, in heights of the body."""
_ONE_SIDE = 0.9
"""Share of its vertices that are on one side of the mid-plane."""
_BELOW, _ABOVE = 0.03, 0.05
"""How far the trunk reaches below the crotch, and legs above it [m]: parts overlap."""


def has_legs(pieces: Pieces, skin: FloatArray) -> bool:
    """Whether a garment has an opening around each leg, as trousers and overalls have.

    Args:
        pieces: The cut pattern.
        skin: The body's skin [m], shape [v, 3].
    """
    floor, height = float(skin[:, 2].min()), float(np.ptp(skin[:, 2]))
    mid = 0.5 * float(skin[:, 1].min() + skin[:, 1].max())
    count = int(pieces.welded.max()) + 1
    shared = np.bincount(pieces.welded, minlength=count)
    x = np.stack([np.bincount(pieces.welded, c) / shared for c in pieces.placed().T], axis=1)
    sides = set()
    try:
        loops = boundary_loops(pieces.sewn_triangles)
    except GeometryError:  # openings that touch
        return False
    for loop in loops:
        y, z = x[loop, 1] - mid, x[loop, 2] - floor
        if z.mean() < _LOW * height and abs(y.mean()) < _INNER * height:
            left = float((y > 0.0).mean())
            if max(left, 1.0 - left) > _ONE_SIDE:
                sides.add(left > _ONE_SIDE)
    return len(sides) == 2


def parted(
    colliders: ColliderSet, poses: ColliderPoses, crotch: float, mid: float, room: float = 0.0
) -> ColliderSet:
    """Colliders with their sampled distances cut at the crotch and at the mid-plane.

    Args:
        colliders: Colliders; sampled ones are parted.
        poses: Where they are.
        crotch: Height of the crotch in the world [m].
        mid: The mid-plane's y in the world [m].
        room: How far each leg stays off it [m]: thighs that touch give way to what is between.
    """
    made: list[Collider] = []
    for k, collider in enumerate(colliders.colliders):
        if collider.kind != SDF.name:
            made.append(collider)
            continue
        grid = DistanceGrid.of(collider.geometry)
        nodes = np.indices(grid.distance.shape).reshape(3, -1).T * grid.cell + grid.low
        T_world_grid = transform_from(poses.position[k], poses.orientation[k])
        _, y, z = transform_points(T_world_grid, nodes).T
        below = z - crotch - _ABOVE
        beyond = {
            "trunk": crotch - _BELOW - z,
            "left_leg": np.maximum(below, mid - y + room),
            "right_leg": np.maximum(below, y - mid + room),
        }
        made += [
            replace(collider, name=f"{collider.name}_{part}", geometry=_cut(grid, outside))
            for part, outside in beyond.items()
        ]
    return replace(colliders, colliders=tuple(made))


def _cut(grid: DistanceGrid, outside: FloatArray) -> dict[str, object]:
    """The part of a shape that is inside of something else as well, whose distances are given."""
    values = grid.step * grid.distance.astype(np.float64)
    cut = DistanceGrid.sampled(grid.cell, np.maximum(values, outside.reshape(values.shape)))
    return cut.geometry()
