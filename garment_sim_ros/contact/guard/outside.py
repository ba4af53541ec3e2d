"""Which cores belong outside of which triangles of a garment: a hand, a shirt's arm at its side.

What passes a garment by is outside of all of it. What it is worn on elsewhere is outside of the
triangles that face it at rest, as the arm is of a shirt's side, and of those that it is far away
from. What is beside or behind a triangle at rest is not: the chest is not outside of the sleeve
that begins on it, nor of the shirt's side below. It may be on either side of such a triangle: an
arm that hangs beside the chest at rest comes before it, and stays there.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.sides import LET_GO, PASSING, UNDER

_FACES = 0.6
"""Least cosine of the angle between a triangle's normal and the way to a core that it faces."""
_NEAR = 0.5
"""A core that is farther away than this share of the longest shape is not beside a triangle."""


def outside(
    side: NDArray[np.int8], ends: FloatArray, triangles: IntArray, x: FloatArray, longest: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether each core belongs outside of each triangle, or may be on either side, each [c, t].

    Args:
        side: The side on which its shape is of each free particle, see `Sides`, shape [c, n].
        ends: Both ends of each core at rest [m], NaN where that is not known, shape [c, 2, 3].
        triangles: As particles, counter-clockwise from outside, shape [t, 3].
        x: All particles at rest [m], shape [n + p, 3].
        longest: Length of the body's longest shape [m].
    """
    half = 0.5 * np.count_nonzero(triangles < side.shape[1], axis=1)

    def of_most_corners(is_so: NDArray[np.bool_]) -> NDArray[np.bool_]:
        padded = np.pad(is_so, ((0, 0), (0, 1)))  # pinned corners have no say
        count: IntArray = padded[:, np.minimum(triangles, side.shape[1])].sum(axis=2)
        return count > half

    passes = of_most_corners((side == PASSING) | (side == LET_GO))
    beside = _beside(ends, x[triangles], _NEAR * longest) & ~passes
    over = of_most_corners(side != UNDER)
    return over & ~beside, over & beside


def _beside(ends: FloatArray, corners: FloatArray, near: float) -> NDArray[np.bool_]:
    """Whether each core is near each triangle that does not face it; not where it is unknown."""
    centre = corners.mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    p, d = ends[:, 0], ends[:, 1] - ends[:, 0]
    t = np.einsum("tk,ck->ct", centre, d) - np.einsum("ck,ck->c", p, d)[:, None]
    t = np.clip(t / np.maximum(np.einsum("ck,ck->c", d, d), 1e-300)[:, None], 0.0, 1.0)
    way = p[:, None] + t[..., None] * d[:, None] - centre
    length = np.linalg.norm(way, axis=2)
    towards = np.einsum("ctk,tk->ct", way, normal) / np.maximum(
        np.linalg.norm(normal, axis=1), 1e-300
    )
    return (length < near) & (towards <= _FACES * length)
