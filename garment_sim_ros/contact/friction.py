"""Friction in terms of positions."""

import numpy as np

from garment_sim_ros.geometry.vectors import along, dot, length, less
from garment_sim_ros.jit import lean_kernel


@lean_kernel(inner=True)
def moved_with(carry, k, place):
    """How far a point fixed to shape k moves from a place in the step [m].

    Args:
        carry: See `PosedShapes`.
        k: The shape.
        place: Where the point is at the start [m].
    """
    x, y, z = place
    return (
        carry[k, 0, 0] * x + carry[k, 0, 1] * y + carry[k, 0, 2] * z + carry[k, 0, 3],
        carry[k, 1, 0] * x + carry[k, 1, 1] * y + carry[k, 1, 2] * z + carry[k, 1, 3],
        carry[k, 2, 0] * x + carry[k, 2, 1] * y + carry[k, 2, 2] * z + carry[k, 2, 3],
    )


@lean_kernel(inner=True)
def resist_slip(carry, start, place, touch, friction):
    """Friction in terms of positions: takes away slip along a surface, as far as it is pressed.

    What presses a particle is how far it came towards the surface in this step; depth that was
    there before, as where it is pinched, does not count again.

    Args:
        carry: How points move with the shapes, see `PosedShapes`.
        start: Where the particle was at the start of the step [m].
        place: Where it is now [m].
        touch: `Touch`: the shape, its unit normal, and how deep the particle is in it [m].
        friction: Coulomb coefficient.

    Returns:
        The position with less slip, or none.
    """
    slip = less(less(place, start), moved_with(carry, touch.shape, start))
    towards = dot(slip, touch.normal)
    slip = along(slip, touch.normal, -towards)
    far = length(slip)
    limit = friction * min(touch.depth, max(-towards, np.float32(0.0)))
    held = np.float32(1.0) if far <= limit else limit / far
    return along(place, slip, -held)
