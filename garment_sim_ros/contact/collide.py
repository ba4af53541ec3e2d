"""Particles against a set of collider shapes: points in, corrected points and normals out.

All particles of a garment meet all shapes in one pass. Shapes whose box does not touch the
garment's are out; so are, for each block of neighbouring particles, those whose box does not
touch the block's. Distances to the others are found for the whole block at once. Most particles
in contact are in one shape, far enough from the next one that nothing else can matter.
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.contact.block import NEAREST, NEXT, OUTER, WHICH, load_block
from garment_sim_ros.contact.broad_phase import DIAGONAL
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.distance import nearest_of_block, shape_distance
from garment_sim_ros.contact.friction import resist_slip
from garment_sim_ros.contact.nearby import (
    Nearby,
    Reach,
    Surface,
    Vector,
    deepest,
    find_near,
    find_on_side,
    measure_block,
    no_surface,
)
from garment_sim_ros.contact.packed import PackedShapes, PosedShapes
from garment_sim_ros.contact.pinch import stay_between
from garment_sim_ros.contact.sides import OPPOSED, PASSING, UNDER, Sides
from garment_sim_ros.contact.way_out import give_way, leave_union
from garment_sim_ros.geometry.boxes import boxes_near, in_columns
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.geometry.vectors import along, dot, length, less, row
from garment_sim_ros.jit import lean_kernel

_ROUNDING = 1e-6
"""Error of a distance that is computed in one way or another, as a share of the coordinates."""
_ZERO = np.float32(0.0)
_FAR = np.float32(np.inf)


class Touch(NamedTuple):
    """Where a particle touches a shape.

    Attributes:
        shape: The shape, -1 for none.
        normal: Its outward unit normal.
        depth: How deep the particle is in it [m]; infinite where another shape presses it there.
    """

    shape: np.int64
    normal: Vector
    depth: np.float32


@lean_kernel(forceinline=True)
def collide_particles(shapes, posed, sides, x, x_start, thickness, friction, contacts):
    """One pass over all particles; see `collide`."""
    touching = 0
    contacts.shape[:] = -1
    in_columns(posed.box, contacts.columns)
    for begin in range(0, x.shape[0], BLOCK):
        end = min(begin + BLOCK, x.shape[0])
        near, reach = _find_block(x, begin, end, thickness, contacts)
        if near == 0:
            continue
        nearby = Nearby(shapes, posed, sides.side, near, reach, contacts)
        measure_block(nearby, sides, begin)
        for p in range(begin, end):
            touching += _meet(nearby, p, p - begin, x, x_start, friction)
    return touching


@lean_kernel(inner=True)
def _find_block(x, begin, end, thickness, contacts):
    """How many shapes are near to particles begin to end - 1, and the `Reach` of these."""
    x0, y0, z0, x1, y1, z1 = load_block(x.reshape(-1), begin, end, contacts.block)
    valid = thickness + np.float32(0.125) * max(x1 - x0, y1 - y0, z1 - z0)
    margin = valid + np.float32(DIAGONAL) * thickness
    near = boxes_near(contacts.columns, x0, y0, z0, x1, y1, z1, margin, contacts.near)
    rounding = np.float32(_ROUNDING) * (
        max(abs(x0), abs(x1)) + max(abs(y0), abs(y1)) + max(abs(z0), abs(z1)) + margin
    )
    return near, Reach(thickness, rounding, thickness + rounding, valid)


@lean_kernel(inner=True)
def _meet(nearby, p, lane, x, x_start, friction):
    """Moves a particle of the block out of the shapes near it.

    Args:
        nearby: `Nearby`, measured; what is found goes to its `contacts`.
        p: The particle.
        lane: Which of the block's particles this is.
        x: Proposed positions [m], changed in place, shape [n, 3].
        x_start: Positions at the start of the step [m], shape [n, 3].
        friction: Coulomb coefficient.

    Returns:
        Whether it touches any.
    """
    reach, contacts = nearby.reach, nearby.contacts
    nearest, outer = contacts.block[NEAREST + lane], contacts.block[OUTER + lane]
    if not min(nearest, outer) < reach.rim:
        return False
    asked = place = row(x, p)
    touch = Touch(np.int64(-1), (_ZERO, _ZERO, _ZERO), _ZERO)
    away = _ZERO
    pressed = False
    if outer < reach.rim:
        place, touch = _brush(nearby, p, lane, place)
        away = length(less(place, asked))
    if nearest - away < reach.rim:
        start = row(x_start, p)
        place, touch, pressed = _leave_under(
            nearby, p, lane, asked, place, away, start, friction, touch
        )
        away = length(less(place, asked))
    if outer - away < reach.rim:
        place, touch, presses = _yield_to_opposed(nearby, p, lane, asked, place, away, touch)
        pressed = pressed or presses
    if touch.shape < 0:
        return False
    depth, caught = touch.depth, False
    if pressed:
        place, held, caught = stay_between(
            *(nearby.shapes, nearby.posed, nearby.side, p, x_start, asked, place),
            *(touch.shape, reach.thickness, reach.rounding),
        )
        depth = _FAR if held else depth
    contacts.shape[p] = touch.shape
    contacts.normal[p, 0], contacts.normal[p, 1], contacts.normal[p, 2] = touch.normal
    contacts.depth[p] = depth
    contacts.caught[p] = caught
    x[p, 0], x[p, 1], x[p, 2] = place
    return True


@lean_kernel(inner=True)
def _brush(nearby, p, lane, place):
    """Moves a particle out of what passes its garment by, see `give_way`.

    Returns:
        The place [m], and the `Touch`.
    """
    found = find_near(nearby, p, lane, PASSING, nearby.reach.rim)
    touch = Touch(np.int64(-1), (_ZERO, _ZERO, _ZERO), _ZERO)
    if found > 0:
        place, surface = give_way(nearby, found, place)
        touch = Touch(surface.shape, surface.normal, _ZERO)
    return place, touch


@lean_kernel(inner=True)
def _leave_under(nearby, p, lane, asked, place, away, start, friction, touch):
    """Moves a particle out of the union of the shapes under the cloth, after friction.

    Args:
        nearby: `Nearby`.
        p: The particle.
        lane: Which of the block's particles this is.
        asked: Where it was to go [m].
        place: Where it is now [m].
        away: How far that is from there [m].
        start: Where it was at the start of the step [m].
        friction: Coulomb coefficient.
        touch: The `Touch` until now.

    Returns:
        The place [m], the `Touch`, and whether more than one shape presses.
    """
    reach, block = nearby.reach, nearby.contacts.block
    surface, firm = _nearest_under(nearby, p, lane, place, away)
    depth = reach.thickness - surface.distance
    if not depth > _ZERO:
        return place, touch, False
    touch = Touch(surface.shape, surface.normal, depth)
    if friction > _ZERO:
        place = resist_slip(nearby.posed.carry, start, place, touch, friction)
        slip = length(less(place, asked))
        if not slip + reach.rounding < firm:
            k = surface.shape
            d, nx, ny, nz = shape_distance(
                nearby.shapes, nearby.posed, k, place[0], place[1], place[2], reach.rim
            )
            surface = Surface(d, (nx, ny, nz), k)
    out = along(place, surface.normal, max(reach.thickness - surface.distance, _ZERO))
    away = length(less(out, asked))
    # Farther out than `valid` are shapes that the block knows nothing of.
    if block[NEXT + lane] - away > reach.rim and away + reach.rounding <= reach.valid:
        return out, touch, False
    found = find_near(nearby, p, lane, UNDER, reach.rim + reach.valid)
    valid = reach.valid
    free, there = place, False
    while not there:
        free, there = leave_union(nearby, found, valid, asked, place, surface)
        if not there:
            found, valid = find_on_side(nearby, p, UNDER, asked), _FAR
    return free, touch, length(less(free, out)) > reach.rounding


@lean_kernel(inner=True)
def _nearest_under(nearby, p, lane, place, away):
    """The surface of the shape under the cloth that a particle is deepest in.

    Returns:
        The `Surface`, and how far along it that stays as it is, at least [m].
    """
    reach, block = nearby.reach, nearby.contacts.block
    surface, firm, limit = no_surface(), _ZERO, reach.thickness
    if away != _ZERO:
        found = find_on_side(nearby, p, UNDER, place)
    else:
        k = np.int64(block[WHICH + lane])
        d, nx, ny, nz, firm = nearest_of_block(
            *(nearby.shapes, nearby.posed, k, block, lane, place[0], place[1], place[2]),
            reach.rim,
        )
        surface = Surface(d, (nx, ny, nz), k)
        if not block[NEXT + lane] < min(d, reach.rim):
            return surface, firm
        # What seemed the nearest by a bound is not: an ellipsoid.
        found, limit = find_near(nearby, p, lane, UNDER, reach.rim), reach.rim
    return deepest(nearby, found, reach.rounding, place, limit, surface), firm


@lean_kernel(inner=True)
def _yield_to_opposed(nearby, p, lane, asked, place, away, touch):
    """Moves a particle out of what presses the cloth from its outer side.

    All the way; halfway back from what is under the cloth there and faces it.

    Args: as `_leave_under`.

    Returns:
        The place [m], the `Touch`, and whether it is pressed against another shape.
    """
    reach = nearby.reach
    if away < reach.valid:
        found = find_near(nearby, p, lane, OPPOSED, reach.rim + away)
    else:
        found = find_on_side(nearby, p, OPPOSED, asked)
    moved = away + reach.rounding
    surface = deepest(nearby, found, moved, place, reach.thickness, no_surface())
    depth = reach.thickness - surface.distance
    if not depth > _ZERO:
        return place, touch, False
    place = along(place, surface.normal, depth)
    pressed = touch.shape >= 0
    if pressed:
        touch = Touch(touch.shape, touch.normal, _FAR)
    else:
        touch = Touch(surface.shape, surface.normal, depth)
    away = length(less(place, asked))
    if nearby.contacts.block[NEAREST + lane] - away > reach.rim and away < reach.valid:
        return place, touch, pressed
    below, _ = _nearest_under(nearby, p, lane, place, away)
    deep = reach.thickness - below.distance
    if not deep > reach.rounding:
        return place, touch, pressed
    if not dot(below.normal, surface.normal) < _ZERO:
        return along(place, below.normal, deep), touch, pressed
    place = along(place, below.normal, np.float32(0.5) * deep)
    return place, Touch(below.shape, below.normal, _FAR), True


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
