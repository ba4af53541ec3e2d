"""Particles against a set of collider shapes: points in, corrected points and normals out.

All particles of a garment meet all shapes in one pass. Shapes whose box does not touch the
garment's are out; so are, for each block of neighbouring particles, those whose box does not
touch the block's. Distances to the others are found for the whole block at once. Most particles
in contact are in one shape, far enough from the next one that nothing else can matter.
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.contact.block import (
    DISTANCE,
    NEAREST,
    NEXT,
    OUTER,
    ROWS,
    WHICH,
    keep_nearest,
    keep_nearest_by_side,
    load_block,
)
from garment_sim_ros.contact.broad_phase import (
    DIAGONAL,
    shapes_near_box,
    shapes_near_particle,
    shapes_on_side,
)
from garment_sim_ros.contact.distance import (
    deepest_shape,
    nearest_of_block,
    shape_distance,
    shape_distances,
)
from garment_sim_ros.contact.friction import resist_slip
from garment_sim_ros.contact.packed import PackedShapes, PosedShapes
from garment_sim_ros.contact.pinch import stay_between
from garment_sim_ros.contact.sides import OPPOSED, PASSING, UNDER, Sides
from garment_sim_ros.contact.way_out import give_way, leave_all, leave_union
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.jit import lean_kernel

_ROUNDING = 1e-6
"""Error of a distance that is computed in one way or another, as a share of the coordinates."""


class Contacts(NamedTuple):
    """What `collide` found for each of n particles, and its scratch arrays.

    Attributes:
        shape: Index of the deepest shape among m packed ones, -1 without contact, shape [n].
        normal: Its outward unit normal, set where there is contact, shape [n, 3].
        depth: How deep the particle was in it [m], set where there is contact, infinite where
            another shape presses it against that one, shape [n].
        near: Scratch: shapes near a block, shape [m + 1].
        distance: Scratch: distances of its particles to those [m], shape [m * BLOCK].
        found: Scratch: shapes near a particle, shape [m + 1].
        least: Scratch: their distances [m], shape [m + 1].
        block: Scratch, see `contact.block`.
        cell: Scratch, see `hull_distances`.
        lane: See `cell`.
    """

    shape: IntArray
    normal: SingleArray
    depth: SingleArray
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
            near=np.zeros(shapes + 1, np.int32),
            distance=np.zeros(shapes * BLOCK, np.float32),
            found=np.zeros(shapes + 1, np.int32),
            least=np.zeros(shapes + 1, np.float32),
            block=np.zeros(ROWS * BLOCK, np.float32),
            cell=np.zeros(BLOCK, np.int32),
            lane=np.zeros(BLOCK + 1, np.int32),
        )


@lean_kernel(inner=True)
def _length(x, y, z):
    return np.sqrt(x * x + y * y + z * z)


@lean_kernel(forceinline=True)
def collide_particles(shapes, posed, sides, x, x_start, thickness, friction, contacts):
    """One pass over all particles; see `collide`."""
    zero = np.float32(0.0)
    far = np.float32(np.inf)
    near = contacts.near
    found = contacts.found
    least = contacts.least
    block = contacts.block
    distance = contacts.distance
    flat = x.reshape(-1)
    touching = 0
    touched = contacts.shape
    touched[:] = -1
    for begin in range(0, x.shape[0], BLOCK):
        end = min(begin + BLOCK, x.shape[0])
        x0, y0, z0, x1, y1, z1 = load_block(flat, begin, end, block)
        # A particle that is not moved farther than this meets no shape that is left out here.
        valid = thickness + np.float32(0.125) * max(x1 - x0, y1 - y0, z1 - z0)
        margin = valid + np.float32(DIAGONAL) * thickness
        count = shapes_near_box(posed.box, x0, y0, z0, x1, y1, z1, margin, near)
        if count == 0:
            continue
        rounding = np.float32(_ROUNDING) * (
            max(abs(x0), abs(x1)) + max(abs(y0), abs(y1)) + max(abs(z0), abs(z1)) + margin
        )
        rim = thickness + rounding
        for c in range(count):
            k = near[c]
            shape_distances(shapes, posed, k, rim, block, contacts.cell, contacts.lane)
            if sides.mixed[begin // BLOCK, k]:
                keep_nearest_by_side(k, sides.side, begin, block)
            else:
                keep_nearest(k, block)
            for p in range(BLOCK):
                distance[c * BLOCK + p] = block[DISTANCE + p]
        for p in range(begin, end):
            lane = p - begin
            nearest = block[NEAREST + lane]
            outer = block[OUTER + lane]
            if not min(nearest, outer) < rim:
                continue
            ox = px = x[p, 0]
            oy = py = x[p, 1]
            oz = pz = x[p, 2]
            k = np.int64(-1)
            nx = ny = nz = depth = away = firm = zero
            pressed = False
            if outer < rim:
                n = shapes_near_particle(
                    sides.side, p, PASSING, near, count, distance, lane, rim, found, least
                )
                if n > 0:
                    px, py, pz, nx, ny, nz, k = give_way(
                        shapes, posed, found, least, n, px, py, pz, thickness, rounding
                    )
                    away = _length(px - ox, py - oy, pz - oz)
            if nearest - away < rim:
                if away == zero:
                    m = np.int64(block[WHICH + lane])
                    d, mx, my, mz, firm = nearest_of_block(
                        shapes, posed, m, block, lane, px, py, pz, rim
                    )
                    if block[NEXT + lane] < min(d, rim):
                        # What seemed the nearest by a bound is not: an ellipsoid.
                        n = shapes_near_particle(
                            sides.side, p, UNDER, near, count, distance, lane, rim, found, least
                        )
                        d, mx, my, mz, m = deepest_shape(
                            shapes,
                            posed,
                            found,
                            least,
                            n,
                            rounding,
                            px,
                            py,
                            pz,
                            rim,
                            m,
                            d,
                            mx,
                            my,
                            mz,
                        )
                else:
                    n = shapes_on_side(
                        posed.box, sides.side, p, UNDER, px, py, pz, thickness, found, least
                    )
                    d, mx, my, mz, m = deepest_shape(
                        shapes,
                        posed,
                        found,
                        least,
                        n,
                        rounding,
                        px,
                        py,
                        pz,
                        thickness,
                        -1,
                        far,
                        zero,
                        zero,
                        zero,
                    )
                if thickness - d > zero:
                    k, nx, ny, nz, depth = m, mx, my, mz, thickness - d
                    if friction > zero:
                        px, py, pz = resist_slip(
                            posed.carry,
                            k,
                            px,
                            py,
                            pz,
                            x_start[p, 0],
                            x_start[p, 1],
                            x_start[p, 2],
                            nx,
                            ny,
                            nz,
                            depth,
                            friction,
                        )
                        slip = _length(px - ox, py - oy, pz - oz)
                        if not slip + rounding < firm:
                            d, mx, my, mz = shape_distance(shapes, posed, k, px, py, pz, rim)
                    left = max(thickness - d, zero)
                    qx = px + mx * left
                    qy = py + my * left
                    qz = pz + mz * left
                    away = _length(qx - ox, qy - oy, qz - oz)
                    # Farther out than `valid` are shapes that the block knows nothing of.
                    if not (block[NEXT + lane] - away > rim and away + rounding <= valid):
                        n = shapes_near_particle(
                            sides.side,
                            p,
                            UNDER,
                            near,
                            count,
                            distance,
                            lane,
                            rim + valid,
                            found,
                            least,
                        )
                        qx, qy, qz, there = leave_union(
                            shapes,
                            posed,
                            found,
                            least,
                            n,
                            valid,
                            ox,
                            oy,
                            oz,
                            px,
                            py,
                            pz,
                            k,
                            d,
                            mx,
                            my,
                            mz,
                            thickness,
                            rounding,
                        )
                        if not there:
                            qx, qy, qz = leave_all(
                                shapes,
                                posed,
                                sides.side,
                                p,
                                ox,
                                oy,
                                oz,
                                px,
                                py,
                                pz,
                                k,
                                d,
                                mx,
                                my,
                                mz,
                                thickness,
                                rounding,
                                found,
                                least,
                            )
                        away = _length(qx - ox, qy - oy, qz - oz)
                        ux, uy, uz = px + mx * left, py + my * left, pz + mz * left
                        pressed = _length(qx - ux, qy - uy, qz - uz) > rounding
                    px, py, pz = qx, qy, qz
            if outer - away < rim:
                if away < valid:
                    n = shapes_near_particle(
                        sides.side,
                        p,
                        OPPOSED,
                        near,
                        count,
                        distance,
                        lane,
                        rim + away,
                        found,
                        least,
                    )
                else:
                    n = shapes_on_side(
                        posed.box, sides.side, p, OPPOSED, ox, oy, oz, thickness, found, least
                    )
                d, mx, my, mz, m = deepest_shape(
                    shapes,
                    posed,
                    found,
                    least,
                    n,
                    away + rounding,
                    px,
                    py,
                    pz,
                    thickness,
                    -1,
                    far,
                    zero,
                    zero,
                    zero,
                )
                if thickness - d > zero:
                    # All the way where nothing is under the cloth here, else half of it.
                    way = thickness - d if k < 0 else np.float32(0.5) * (thickness - d)
                    px, py, pz = px + mx * way, py + my * way, pz + mz * way
                    if k < 0:
                        k, nx, ny, nz, depth = m, mx, my, mz, way
                    else:
                        pressed, depth = True, far
            if k < 0:
                continue
            if pressed:
                px, py, pz, held = stay_between(
                    shapes, posed, sides.side, p, x_start, px, py, pz, k, thickness, rounding
                )
                depth = far if held else depth
            touching += 1
            touched[p] = k
            contacts.normal[p, 0] = nx
            contacts.normal[p, 1] = ny
            contacts.normal[p, 2] = nz
            contacts.depth[p] = depth
            x[p, 0] = px
            x[p, 1] = py
            x[p, 2] = pz
    return touching


def collide(
    shapes: PackedShapes,
    posed: PosedShapes,
    sides: Sides,
    x: SingleArray,
    x_start: SingleArray,
    thickness: float,
    friction: float,
    contacts: Contacts,
) -> int:
    """Moves particles out of all shapes: an absolute, fully inelastic constraint.

    Friction acts first, on the proposed position: the slip relative to the moving shape shrinks by
    at most `friction` times how far it came towards the shape, up to the depth (Coulomb's law in
    terms of positions), all of it where that is enough. The particle is then moved out of the
    union of the shapes, see `leave_union`.

    That holds for the shapes under the cloth; for those on its outer side see `Sides`. Passing
    ones push first and only a little, see `give_way`, so that a hand never drives cloth into the
    leg it hangs on.

    Args:
        shapes: Packed shapes.
        posed: The same, posed for this step.
        sides: On which side of which particle they are.
        x: Proposed positions at the end of the step, corrected in place [m], shape [n, 3].
        x_start: Positions at its start [m], shape [n, 3].
        thickness: Distance to keep from the surfaces [m].
        friction: Coulomb coefficient; 0 is the first paper's frictionless contact.
        contacts: Output.

    Returns:
        Number of particles in contact.
    """
    return int(
        collide_particles(
            shapes, posed, sides, x, x_start, np.float32(thickness), np.float32(friction), contacts
        )
    )
