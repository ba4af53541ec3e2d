"""Order of Gauss-Seidel passes: from the far ends of the cloth towards what holds it."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from garment_sim_ros.arrays import IntArray
from garment_sim_ros.geometry.colouring import colour_springs
from garment_sim_ros.geometry.topology import edge_table


def rings(edges: IntArray, seeds: IntArray, n: int) -> IntArray:
    """Edges between each particle and the nearest seed, 0 where there is no way, shape [n]."""
    if not len(seeds):
        return np.zeros(n, np.int32)
    ones = np.ones(len(edges))
    graph = coo_matrix((ones, (edges[:, 0], edges[:, 1])), shape=(n, n)).tocsr()
    hops = dijkstra(graph, directed=False, indices=seeds, unweighted=True, min_only=True)
    return np.where(np.isfinite(hops), hops, 0.0).astype(np.int32)


def inward_levels(triangles: IntArray, free_count: int) -> IntArray:
    """How far in each particle is: minus the edges to the nearest pin, else those to the border.

    Args:
        triangles: Particles of the triangles, shape [t, 3].
        free_count: Number of free particles, the first ones; the others are pinned.

    Returns:
        A level for each particle, shape [n].
    """
    n = int(triangles.max()) + 1
    edges, _, count = edge_table(triangles)
    if free_count < n:
        return -rings(edges, np.arange(free_count, n, dtype=np.int32), n)
    return rings(edges, np.unique(edges[count == 1]), n)


def inward_order(edges: IntArray, triangles: IntArray, free_count: int) -> IntArray:
    """Order in which edges are solved.

    Ring by ring towards the pins or, without pins, away from the boundary. Each edge then meets
    the correction of all that hangs on it: a pass leaves less stretch than in an order without
    direction. Within a ring neighbours do not follow each other (they are sorted by colour), so
    that the processor need not wait for one to finish.

    Args:
        edges: Particles of the edges, shape [m, 2].
        triangles: Particles of the triangles, shape [t, 3].
        free_count: Number of free particles, the first ones; the others are pinned.

    Returns:
        Indices into `edges`, shape [m].
    """
    colour = colour_springs(edges)
    level = inward_levels(triangles, free_count)[edges].sum(axis=1)
    return np.lexsort((edges.min(axis=1), colour, level)).astype(np.int32)
