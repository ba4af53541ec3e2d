"""Particles against a set of collider shapes: points in, corrected points and normals out.

All particles of a garment meet all shapes (`contact_shapes`) in one pass. Neighbouring particles
go together: shapes whose box does not touch the block's box are rejected for all of it, and the
others' bounding capsules for all its particles in one vector loop.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.geometry.contact_capsule import capsule_distance
from garment_sim_ros.geometry.contact_ellipsoid import ellipsoid_distance
from garment_sim_ros.geometry.contact_hull import hull_distance_if_any
from garment_sim_ros.geometry.contact_nearby import (
    gap_to_bounds,
    shapes_near_block,
    shapes_near_particle,
)
from garment_sim_ros.geometry.contact_shapes import PackedShapes, PosedShapes
from garment_sim_ros.geometry.contact_sphere import sphere_distance
from garment_sim_ros.geometry.jit import kernel
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.geometry.shapes import KINDS

SingleArray = NDArray[np.float32]
IntArray = NDArray[np.int32]

_SPHERE = KINDS.index("sphere")
_ELLIPSOID = KINDS.index("ellipsoid")
_HULL = KINDS.index("hull")
_PROJECTIONS = 8
_MARCHING_STEPS = 64
_FARTHEST = 4.0
_GRAZE = 0.02


class Contacts(NamedTuple):
    """What `collide` found for each of n particles, and its scratch arrays.

    Attributes:
        shape: Index of the deepest shape among m packed ones, -1 without contact, shape [n].
        normal: Its outward unit normal, set where there is contact, shape [n, 3].
        depth: How deep the particle was in it [m], set where there is contact, shape [n].
        nearby: Scratch: the shapes near one block; those of them near one particle that are under
            the cloth, that pass it, and that oppose it; and all that are under it; shape [5, m].
        gap: Scratch: how far each particle of a block is from any bound [m^2], shape [BLOCK].
    """

    shape: IntArray
    normal: SingleArray
    depth: SingleArray
    nearby: IntArray
    gap: SingleArray

    @classmethod
    def room_for(cls, particles: int, shapes: int) -> "Contacts":
        """Arrays for so many particles and shapes."""
        return cls(
            shape=np.full(particles, -1, np.int32),
            normal=np.zeros((particles, 3), np.float32),
            depth=np.zeros(particles, np.float32),
            nearby=np.zeros((5, shapes), np.int32),
            gap=np.zeros(BLOCK, np.float32),
        )


UNDER, PASSING, OPPOSED = 0, 1, 2
"""Sides on which a shape can be of a particle, see `Sides`."""


class Sides(NamedTuple):
    """On which side of the cloth the shapes are, for groups of particles.

    `UNDER` the cloth: it lies on them, always. `PASSING`: what the garment is not worn on, such as
    a hand along a skirt, only brushes it. `OPPOSED`: what the garment is worn on elsewhere, such
    as the arm at the side of a shirt; where it presses into what is under the cloth, the cloth
    goes halfway between the two.

    Attributes:
        row: The group of each particle, shape [n].
        side: Side of each shape for each group, shape [r, m].
    """

    row: IntArray
    side: NDArray[np.int8]

    @classmethod
    def of(cls, row: IntArray, side: NDArray[np.int8]) -> "Sides":
        """From the group of each particle and the sides for each group."""
        return cls(
            row=np.ascontiguousarray(row, dtype=np.int32),
            side=np.ascontiguousarray(side, dtype=np.int8),
        )

    @classmethod
    def all_under(cls, particles: int, shapes: int) -> "Sides":
        """All shapes are absolute constraints."""
        return cls.of(np.zeros(particles, np.int32), np.full((1, shapes), UNDER, np.int8))


@kernel(forceinline=True)
def shape_distance(shapes, posed, k, px, py, pz, reach):
    """Signed distance of a point to shape k, infinite above `reach`, and the direction out."""
    qx = px - posed.centre[k, 0]
    qy = py - posed.centre[k, 1]
    qz = pz - posed.centre[k, 2]
    if shapes.kind[k] == _SPHERE:
        return sphere_distance(qx, qy, qz, shapes.size[k, 0], reach)
    if shapes.kind[k] == _HULL:
        return hull_distance_if_any(shapes, posed, k, qx, qy, qz, reach)
    if shapes.kind[k] == _ELLIPSOID:
        return ellipsoid_distance(
            qx,
            qy,
            qz,
            posed.rotation[k],
            shapes.size[k, 0],
            shapes.size[k, 1],
            shapes.size[k, 2],
            reach,
        )
    return capsule_distance(
        qx,
        qy,
        qz,
        posed.rotation[k, 0, 2],
        posed.rotation[k, 1, 2],
        posed.rotation[k, 2, 2],
        shapes.size[k, 0],
        shapes.size[k, 1],
        shapes.size[k, 2],
        shapes.size[k, 3],
        reach,
    )


@kernel(forceinline=True)
def deepest_shape(shapes, posed, nearby, row, count, px, py, pz, reach):
    """The one of the first `count` shapes in a row of `nearby` that is nearest to a point, signed.

    Returns:
        Distance [m], unit direction out of the shape, and the shape's index; infinity and -1
        where no distance is at most `reach`.
    """
    best = np.float32(np.inf)
    bx = by = bz = np.float32(0.0)
    found = -1
    for c in range(count):
        k = nearby[row, c]
        d, nx, ny, nz = shape_distance(shapes, posed, k, px, py, pz, reach)
        if d < best:
            best = d
            bx = nx
            by = ny
            bz = nz
            found = k
    return best, bx, by, bz, found


@kernel(forceinline=True)
def leave_union(shapes, posed, nearby, row, count, px, py, pz, thickness):
    """Moves a point out of the union of shapes, each inflated by `thickness`.

    The rule does not depend on the order of the shapes. Out of the deepest one first: leaving a
    shallower one by its own depth would not get the point out of the deeper. Where that ends
    inside a neighbour this repeats, which walks to the crease between the two; where it walks
    slowly, the rest of the way is marched in the mean direction of the normals met. Where shapes
    oppose each other (an arm that lies in the side, closed legs) the crease may be far away, and
    cloth that is squeezed out to it would be torn off its neighbours: a point that is not free
    within `_FARTHEST` times its depth is pinched, and goes halfway between the two places where
    the deepest shape, and then the next one, let go of it.

    Returns:
        The point: at `thickness` from the nearest shape, or pinched between shapes.
    """
    # Rounding of a distance between coordinates of this size; not a length of the scene.
    ulp = np.float32(4e-7) * (abs(px) + abs(py) + abs(pz))
    sx = px
    sy = py
    sz = pz
    mx = my = mz = np.float32(0.0)
    hx = hy = hz = np.float32(0.0)
    farthest = np.float32(0.0)
    for attempt in range(_PROJECTIONS + _MARCHING_STEPS):
        d, nx, ny, nz, _ = deepest_shape(shapes, posed, nearby, row, count, px, py, pz, thickness)
        depth = thickness - d
        ux = px - sx
        uy = py - sy
        uz = pz - sz
        if attempt >= 2 and ux * ux + uy * uy + uz * uz > farthest * farthest:
            return hx, hy, hz
        if not depth > ulp:
            return px, py, pz
        if attempt < _PROJECTIONS:
            mx += nx
            my += ny
            mz += nz
            px += nx * depth
            py += ny * depth
            pz += nz * depth
            if attempt == 0:
                farthest = np.float32(_FARTHEST) * depth
            if attempt < 2:
                hx += np.float32(0.5) * px
                hy += np.float32(0.5) * py
                hz += np.float32(0.5) * pz
            continue
        if attempt == _PROJECTIONS:
            length = np.sqrt(mx * mx + my * my + mz * mz)
            if length < np.float32(1e-3):
                return hx, hy, hz
            mx /= length
            my /= length
            mz /= length
        # To where the plane of the surface is met, but no farther than ten depths.
        depth /= max(mx * nx + my * ny + mz * nz, np.float32(0.1))
        px += mx * depth
        py += my * depth
        pz += mz * depth
    return hx, hy, hz


@kernel(forceinline=True)
def give_way(shapes, posed, nearby, row, count, px, py, pz, thickness):
    """Moves a point out of the deepest of the shapes that its garment does not lie on.

    A hand that brushes a skirt pushes it, but only as long as it is not deeper than `_GRAZE`; from
    there on it gets weaker, and from twice that depth on the hand passes through: pushed
    on, the cloth would come out on its other side.

    Returns:
        The point, the unit direction in which it went, and the shape; -1 if there was none.
    """
    d, nx, ny, nz, k = deepest_shape(shapes, posed, nearby, row, count, px, py, pz, thickness)
    depth = thickness - d
    if not depth > np.float32(0.0):
        return px, py, pz, nx, ny, nz, -1
    graze = np.float32(_GRAZE)
    push = min(depth, max(np.float32(0.0), graze + graze - depth))
    return px + nx * push, py + ny * push, pz + nz * push, nx, ny, nz, k


@kernel(forceinline=True)
def resist_slip(carry, k, px, py, pz, sx, sy, sz, nx, ny, nz, depth, friction):
    """Friction in terms of positions: takes away slip along a surface, as far as it is pressed.

    The slip of a particle that moves from s to p past a shape with the unit normal n, where a
    point that rides shape k moves as `carry[k]` says (see `PosedShapes`). What presses it is how
    far it came towards the surface in this step; depth that was there before, as where it is
    pinched, does not count again.

    Returns:
        The position with less slip, or none.
    """
    dx = (
        px
        - sx
        - (carry[k, 0, 0] * sx + carry[k, 0, 1] * sy + carry[k, 0, 2] * sz + carry[k, 0, 3])
    )
    dy = (
        py
        - sy
        - (carry[k, 1, 0] * sx + carry[k, 1, 1] * sy + carry[k, 1, 2] * sz + carry[k, 1, 3])
    )
    dz = (
        pz
        - sz
        - (carry[k, 2, 0] * sx + carry[k, 2, 1] * sy + carry[k, 2, 2] * sz + carry[k, 2, 3])
    )
    along = dx * nx + dy * ny + dz * nz
    dx -= along * nx
    dy -= along * ny
    dz -= along * nz
    slip = np.sqrt(dx * dx + dy * dy + dz * dz)
    limit = friction * min(depth, max(-along, np.float32(0.0)))
    held = np.float32(1.0) if slip <= limit else limit / slip
    return px - held * dx, py - held * dy, pz - held * dz


@kernel()
def collide_particles(shapes, posed, sides, x, x_start, thickness, friction, contacts):
    """One pass over all particles; see `collide`."""
    zero = np.float32(0.0)
    nearby = contacts.nearby
    side = sides.side
    count = 0
    for begin in range(0, x.shape[0], BLOCK):
        end = min(begin + BLOCK, x.shape[0])
        for p in range(begin, end):
            contacts.shape[p] = -1
        found, margin = shapes_near_block(posed, x, begin, end, thickness, nearby[0])
        if found == 0:
            continue
        gap_to_bounds(posed.bound, nearby[0, :found], x, begin, end, thickness, contacts.gap)
        for p in range(begin, end):
            if not contacts.gap[p - begin] < zero:
                continue
            px = x[p, 0]
            py = x[p, 1]
            pz = x[p, 2]
            group = sides.row[p]
            under, passing, opposed = shapes_near_particle(
                posed.bound, side, group, nearby, found, px, py, pz, thickness + margin
            )
            k = -1
            nx = ny = nz = zero
            if passing > 0:
                px, py, pz, nx, ny, nz, k = give_way(
                    shapes, posed, nearby, 2, passing, px, py, pz, thickness
                )
            d, mx, my, mz, m = deepest_shape(
                shapes, posed, nearby, 1, under, px, py, pz, thickness
            )
            depth = thickness - d
            if depth > zero:
                k = m
                nx = mx
                ny = my
                nz = mz
            elif k < 0 and opposed == 0:
                continue
            if depth > zero:
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
                if under == 1:
                    # The way out of a single shape is its normal.
                    d, mx, my, mz = shape_distance(shapes, posed, k, px, py, pz, thickness)
                    depth = max(thickness - d, zero)
                    qx = px + mx * depth
                    qy = py + my * depth
                    qz = pz + mz * depth
                else:
                    qx, qy, qz = leave_union(
                        shapes, posed, nearby, 1, under, px, py, pz, thickness
                    )
                ux = qx - x[p, 0]
                uy = qy - x[p, 1]
                uz = qz - x[p, 2]
                if ux * ux + uy * uy + uz * uz > margin * margin:
                    everything = 0
                    for other in range(shapes.kind.size):
                        if side[group, other] == UNDER:
                            nearby[4, everything] = other
                            everything += 1
                    qx, qy, qz = leave_union(
                        shapes, posed, nearby, 4, everything, px, py, pz, thickness
                    )
                px = qx
                py = qy
                pz = qz
            if opposed > 0:
                d, mx, my, mz, m = deepest_shape(
                    shapes, posed, nearby, 3, opposed, px, py, pz, thickness
                )
                if thickness - d > zero:
                    # All the way where nothing is under the cloth here, else half of it.
                    way = thickness - d if k < 0 else np.float32(0.5) * (thickness - d)
                    px += mx * way
                    py += my * way
                    pz += mz * way
                    if k < 0:
                        k = m
                        nx = mx
                        ny = my
                        nz = mz
                        depth = way
                elif k < 0:
                    continue
            count += 1
            contacts.shape[p] = k
            contacts.normal[p, 0] = nx
            contacts.normal[p, 1] = ny
            contacts.normal[p, 2] = nz
            contacts.depth[p] = depth
            x[p, 0] = px
            x[p, 1] = py
            x[p, 2] = pz
    return count


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
