"""How far a garment's edges are stretched: one number per share of edges, without sorting."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.state import State

_BINS = 1000
_BIN = 1e-3  # of strain


class Strain(NamedTuple):
    """Strain of the stretch springs, positive where they are longer than at rest.

    Attributes:
        p95: 95 % of the edges are strained less, in steps of 0.001.
        largest: The largest.
    """

    p95: float
    largest: float


class StrainMeter:
    """Reads the strain of one garment; allocates once.

    Args:
        model: The garment.
    """

    def __init__(self, model: ClothModel) -> None:
        first = model.springs.bending
        self._particles = model.springs.particles[2 * first :]
        self._rest_length = model.springs.rest_length[first:]
        self._counts = np.zeros(_BINS + 1, np.int64)

    def read(self, state: State) -> Strain:
        """The strain of a state of that garment."""
        p95, largest = _strain(state.x, self._particles, self._rest_length, self._counts)
        return Strain(float(p95), float(largest))


@kernel()
def _strain(x: NDArray[np.float32], particles, rest_length, counts):
    """95th percentile, by counting, and maximum of edge strain."""
    counts[:] = 0
    largest = -1.0
    for e in range(rest_length.size):
        i = particles[2 * e]
        j = particles[2 * e + 1]
        dx = x[i, 0] - x[j, 0]
        dy = x[i, 1] - x[j, 1]
        dz = x[i, 2] - x[j, 2]
        strain = np.sqrt(dx * dx + dy * dy + dz * dz) / rest_length[e] - np.float32(1.0)
        largest = max(largest, strain)
        counts[min(max(int(strain / _BIN) + 1, 0), _BINS)] += 1
    left = 0.05 * rest_length.size
    for k in range(_BINS, 0, -1):
        left -= counts[k]
        if left < 0.0:
            return (k if k < _BINS else largest / _BIN) * _BIN, largest
    return 0.0, largest
