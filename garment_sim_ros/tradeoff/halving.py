"""Successive halving: all settings on a little of the motion, the better half on more of it.

Karnin, Koren & Somekh 2013, "Almost optimal exploration in multi-armed bandits". Better is nearer
to the front of speed and accuracy; what fails is farther than all that does not.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from garment_sim_ros.tradeoff.front import front

SHARES = (4, 2)
"""Of each round: one over the share of a motion's segments that is run."""


def behind(cost: ArrayLike, error: ArrayLike) -> NDArray[np.float64]:
    """How many times both must shrink for a point to be on the front; 1 for those on it.

    Args:
        cost: Of each point, above 0, shape [n].
        error: Of each point, shape [n].

    Returns:
        ``max_j min(c / c_j, e / e_j)`` over points j of the front, shape [n]; infinite for points
        that are not finite.
    """
    c, e = np.asarray(cost, np.float64), np.asarray(error, np.float64)
    on = list(front(c, e))
    least = np.finfo(np.float64).tiny
    ratios = [np.minimum(c / max(c[j], least), e / max(e[j], least)) for j in on]
    found = np.max(ratios, axis=0) if on else np.full(len(c), np.inf)
    found[on] = 1.0
    return np.where(np.isfinite(c) & np.isfinite(e), np.maximum(found, 1.0), np.inf)


def better_half(rows: Sequence[dict[str, Any]], cost: str, error: str) -> list[int]:
    """Indices of the rows to go on with, in order: half of them, and all on the front.

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
    most = max(-(-len(rows) // 2), int((far == 1.0).sum()))
    return sorted(k for k in ranked[:most] if np.isfinite(far[k]))
