"""The way out of a union of overlapping shapes, and out of one that only brushes the cloth."""

import numpy as np

from garment_sim_ros.contact.broad_phase import shapes_on_side
from garment_sim_ros.contact.distance import deepest_shape
from garment_sim_ros.contact.sides import UNDER
from garment_sim_ros.jit import lean_kernel

_PROJECTIONS = 8
_MARCHING_STEPS = 64
_FARTHEST = 4.0
_GRAZE = 0.05
"""Share of the longest shape: 2 cm on a human."""


@lean_kernel(inner=True)
def leave_union(
    shapes,
    posed,
    near,
    least,
    count,
    valid,
    ox,
    oy,
    oz,
    px,
    py,
    pz,
    known,
    d,
    nx,
    ny,
    nz,
    thickness,
    rounding,
):
    """Moves a point out of the union of shapes, each inflated by `thickness`.

    The rule does not depend on the order of the shapes. Out of the deepest one first: leaving a
    shallower one by its own depth would not get the point out of the deeper. Where that ends
    inside a neighbour this repeats, which walks to the crease between the two; where it walks
    slowly, the rest of the way is marched in the mean direction of the normals met. Where shapes
    oppose each other (an arm that lies in the side, closed legs) the crease may be far away, and
    cloth that is squeezed out to it would be torn off its neighbours: a point that is not free
    within `_FARTHEST` times its depth is pinched, and goes halfway between the two places where
    the deepest shape, and then the next one, let go of it.

    Args:
        shapes: Packed shapes.
        posed: The same, posed.
        near: The shapes, the first `count`.
        least: Lower bounds of their distances from o [m].
        count: Their number.
        valid: How far from o these are all shapes that matter [m].
        ox: A point.
        oy: See `ox`.
        oz: See `ox`.
        px: The point that is to leave [m].
        py: See `px`.
        pz: See `px`.
        known: A shape whose distance from p is known; -1 for none.
        d: That distance [m]; infinite for none.
        nx: Unit direction out of that shape.
        ny: See `nx`.
        nz: See `nx`.
        thickness: See above [m].
        rounding: What lower bounds may be wrong by [m].

    Returns:
        The point: at `thickness` from the nearest shape, or pinched between shapes; and whether it
        got there without going farther from o than `valid`.
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
        ux = px - ox
        uy = py - oy
        uz = pz - oz
        moved = np.sqrt(ux * ux + uy * uy + uz * uz) + rounding
        if moved > valid:
            return px, py, pz, False
        d, nx, ny, nz, known = deepest_shape(
            shapes,
            posed,
            near,
            least,
            count,
            moved,
            px,
            py,
            pz,
            thickness,
            known,
            d,
            nx,
            ny,
            nz,
        )
        depth = thickness - d
        ux = px - sx
        uy = py - sy
        uz = pz - sz
        if attempt >= 2 and ux * ux + uy * uy + uz * uz > farthest * farthest:
            return hx, hy, hz, True
        if not depth > ulp:
            return px, py, pz, True
        if attempt < _PROJECTIONS:
            mx += nx
            my += ny
            mz += nz
            px += nx * depth
            py += ny * depth
            pz += nz * depth
            if attempt == 0:
                farthest = np.float32(_FARTHEST) * depth
            d = thickness  # just left
            if attempt < 2:
                hx += np.float32(0.5) * px
                hy += np.float32(0.5) * py
                hz += np.float32(0.5) * pz
            continue
        if attempt == _PROJECTIONS:
            length = np.sqrt(mx * mx + my * my + mz * mz)
            if length < np.float32(1e-3):
                return hx, hy, hz, True
            mx /= length
            my /= length
            mz /= length
        known = np.int64(-1)
        d = np.float32(np.inf)
        # To where the plane of the surface is met, but no farther than ten depths.
        depth /= max(mx * nx + my * ny + mz * nz, np.float32(0.1))
        px += mx * depth
        py += my * depth
        pz += mz * depth
    return hx, hy, hz, True


@lean_kernel(inner=True)
def leave_all(
    shapes,
    posed,
    side,
    p,
    ox,
    oy,
    oz,
    px,
    py,
    pz,
    known,
    d,
    nx,
    ny,
    nz,
    thickness,
    rounding,
    found,
    least,
):
    """`leave_union` of all shapes under particle p."""
    count = shapes_on_side(posed.box, side, p, UNDER, ox, oy, oz, thickness, found, least)
    x, y, z, _ = leave_union(
        shapes,
        posed,
        found,
        least,
        count,
        np.float32(np.inf),
        ox,
        oy,
        oz,
        px,
        py,
        pz,
        known,
        d,
        nx,
        ny,
        nz,
        thickness,
        rounding,
    )
    return x, y, z


@lean_kernel(inner=True)
def give_way(shapes, posed, near, least, count, px, py, pz, thickness, rounding):
    """Moves a point out of the deepest of the shapes that its garment does not lie on.

    A hand that brushes a skirt pushes it, but only as long as it is not deeper than `_GRAZE`; from
    there on it gets weaker, and from twice that depth on the hand passes through: pushed
    on, the cloth would come out on its other side.

    Returns:
        The point, the unit direction in which it went, and the shape; -1 if there was none.
    """
    z = np.float32(0.0)
    d, nx, ny, nz, k = deepest_shape(
        shapes,
        posed,
        near,
        least,
        count,
        rounding,
        px,
        py,
        pz,
        thickness,
        np.int64(-1),
        np.float32(np.inf),
        z,
        z,
        z,
    )
    depth = thickness - d
    if not depth > np.float32(0.0):
        return px, py, pz, nx, ny, nz, -1
    graze = np.float32(_GRAZE) * shapes.longest
    push = min(depth, max(np.float32(0.0), graze + graze - depth))
    return px + nx * push, py + ny * push, pz + nz * push, nx, ny, nz, k
