"""Contacts of an `implicit` sub-step: planes with springs, in the energy and in the matrix."""

import numpy as np

from garment_sim_ros.jit import kernel

_GIVE = np.float32(1 / 32)
"""How far contact with a fast shape may give way, in radii of a ball that fits into that."""
_STIFFEST = np.float32(4.0**6)
"""How much stiffer contact with fast shapes becomes at most."""


@kernel(forceinline=True)
def on_the_cone(ux, uy, uz, nx, ny, nz, gap, friction):
    """A contact's force over its stiffness: the gap along the normal, and as much of u as holds.

    That is the part of u across the normal, shortened to friction times the gap (Coulomb's law).
    """
    along = ux * nx + uy * ny + uz * nz
    ux -= along * nx
    uy -= along * ny
    uz -= along * nz
    slip = np.sqrt(ux * ux + uy * uy + uz * uz)
    limit = friction * gap
    held = np.float32(1.0) if slip <= limit else limit / slip
    return held * ux + gap * nx, held * uy + gap * ny, held * uz + gap * nz


@kernel(inner=True)
def take_hold(x, x_start, cloth, met, hold):
    """Planes of contact after a search with `lift` on top of the thickness.

    Each lies across the way out that the search found, `lift` below where that ends; a particle
    that is pinched between two sides is to go all the way.

    Args:
        x: Positions [m], shape [free, 3].
        x_start: Positions at the start of the sub-step [m], shape [free, 3].
        cloth: `solvers.implicit.given.Cloth`; `clear` are the positions that the search moved
            to thickness and lift.
        met: `solvers.implicit.given.Met`. Contact is stiffer where `swift` times the way of
            the surface in the sub-step is more than a part of the shape's inscribed radius.
        hold: `solvers.implicit.given.Hold`, changed in place.
    """
    x_clear, stiffness = cloth.clear, cloth.contact_stiffness
    contacts, carry, inner, lift, swift = met.contacts, met.carry, met.inner, met.lift, met.swift
    zero = np.float32(0.0)
    for p in range(x.shape[0]):
        c = contacts.shape[p]
        if c < 0:
            hold.stiffness[p] = zero
            continue
        if hold.stiffness[p] == zero:
            hold.lever[p] = zero
        dx = x_clear[p, 0] - x[p, 0]
        dy = x_clear[p, 1] - x[p, 1]
        dz = x_clear[p, 2] - x[p, 2]
        way = np.sqrt(dx * dx + dy * dy + dz * dz)
        if way > np.float32(0.1) * lift:
            way = np.float32(1.0) / way
            hold.normal[p, 0] = way * dx
            hold.normal[p, 1] = way * dy
            hold.normal[p, 2] = way * dz
        else:
            hold.normal[p] = contacts.normal[p]
        level = zero if contacts.depth[p] == np.float32(np.inf) else -lift
        moved_with = zero
        sx, sy, sz = x_start[p, 0], x_start[p, 1], x_start[p, 2]
        for k in range(3):
            level += hold.normal[p, k] * x_clear[p, k]
            hold.shift[p, k] = (
                carry[c, k, 0] * sx + carry[c, k, 1] * sy + carry[c, k, 2] * sz + carry[c, k, 3]
            )
            moved_with += hold.shift[p, k] * hold.shift[p, k]
        # Few values, so that the matrix seldom changes.
        stiffer = np.float32(1.0)
        give = max(lift, _GIVE * inner[c])
        while stiffer < min(swift * np.sqrt(moved_with) / give, _STIFFEST):
            stiffer *= np.float32(4.0)
        hold.stiffness[p] = stiffer * stiffness[p]
        hold.level[p] = level


@kernel(inner=True)
def update_diagonal(base, place, owner, hold, diagonal, changed):
    """The matrix's diagonal with the contacts' stiffnesses; marks the fronts that it changes.

    Args:
        base: Without contacts, in the order of elimination [N/m], shape [free].
        place: Column of each particle, shape [free].
        owner: Front of each column, shape [free].
        hold: `solvers.implicit.given.Hold`.
        diagonal: Changed in place [N/m], shape [free].
        changed: Set where a front has another entry now, shape [fronts].
    """
    for p in range(place.size):
        q = place[p]
        now = base[q] + np.float64(hold.stiffness[p])
        if now != diagonal[q]:
            diagonal[q] = now
            changed[owner[q]] = True
