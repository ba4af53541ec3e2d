"""Which cores belong outside of which triangles of a garment: a hand, a shirt's arm at its side.

What passes a garment by is outside of all of it. What it is worn on is outside of the triangles
that face it at rest, as the arm is of a shirt's side. Beside and behind others it is under them:
the chest is not outside of the sleeve that begins on it, nor of the shirt's side below.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.sides import LET_GO, PASSING, UNDER

_FACES = 0.3
"""Least cosine of the angle between a triangle's normal and the way to a core that it faces."""


def outside(
    side: NDArray[np.int8], ends: FloatArray, triangles: IntArray, x: FloatArray
) -> NDArray[np.bool_]:
    """Whether each core belongs outside of each triangle, shape [c, t].

    Args:
        side: The side on which its shape is of each free particle, see `Sides`, shape [c, n].
        ends: Both ends of each core at rest [m], NaN where that is not known, shape [c, 2, 3].
        triangles: As particles, counter-clockwise from outside, shape [t, 3].
        x: All particles at rest [m], shape [n + p, 3].
    """
    half = 0.5 * np.count_nonzero(triangles < side.shape[1], axis=1)

    def of_most_corners(is_so: NDArray[np.bool_]) -> NDArray[np.bool_]:
        padded = np.pad(is_so, ((0, 0), (0, 1)))  # pinned corners have no say
        count: IntArray = padded[:, np.minimum(triangles, side.shape[1])].sum(axis=2)
        return count > half

    passes = of_most_corners((side == PASSING) | (side == LET_GO))
    return of_most_corners(side != UNDER) & (passes | _faced(ends, x[triangles]))


def _faced(ends: FloatArray, corners: FloatArray) -> NDArray[np.bool_]:
    """Whether each triangle faces each core, shape [c, t]; so it is where the core is unknown."""
    centre = corners.mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    p, d = ends[:, 0], ends[:, 1] - ends[:, 0]
    t = np.einsum("tk,ck->ct", centre, d) - np.einsum("ck,ck->c", p, d)[:, None]
    t = np.clip(t / np.maximum(np.einsum("ck,ck->c", d, d), 1e-300)[:, None], 0.0, 1.0)
    way = p[:, None] + t[..., None] * d[:, None] - centre
    size = np.linalg.norm(way, axis=2) * np.linalg.norm(normal, axis=1)
    clearly_not: NDArray[np.bool_] = np.einsum("ctk,tk->ct", way, normal) <= _FACES * size
    return ~clearly_not
