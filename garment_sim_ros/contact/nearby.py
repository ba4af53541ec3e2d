"""The shapes near a block of particles, and the nearest one to a particle of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.contact.block import DISTANCE, keep_nearest, keep_nearest_by_side
from garment_sim_ros.contact.broad_phase import shapes_near_particle, shapes_on_side
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.distance import deepest_shape, shape_distances
from garment_sim_ros.contact.packed import PackedShapes, PosedShapes
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.jit import lean_kernel

Vector = tuple[np.float32, np.float32, np.float32]


class Reach(NamedTuple):
    """Distances that contact of a block goes by [m].

    Attributes:
        thickness: To keep from the surfaces.
        rounding: What a computed distance may be wrong by.
        rim: Thickness and rounding: a particle that is nowhere nearer to a shape touches none.
        valid: A particle that is not moved farther meets no shape but those near the block.
    """

    thickness: np.float32
    rounding: np.float32
    rim: np.float32
    valid: np.float32


class Nearby(NamedTuple):
    """What the particles of a block may touch.

    Attributes:
        shapes: Packed shapes.
        posed: The same, posed.
        side: See `Sides`.
        near: How many of the shapes are near the block: the first ones in `contacts.near`.
        reach: How near.
        contacts: Its scratch arrays say which shapes are near the block, and near the particle
            that was asked for last: `found`.
    """

    shapes: PackedShapes
    posed: PosedShapes
    side: NDArray[np.int8]
    near: int
    reach: Reach
    contacts: Contacts


class Surface(NamedTuple):
    """The surface of the shape that is nearest to a point.

    Attributes:
        distance: Of the point, negative inside [m]; infinite where none is near.
        normal: Unit direction out of the shape there.
        shape: The shape; -1 where none is near.
    """

    distance: np.float32
    normal: Vector
    shape: np.int64


@lean_kernel(inner=True)
def no_surface():
    """Where no shape is near."""
    zero = np.float32(0.0)
    return Surface(np.float32(np.inf), (zero, zero, zero), np.int64(-1))


@lean_kernel(inner=True)
def measure_block(nearby, sides, begin):
    """Distances of a block's particles to the shapes near it, see `contact.block`.

    Args:
        nearby: `Nearby`; its scratch arrays are filled.
        sides: `Sides`.
        begin: First particle of the block.
    """
    contacts, block = nearby.contacts, nearby.contacts.block
    for c in range(nearby.near):
        k = contacts.near[c]
        shape_distances(
            *(nearby.shapes, nearby.posed, k, nearby.reach.rim, block),
            *(contacts.cell, contacts.lane),
        )
        if sides.mixed[begin // BLOCK, k]:
            keep_nearest_by_side(k, sides.side, begin, block)
        else:
            keep_nearest(k, block)
        for p in range(BLOCK):
            contacts.distance[c * BLOCK + p] = block[DISTANCE + p]


@lean_kernel(inner=True)
def find_near(nearby, p, lane, wanted, reach):
    """How many shapes near the block are on a side of particle p and at most `reach` away."""
    contacts = nearby.contacts
    return shapes_near_particle(
        *(nearby.side, p, wanted, contacts.near, nearby.near, contacts.distance),
        *(lane, reach, contacts.found, contacts.least),
    )


@lean_kernel(inner=True)
def find_on_side(nearby, p, wanted, place):
    """How many of all shapes are on a side of particle p; they are bounded from a place."""
    contacts = nearby.contacts
    return shapes_on_side(
        *(nearby.posed.box, nearby.side, p, wanted, place[0], place[1], place[2]),
        *(nearby.reach.thickness, contacts.found, contacts.least),
    )


@lean_kernel(inner=True)
def deepest(nearby, found, moved, place, reach, known):
    """The surface of the deepest of the shapes found near a particle.

    Args:
        nearby: `Nearby`.
        found: How many were found.
        moved: How far the place is from where they were looked for [m].
        place: The place [m].
        reach: Distances above this need not be known [m].
        known: A `Surface` that is known; the result where no other one is nearer.
    """
    n = known.normal
    d, nx, ny, nz, k = deepest_shape(
        *(nearby.shapes, nearby.posed, nearby.contacts.found, nearby.contacts.least, found, moved),
        *(place, reach, known.shape, (known.distance, n[0], n[1], n[2])),
    )
    return Surface(d, (nx, ny, nz), k)
