"""Parts of garments that jump: how far points move, in a frame, otherwise than the skin near them.

A hem between two legs may go with either, or with anything between. A point's motion is therefore
compared with all motions of the skin within a reach of it, and with that of the nearest skin: what
is left when it is led to the nearest of what lies between these (along x, y and z) is its jump.
Cloth that hangs or flies free has no skin under it: points farther than 10 cm from the skin,
before or after, are left out.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import FloatArray

JUMP = 0.05
"""A point that moves farther than this otherwise than the skin near it has jumped [m]."""
_NEAR = 0.3
"""How far from a point skin tells how it may move [m]."""
UNDER = 0.1
"""Farthest that skin may be to be under a point, flying cloth included [m]."""
LIES = 0.02
"""Farthest that skin may be from a point that lies on it [m]."""
_SPACING = 0.04
"""Distance between the vertices of the skin that are looked at [m]."""


class JumpMeter:
    """Largest motion against the skin from frame to frame.

    Args:
        skin_vertices: Skin in any pose [m], shape [v, 3].
        under: Points farther from the skin than this do not count [m].

    Attributes:
        largest: Farthest that a point jumped in a frame [m].
        frames: Frames in which one jumped farther than `JUMP`.
    """

    def __init__(self, skin_vertices: FloatArray, under: float = UNDER) -> None:
        self._reach = under
        cell = np.floor(np.asarray(skin_vertices) / _SPACING).astype(np.int64)
        self._some = np.unique(cell, axis=0, return_index=True)[1]
        self._before: tuple[FloatArray, dict[str, FloatArray]] | None = None
        self.largest = 0.0
        self.frames = 0

    def forget(self) -> None:
        """The next frame does not follow on the last."""
        self._before = None

    def add(self, skin: FloatArray, garments: Mapping[str, NDArray[np.floating]]) -> float:
        """Look at the next frame.

        Args:
            skin: Posed skin vertices [m], shape [v, 3].
            garments: Vertices of each garment at the same instant [m].

        Returns:
            Farthest that a point jumped [m].
        """
        now = skin[self._some], {n: np.array(x, np.float64) for n, x in garments.items()}
        before, self._before = self._before, now
        if before is None:
            return 0.0
        of_skin = now[0] - before[0]
        trees = cKDTree(before[0]), cKDTree(now[0])
        far = max(
            (_farthest(trees, of_skin, before[1][n], now[1][n], self._reach) for n in garments),
            default=0.0,
        )
        self.largest = max(self.largest, far)
        self.frames += far > JUMP
        return far


def _farthest(
    trees: tuple[cKDTree, cKDTree],
    of_skin: FloatArray,
    x: FloatArray,
    after: FloatArray,
    reach: float,
) -> float:
    """How far any point of a garment jumped [m]."""
    whole = np.isfinite(x).all(axis=1) & np.isfinite(after).all(axis=1)
    x, after = x[whole], after[whole]
    if not len(x):
        return 0.0
    tree = trees[0]
    away, under = tree.query(x)
    close = (away < reach) & (trees[1].query(after)[0] < reach)
    x, moved, nearest = x[close], (after - x)[close], of_skin[under[close]]
    # Only where the nearest skin does not explain it are the others asked.
    left = np.linalg.norm(moved - nearest, axis=1)
    some = np.flatnonzero(left > JUMP)
    far = float(left[left <= JUMP].max(initial=0.0))
    for i, near in zip(some, tree.query_ball_point(x[some], _NEAR), strict=True):
        motions = np.concatenate([nearest[i : i + 1], of_skin[near]])
        led = np.clip(moved[i], motions.min(axis=0), motions.max(axis=0))
        far = max(far, float(np.linalg.norm(moved[i] - led)))
    return far
