"""What the guard does to the cloth of an `implicit` sub-step: planes of contact hold it there."""

import numpy as np

from garment_sim_ros.jit import kernel

_FIRM = np.float32(64.0)
"""How much stiffer the guard's planes are than those of contact: cloth that a limb has stretched
must not pull them back to the limb's core."""


@kernel()
def hold_guarded(guard, contacts, carry, x_start, x_before, x, behind, cloth, hold):
    """Has contact hold the particles that the guard has moved.

    Each meets a plane through its place, across the way that it was moved.

    Args:
        guard: `contact.guard.guard.Guard`.
        contacts: Contacts of the free particles.
        carry: How points move with the shapes in the sub-step, see `PosedShapes`, [m, 3, 4].
        x_start: Positions at the start of the sub-step [m], shape [n, 3].
        x_before: Positions before the guard [m], shape [n, 3].
        x: Positions [m], shape [n, 3].
        behind: Follows x, see `predict_with_share`, shape [n, 3].
        cloth: `solvers.implicit.given.Cloth`.
        hold: `solvers.implicit.given.Hold`, changed in place.

    Returns:
        How many particles it moved.
    """
    moved = 0
    for p in range(guard.kept.size):
        for k in range(3):
            behind[p, k] += x_before[p, k] - x[p, k]
        c = guard.kept[p]
        if c < 0 or not guard.moved[p] > 0.0 or contacts.shape[p] != guard.shape[c]:
            continue
        moved += 1
        s = contacts.shape[p]
        level = np.float32(0.0)
        for k in range(3):
            hold.normal[p, k] = contacts.normal[p, k]
            level += contacts.normal[p, k] * x[p, k]
            hold.lever[p, k] = np.float32(0.0)
            hold.shift[p, k] = (
                carry[s, k, 0] * x_start[p, 0]
                + carry[s, k, 1] * x_start[p, 1]
                + carry[s, k, 2] * x_start[p, 2]
                + carry[s, k, 3]
            )
        hold.level[p] = level
        hold.stiffness[p] = _FIRM * cloth.contact_stiffness[p]
    return moved
