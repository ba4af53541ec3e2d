"""Which settings no other one beats in both cost and error."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike


def front(cost: ArrayLike, error: ArrayLike) -> Sequence[int]:
    """Indices of the points that no other one dominates, by rising cost.

    A point dominates another where it is no worse in both and better in one. Of equal points the
    first one is taken. Points that are not finite are on no front.

    Args:
        cost: Of each point, shape [n].
        error: Of each point, shape [n].
    """
    c, e = np.asarray(cost, np.float64), np.asarray(error, np.float64)
    found: list[int] = []
    best = np.inf
    for k in np.lexsort((e, c)).tolist():
        if np.isfinite(c[k]) and e[k] < best:
            best = float(e[k])
            found.append(k)
    return found
