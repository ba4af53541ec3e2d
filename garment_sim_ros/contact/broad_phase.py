"""Which shapes come near one particle of a block; for the block see `geometry.boxes`."""

import numpy as np

from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.jit import lean_kernel

DIAGONAL = 1.8
"""A box that is wider by some length on all sides holds no point farther out than this, times it:
the root of three, and some."""


@lean_kernel(inner=True)
def shapes_near_particle(side, p, wanted, near, count, distance, lane, reach, found, least):
    """Finds the shapes on one side of particle p that are at most `reach` away from it.

    Args:
        side: See `Sides`.
        p: The particle.
        wanted: The side.
        near: Shapes near its block.
        count: Their number.
        distance: Distances of the block's particles to those, flat, shape [count * BLOCK].
        lane: Which of the block's particles this is.
        reach: How far away a shape may be [m].
        found: Output, the shapes.
        least: Output, their distances [m].

    Returns:
        Number of shapes found.
    """
    n = 0
    for c in range(count):
        k = near[c]
        d = distance[c * BLOCK + lane]
        found[n] = k
        least[n] = d
        n += 1 if (d <= reach) & (side[k, p] == wanted) else 0
    return n


@lean_kernel(inner=True)
def shapes_on_side(box, side, p, wanted, px, py, pz, thickness, found, least):
    """All shapes on one side of particle p, with lower bounds of their distances from a point."""
    n = 0
    for k in range(box.shape[0]):
        d = max(
            max(max(box[k, 0] - px, px - box[k, 3]), max(box[k, 1] - py, py - box[k, 4])),
            max(box[k, 2] - pz, pz - box[k, 5]),
        )
        # Faces of a hull that are moved out by `thickness` meet farther out than its box.
        least[n] = d - np.float32(DIAGONAL - 1.0) * thickness
        found[n] = k
        n += 1 if side[k, p] == wanted else 0
    return n
