"""The way out of a union of overlapping shapes, and out of one that only brushes the cloth."""

import numpy as np

from garment_sim_ros.contact.nearby import Surface, deepest, no_surface
from garment_sim_ros.geometry.vectors import along, dot, length, less, plus
from garment_sim_ros.jit import lean_kernel

_PROJECTIONS = 8
_MARCHING_STEPS = 64
_FARTHEST = 4.0
_GRAZE = 0.05
"""Share of the longest shape: 2 cm on a human."""


@lean_kernel(inner=True)
def leave_union(nearby, found, valid, asked, place, surface):
    """Moves a point out of the union of shapes, each inflated by the thickness.

    The rule does not depend on the order of the shapes. Out of the deepest one first: leaving a
    shallower one by its own depth would not get the point out of the deeper. Where that ends
    inside a neighbour this repeats, which walks to the crease between the two; where it walks
    slowly, the rest of the way is marched in the mean direction of the normals met. Where shapes
    oppose each other (an arm that lies in the side, closed legs) the crease may be far away, and
    cloth that is squeezed out to it would be torn off its neighbours: a point that is not free
    within `_FARTHEST` times its depth is pinched, and goes halfway between the two places where
    the deepest shape, and then the next one, let go of it.

    Args:
        nearby: `Nearby`.
        found: How many shapes were found near `asked`.
        valid: How far from there these are all shapes that matter [m].
        asked: Where the point was to be [m].
        place: Where it leaves from [m].
        surface: `Surface` there that is known, or none.

    Returns:
        The point: at the thickness from the nearest shape, or pinched between shapes; and whether
        it got there without going farther from `asked` than `valid`.
    """
    zero = np.float32(0.0)
    thickness = nearby.reach.thickness
    # Rounding of a distance between coordinates of this size; not a length of the scene.
    ulp = np.float32(4e-7) * (abs(place[0]) + abs(place[1]) + abs(place[2]))
    start = place
    ahead = halfway = (zero, zero, zero)
    farthest = zero
    for attempt in range(_PROJECTIONS + _MARCHING_STEPS):
        moved = length(less(place, asked)) + nearby.reach.rounding
        if moved > valid:
            return place, False
        surface = deepest(nearby, found, moved, place, thickness, surface)
        depth = thickness - surface.distance
        way = less(place, start)
        if attempt >= 2 and dot(way, way) > farthest * farthest:
            return halfway, True
        if not depth > ulp:
            return place, True
        if attempt < _PROJECTIONS:
            ahead = plus(ahead, surface.normal)
            place = along(place, surface.normal, depth)
            if attempt == 0:
                farthest = np.float32(_FARTHEST) * depth
            if attempt < 2:
                halfway = along(halfway, place, np.float32(0.5))
            surface = Surface(thickness, surface.normal, surface.shape)  # just left
            continue
        if attempt == _PROJECTIONS:
            size = length(ahead)
            if size < np.float32(1e-3):
                return halfway, True
            ahead = (ahead[0] / size, ahead[1] / size, ahead[2] / size)
        # To where the plane of the surface is met, but no farther than ten depths.
        depth /= max(dot(ahead, surface.normal), np.float32(0.1))
        place = along(place, ahead, depth)
        surface = no_surface()
    return halfway, True


@lean_kernel(inner=True)
def give_way(nearby, found, place):
    """Moves a point out of the deepest of the shapes that its garment does not lie on.

    A hand that brushes a skirt pushes it, but only as long as it is not deeper than `_GRAZE`; from
    there on it gets weaker, and from twice that depth on the hand passes through: pushed
    on, the cloth would come out on its other side.

    Args:
        nearby: `Nearby`.
        found: How many such shapes were found near the point.
        place: The point [m].

    Returns:
        The point, and the surface that it was behind; its shape is -1 if there was none.
    """
    thickness = nearby.reach.thickness
    surface = deepest(nearby, found, nearby.reach.rounding, place, thickness, no_surface())
    depth = thickness - surface.distance
    if not depth > np.float32(0.0):
        return place, Surface(surface.distance, surface.normal, np.int64(-1))
    graze = np.float32(_GRAZE) * nearby.shapes.longest
    push = min(depth, max(np.float32(0.0), graze + graze - depth))
    return along(place, surface.normal, push), surface
