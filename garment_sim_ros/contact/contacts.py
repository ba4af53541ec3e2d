"""What contact found for the particles of a garment."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.contact.block import ROWS
from garment_sim_ros.geometry.boxes import column_of
from garment_sim_ros.geometry.locality import BLOCK


class Contacts(NamedTuple):
    """What `collide` found for each of n particles, and its scratch arrays.

    Attributes:
        shape: Index of the deepest shape among m packed ones, -1 without contact, shape [n].
        normal: Its outward unit normal, set where there is contact, shape [n, 3].
        depth: How deep the particle was in it [m], set where there is contact, infinite where
            another shape presses it against that one, shape [n].
        caught: Whether it is deep between the two, see `contact.pinch`, set where there is
            contact, shape [n].
        columns: Scratch: boxes of the shapes, see `geometry.boxes`.
        near: Scratch: shapes near a block, shape [m + 1].
        distance: Scratch: distances of its particles to those [m], shape [m * BLOCK].
        found: Scratch: shapes near a particle, shape [m + 1].
        least: Scratch: lower bounds of their distances from it [m], shape [m + 1].
        block: Scratch, see `contact.block`.
        cell: Scratch, see `hull_distances`.
        lane: See `cell`.
    """

    shape: IntArray
    normal: SingleArray
    depth: SingleArray
    caught: NDArray[np.bool_]
    columns: SingleArray
    near: IntArray
    distance: SingleArray
    found: IntArray
    least: SingleArray
    block: SingleArray
    cell: IntArray
    lane: IntArray

    @classmethod
    def room_for(cls, particles: int, shapes: int) -> "Contacts":
        """Arrays for so many particles and shapes."""
        return cls(
            shape=np.full(particles, -1, np.int32),
            normal=np.zeros((particles, 3), np.float32),
            depth=np.zeros(particles, np.float32),
            caught=np.zeros(particles, np.bool_),
            columns=np.zeros(6 * column_of(shapes), np.float32),
            near=np.zeros(shapes + 1, np.int32),
            distance=np.zeros(shapes * BLOCK, np.float32),
            found=np.zeros(shapes + 1, np.int32),
            least=np.zeros(shapes + 1, np.float32),
            block=np.zeros(ROWS * BLOCK, np.float32),
            cell=np.zeros(BLOCK, np.int32),
            lane=np.zeros(BLOCK + 1, np.int32),
        )
