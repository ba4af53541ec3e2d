"""Order of Gauss-Seidel passes: from the far ends of the cloth towards what holds it."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from garment_sim_ros.arrays import IntArray
from garment_sim_ros.geometry.colouring import colour_springs
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.jit import exact_kernel


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
    """Order in which edges, or triangles, are solved.

    Ring by ring towards the pins or, without pins, away from the boundary. Each edge then meets
    the correction of all that hangs on it: a pass leaves less stretch than in an order without
    direction. Within a ring neighbours do not follow each other (they are sorted by colour), so
    that the processor need not wait for one to finish.

    Args:
        edges: Particles of what is solved, shape [m, 2] or [m, 3].
        triangles: Particles of the triangles, shape [t, 3].
        free_count: Number of free particles, the first ones; the others are pinned.

    Returns:
        Indices into `edges`, shape [m].
    """
    colour = colour_springs(edges)
    level = inward_levels(triangles, free_count)[edges].sum(axis=1)
    return np.lexsort((edges.min(axis=1), colour, level)).astype(np.int32)


def in_fours(constraints: IntArray) -> tuple[IntArray, int]:
    """An order of constraints in which four after each other have no particle in common.

    A pass has the same result as in the order given: of two constraints with a common particle
    the one that was first still is.

    Args:
        constraints: Their particles, in the order of a pass, shape [c, k].

    Returns:
        Indices into `constraints`, shape [c]; and how many of them, the first ones, are in such
        fours. The others have to be solved one by one.
    """
    if not len(constraints):
        return np.zeros(0, np.int32), 0
    constraints = np.ascontiguousarray(constraints, np.int32)
    turn, four = np.zeros((2, len(constraints)), np.int32)
    _take_turns(constraints, np.zeros(int(constraints.max()) + 1, np.int32), turn)
    by_turn = np.argsort(turn, kind="stable").astype(np.int32)
    room = np.full(len(constraints) + 1, 4, np.int32)
    _fill(constraints, by_turn, np.zeros(int(constraints.max()) + 1, np.int32), room, four)
    full = int(np.argmax(room > 0))
    return by_turn[np.argsort(four[by_turn], kind="stable")], 4 * full


@exact_kernel()
def _take_turns(constraints, free, turn):
    """The turn of each constraint if all wait only for those before them that they meet."""
    for c in range(constraints.shape[0]):
        for k in range(constraints.shape[1]):
            turn[c] = max(turn[c], free[constraints[c, k]])
        for k in range(constraints.shape[1]):
            free[constraints[c, k]] = turn[c] + 1


@exact_kernel()
def _fill(constraints, order, free, room, four):
    """Puts constraints into the first four that has room and comes after all that they wait for.

    Args:
        constraints: Their particles, shape [c, k].
        order: In which they are put.
        free: Scratch, zeros: the first four that is free of each particle.
        room: How many fit into each four, changed in place.
        four: Output, the four of each, shape [c].
    """
    open_ = 0
    for n in range(order.size):
        c = order[n]
        f = open_
        for k in range(constraints.shape[1]):
            f = max(f, free[constraints[c, k]])
        while room[f] == 0:
            f += 1
        room[f] -= 1
        four[c] = f
        for k in range(constraints.shape[1]):
            free[constraints[c, k]] = f + 1
        while room[open_] == 0:
            open_ += 1
