"""Particles that shapes press from two sides, as cloth in an armpit."""

import numpy as np

from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.sides import LET_GO, PASSING
from garment_sim_ros.jit import lean_kernel

_ROUNDS = 6
_FARTHEST = 4.0
"""A crease that is farther away than this, in depths, is none: the shapes oppose each other."""


@lean_kernel(forceinline=True)
def stay_between(shapes, posed, side, p, x_start, px, py, pz, k, thickness, rounding):
    """Where particle p, which came out of more than one shape, is held between two of them.

    Moved out of one after the other, in each step from where its neighbours have pulled it, it
    would never come to rest. But what two sides press has no slip: it stays where it moved to with
    shape k from the start of the step. From there it is moved only as far as the two shapes, the
    nearest and the nearest that faces it, ask for: to the crease where they meet or, where that is
    too far away, to the middle between them. Where nothing has moved that is nowhere, whatever the
    order of shapes.

    Args:
        shapes: Packed shapes.
        posed: The same, posed.
        side: See `Sides`; passing shapes and those let go of press nothing.
        p: The particle.
        x_start: Positions at the start of the step [m], shape [n, 3].
        px: Where it was moved to [m].
        py: See `px`.
        pz: See `px`.
        k: The deepest shape.
        thickness: Distance to keep from the surfaces [m].
        rounding: What distances may be wrong by [m].

    Returns:
        The place where it is held, p as it was where no two shapes press it; and whether they do.
    """
    zero = np.float32(0.0)
    far = np.float32(np.inf)
    sx, sy, sz = x_start[p, 0], x_start[p, 1], x_start[p, 2]
    C = posed.carry
    cx = sx + C[k, 0, 0] * sx + C[k, 0, 1] * sy + C[k, 0, 2] * sz + C[k, 0, 3]
    cy = sy + C[k, 1, 0] * sx + C[k, 1, 1] * sy + C[k, 1, 2] * sz + C[k, 1, 3]
    cz = sz + C[k, 2, 0] * sx + C[k, 2, 1] * sy + C[k, 2, 2] * sz + C[k, 2, 3]
    slip = np.sqrt((px - cx) ** 2 + (py - cy) ** 2 + (pz - cz) ** 2)
    reach = thickness + min(slip, thickness) + rounding
    for step in range(_ROUNDS):
        d1 = d2 = far
        ax = ay = az = bx = by = bz = zero
        # First the nearest shape, then the nearest of those that face it.
        for turn in range(2):
            for m in range(posed.box.shape[0]):
                if side[m, p] == PASSING or side[m, p] == LET_GO:
                    continue
                d, nx, ny, nz = shape_distance(shapes, posed, m, cx, cy, cz, reach)
                if turn == 0:
                    if d < d1:
                        d1, ax, ay, az = d, nx, ny, nz
                elif d < d2 and nx * ax + ny * ay + nz * az < zero:
                    d2, bx, by, bz = d, nx, ny, nz
        if step == 0 and not d2 < far:
            return px, py, pz, False
        first = thickness - d1
        second = thickness - d2
        cosine = ax * bx + ay * by + az * bz
        if not first > rounding:
            break
        if not second - first * cosine > rounding:
            cx += first * ax
            cy += first * ay
            cz += first * az
            continue
        square = max(np.float32(1.0) - cosine * cosine, np.float32(1e-6))
        a = (first - cosine * second) / square
        b = (second - cosine * first) / square
        farthest = np.float32(_FARTHEST) * first
        if a * a + b * b + np.float32(2.0) * a * b * cosine > farthest * farthest:
            a = (first - second) / (np.float32(2.0) - np.float32(2.0) * cosine)
            b = -a
        cx += a * ax + b * bx
        cy += a * ay + b * by
        cz += a * az + b * bz
        if abs(a) + abs(b) < rounding:
            break
    return cx, cy, cz, True
