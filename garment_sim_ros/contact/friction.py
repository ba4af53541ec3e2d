"""Friction in terms of positions."""

import numpy as np

from garment_sim_ros.jit import lean_kernel


@lean_kernel(inner=True)
def resist_slip(carry, k, px, py, pz, sx, sy, sz, nx, ny, nz, depth, friction):
    """Friction in terms of positions: takes away slip along a surface, as far as it is pressed.

    The slip of a particle that moves from s to p past a shape with the unit normal n, where a
    point fixed to shape k moves as `carry[k]` says (see `PosedShapes`). What presses it is how
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
