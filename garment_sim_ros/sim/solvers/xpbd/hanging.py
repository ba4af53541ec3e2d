"""How much too long edges stay by which heavy particles hang from light ones."""

import numpy as np
from scipy.sparse import coo_matrix, identity
from scipy.sparse.linalg import spsolve

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.sim.model import ClothModel

_OF_EDGES = 95.0
"""Percentile over edges: a few small triangles that much hangs by make no garment hang long."""
_LIGHT = 0.5
"""Of the mean mass: heavier particles are those of even cloth."""
_SHORT = 0.05
"""Of the mean edge: shorter ones count as that long, as a stretch that is not seen is none."""
_LEAK = 1e-9
"""Of the mean edge: what each particle conducts by itself."""


def lag(model: ClothModel) -> float:
    """Stretch that uneven masses add with one pass a sub-step, over ``g h^2`` [1/m].

    A mass f that hangs by an edge falls by ``g h^2`` more in every sub-step of h. The pass gives
    that way back where the edge is too long by ``f (w0 + w1) g h^2`` with its ends' inverse
    masses: much where heavy particles hang by light ones. What even cloth has of that is left
    out. What hangs by which edge is the flow of the masses to the pins over a network of the
    edges, of one width, so each conducts by the inverse of its length.

    Args:
        model: The garment.

    Returns:
        The 95th percentile over edges; 0 for a garment without pins.
    """
    springs, free = model.springs, model.free_count
    ends = springs.particles.reshape(-1, 2)[springs.bending :].astype(np.int32)
    length = springs.rest_length[springs.bending :].astype(float)
    if free == len(model) or not len(ends):
        return 0.0
    mass = model.mass.astype(float)
    even = 2.0 / (_LIGHT * mass.mean())
    more = np.maximum(model.inverse_mass.astype(float)[ends].sum(axis=1) - even, 0.0)
    stretch = np.abs(_flows(ends, length, mass, free)) * more
    return float(np.percentile(stretch / np.maximum(length, _SHORT * length.mean()), _OF_EDGES))


def _flows(ends: IntArray, length: FloatArray, mass: FloatArray, free: int) -> FloatArray:
    """Mass that hangs by each edge's second end [kg], where particles from `free` on hold."""
    i, j = ends.T
    conducts = 1.0 / np.maximum(length, 1e-9)
    n = len(mass)
    row, column = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
    value = np.concatenate([conducts, conducts, -conducts, -conducts])
    network = coo_matrix((value, (row, column)), shape=(n, n)).tocsc()[:free, :free]
    # Parts without a pin hang by nothing: what is in them leaks out where it is.
    network += _LEAK * conducts.mean() * identity(free, format="csc")
    potential = np.zeros(n)
    potential[:free] = spsolve(network, mass[:free])
    return np.asarray(conducts * (potential[j] - potential[i]))
