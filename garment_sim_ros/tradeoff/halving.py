"""Successive halving: all settings on a little of the motion, the better half on more of it.

Karnin, Koren & Somekh 2013, "Almost optimal exploration in multi-armed bandits". Better is nearer
to the front of speed and accuracy; what fails is farther than all that does not.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_NEAR = 1.25
"""Points no farther from the front are never dropped: a part of a motion tells no more exactly."""
SHARES = (4, 2)
"""Of each round: one over the share of a motion's segments that is run."""


def behind(cost: ArrayLike, error: ArrayLike) -> NDArray[np.float64]:
    """How far points are from the front: 1 for those on it.

    Args:
        cost: Of each point, above 0, shape [n].
        error: Of each point, above 0, shape [n].

    Returns:
        How many times the error is that of the best point as cheap, or the cost is that of the
        cheapest point as good, what is less: ``min(e / e_j, c / c_i)`` with the least ``e_j``
        where ``c_j <= c`` and the least ``c_i`` where ``e_i <= e``, shape [n]; infinite for points
        that are not finite.
    """
    c, e = np.asarray(cost, np.float64), np.asarray(error, np.float64)
    valid = np.isfinite(c) & np.isfinite(e)
    found = np.full(len(c), np.inf)
    for k in np.flatnonzero(valid):
        best = e[valid & (c <= c[k])].min()
        cheapest = c[valid & (e <= e[k])].min()
        found[k] = min(e[k] / best, c[k] / cheapest)
    return found


def better_half(rows: Sequence[dict[str, Any]], cost: str, error: str) -> list[int]:
    """Indices of the rows to go on with, in order: half of them, and all near the front.

    Args:
        rows: With ``faults``, and cost and error where there are no faults.
        cost: Name of the cost.
        error: Name of the error.
    """
    values = [
        [np.inf if row["faults"] or row.get(name) is None else row[name] for row in rows]
        for name in (cost, error)
    ]
    far = behind(*values)
    ranked = np.argsort(far, kind="stable").tolist()
    most = max(-(-len(rows) // 2), int((far <= _NEAR).sum()))
    return sorted(k for k in ranked[:most] if np.isfinite(far[k]))
