"""Choices among equals that do not hang on the last digit.

On a body that is its own mirror image much is as good on the left as on the right. Which of two
such numbers is the smaller one is then a matter of rounding, and so of the processor.
"""

import numpy as np
from numpy.typing import ArrayLike

from garment_sim_ros.arrays import FloatArray

_DIGITS = 9
"""Decimals to which lengths are the same on every processor: a nanometre."""


def first_least(values: ArrayLike, rounding: float) -> int:
    """Which value is the least; of those that are as small but for `rounding` the first."""
    found = np.asarray(values, np.float64)
    return int(np.flatnonzero(found <= found.min() + rounding)[0])


def facing(axes: FloatArray) -> FloatArray:
    """Axes, shape [k, n], each turned round where its largest component is below zero.

    Programs that find eigenvectors return them either way round.
    """
    size = np.abs(axes)
    largest = [first_least(-column, 1e-6 * column.max()) for column in size.T]
    return axes * np.where(axes[largest, np.arange(axes.shape[1])] < 0.0, -1.0, 1.0)


def to_nanometres(x: FloatArray) -> FloatArray:
    """Positions, or others of that size, without the digits that rounding has touched.

    What is chosen among many is then chosen from the same numbers everywhere.
    """
    return np.round(x, _DIGITS)
