"""Limits of a garment again, in float64 and one particle at a time; nothing but tests runs this.

`distance_limit.hold`, `backstop.hold` and `letting_go`. Shapes are spheres and capsules, see
`naive.signed_distance`.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.sides import LET_GO, PASSING
from naive.naive import Shape, signed_distance


def distance_limit(
    x: FloatArray,
    v: FloatArray,
    x_start: FloatArray,
    normal: FloatArray | None,
    place: FloatArray,
    velocity: FloatArray,
    limit: float,
    dt: float,
) -> tuple[FloatArray, FloatArray] | None:
    """Position and velocity of a particle that is too far from its place; None where it is not.

    Args:
        x: Position [m], shape [3].
        v: Velocity [m/s], shape [3].
        x_start: Position before the sub-step [m], shape [3].
        normal: Of what it touches, shape [3]; None for nothing.
        place: Where it would be as skin at that time [m], shape [3].
        velocity: How fast that moves [m/s], shape [3].
        limit: How far it may be from there [m].
        dt: Sub-step [s]; 0 after a whole step.
    """
    distance = float(np.linalg.norm(x - place))
    if distance <= limit:
        return None
    out = (x - place) / distance
    back = place + limit * out - x
    if normal is not None:
        back = back - min(float(back @ normal), 0.0) * normal
    x = x + back
    v = v - max(float((v - velocity) @ out), 0.0) * out
    if dt > 0.0 and np.linalg.norm(v) * dt > np.linalg.norm(x - x_start):
        v = (x - x_start) / dt
    return x, v


def backstop(
    x: FloatArray,
    v: FloatArray,
    place: FloatArray,
    velocity: FloatArray,
    normal: FloatArray,
    distance: float,
) -> tuple[FloatArray, FloatArray] | None:
    """The same for a particle that is too far behind its place, seen along the normal there."""
    short = float((place - x) @ normal) - distance
    if short <= 0.0:
        return None
    return x + short * normal, v - min(float((v - velocity) @ normal), 0.0) * normal


def let_go(
    x: FloatArray,
    edges: IntArray,
    longest: FloatArray,
    shapes: Sequence[Shape],
    side: NDArray[np.int8],
    thickness: float,
) -> NDArray[np.int8]:
    """Sides of shapes for the free particles after a look at them, shape [m, free].

    Args:
        x: Positions [m], shape [n, 3].
        edges: Pairs of particles, shape [e, 2].
        longest: What each may be long [m], shape [e].
        shapes: All m of them.
        side: Their sides before, shape [m, free].
        thickness: Distance to keep from the surfaces [m].
    """
    after = side.copy()
    for p in range(side.shape[1]):
        mine = (edges == p).any(axis=1)
        length = np.linalg.norm(x[edges[mine, 0]] - x[edges[mine, 1]], axis=1)
        passes = [k for k in range(len(shapes)) if side[k, p] in (PASSING, LET_GO)]
        if (length > longest[mine]).any():
            after[passes, p] = LET_GO
        elif (side[:, p] == LET_GO).any() and all(
            signed_distance(shapes[k], x[p])[0] >= thickness for k in passes
        ):
            after[passes, p] = PASSING
    return after
