"""On which side of a garment the shapes are that it meets."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import IntArray
from garment_sim_ros.geometry.locality import BLOCK

# Typed: for each plain number that it is handed a kernel would be compiled once more.
UNDER, PASSING, OPPOSED, LET_GO = (np.int64(side) for side in range(4))
"""Sides on which a shape can be of a particle, see `Sides`."""


class Sides(NamedTuple):
    """On which side of the cloth the shapes are, for each particle.

    `UNDER` the cloth: it lies on them, always. `PASSING`: what the garment is not worn on, such as
    a hand along a skirt, only brushes it. `OPPOSED`: what the garment is worn on elsewhere, such
    as the arm at the side of a shirt; where it presses into what is under the cloth, the cloth
    goes halfway between the two. `LET_GO`: passing, but not there for cloth that hangs on it
    overstretched, see `sim.holds.letting_go`.

    Attributes:
        side: Side of each shape for each particle, shape [m, n].
        mixed: Whether a shape is not under all particles of a block, shape [blocks, m].
    """

    side: NDArray[np.int8]
    mixed: NDArray[np.bool_]

    @classmethod
    def of(cls, row: IntArray, side: NDArray[np.int8]) -> "Sides":
        """From the group of each particle, shape [n], and the sides for each group, [r, m]."""
        per_particle = np.asarray(side, np.int8)[np.asarray(row, np.intp)]
        first = np.arange(0, len(per_particle), BLOCK)
        mixed = np.logical_or.reduceat(per_particle != UNDER, first) if len(first) else None
        return cls(
            side=np.ascontiguousarray(per_particle.T),
            mixed=np.zeros((0, per_particle.shape[1]), bool) if mixed is None else mixed,
        )

    @classmethod
    def all_under(cls, particles: int, shapes: int) -> "Sides":
        """All shapes are absolute constraints."""
        return cls.of(np.zeros(particles, np.int32), np.full((1, shapes), UNDER, np.int8))
