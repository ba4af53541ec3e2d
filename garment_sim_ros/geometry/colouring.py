"""Colouring of constraints: no two of one colour share a particle.

Those of one colour can be corrected in any order, or at once, with the same result.
"""

import numpy as np

from garment_sim_ros.arrays import IntArray
from garment_sim_ros.jit import exact_kernel


@exact_kernel()
def _colour_greedily(pairs, start, incident, palette, colour, population):
    """Fills `colour` [m] and `population`; returns the number of colours used."""
    colours = palette
    taken = np.full(population.size, -1, dtype=np.int32)
    colour[:] = -1
    for e in range(pairs.shape[0]):
        for end in range(pairs.shape[1]):
            particle = pairs[e, end]
            for s in range(start[particle], start[particle + 1]):
                c = colour[incident[s]]
                if c >= 0:
                    taken[c] = e
        best = -1
        for c in range(colours):
            if taken[c] != e and (best < 0 or population[c] < population[best]):
                best = c
        if best < 0:
            best = colours
            colours += 1
        colour[e] = best
        population[best] += 1
    return colours


def colour_springs(springs: IntArray) -> IntArray:
    """Greedy colouring, each spring taking the least used colour that is free at all its ends.

    The result depends only on the input order. It needs at least as many colours as the busiest
    particle has springs and less than k times that.

    Args:
        springs: Particles of each spring, or of what else acts between k different ones,
            shape [m, k].

    Returns:
        Colour of each spring, 0 to the number of colours - 1, shape [m].
    """
    pairs = np.ascontiguousarray(springs, dtype=np.int32)
    colour = np.zeros(len(pairs), np.int32)
    if not len(pairs):
        return colour
    ends = pairs.T.ravel()
    degree = np.bincount(ends)
    start = np.concatenate([[0], np.cumsum(degree)]).astype(np.int32)
    incident = (np.argsort(ends, kind="stable") % len(pairs)).astype(np.int32)
    population = np.zeros(pairs.shape[1] * degree.max(), np.int32)
    _colour_greedily(pairs, start, incident, int(degree.max()), colour, population)
    return colour


def order_by_colour(pairs: IntArray) -> tuple[IntArray, IntArray]:
    """Order in which springs are stored: by colour, then by particle for locality.

    Args:
        pairs: Particles of each spring, shape [m, 2].

    Returns:
        The order: indices into `pairs`, shape [m]; and where each colour starts in it, shape
        [colours + 1].
    """
    pairs = np.asarray(pairs, dtype=np.int32).reshape(-1, 2)
    colour = colour_springs(pairs)
    order = np.lexsort((pairs.max(axis=1), pairs.min(axis=1), colour)).astype(np.int32)
    start = np.concatenate([[0], np.cumsum(np.bincount(colour))]).astype(np.int32)
    return order, start
