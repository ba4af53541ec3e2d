"""Sweeps over a garment that has several parts, which threads work on at once.

What is within a part shares no free particle with what is within another, see
`geometry.locality.part_starts`; what is between parts follows, on one thread. It is the order that
one thread keeps, and so the same bits.
"""

import numba

from garment_sim_ros.jit import parallel_kernel
from garment_sim_ros.sim.solvers.relaxation.springs import correct_springs
from garment_sim_ros.sim.solvers.xpbd.edges import solve_edges, solve_edges_apart
from garment_sim_ros.sim.solvers.xpbd.hinges import bend


@parallel_kernel()
def correct_springs_in_parts(x, particles, rest_length, share, part_start, sweeps):
    """`correct_springs` on several threads.

    Args:
        x: Positions, changed in place, flat [m], shape [3 n].
        particles: Ends of the springs, flat, unsigned, shape [2 m].
        rest_length: Rest lengths [m], shape [m].
        share: w0 / (w0 + w1), shape [m].
        part_start: Of each kind of springs, those within each part and then those between parts,
            shape [kinds, parts + 2].
        sweeps: Number of passes over all springs.
    """
    parts = part_start.shape[1] - 2
    for _ in range(sweeps):
        for kind in range(part_start.shape[0]):
            start = part_start[kind]
            for p in numba.prange(parts):
                a, b = start[p], start[p + 1]
                correct_springs(x, particles[2 * a : 2 * b], rest_length[a:b], share[a:b], 1)
            a, b = start[parts], start[parts + 1]
            correct_springs(x, particles[2 * a : 2 * b], rest_length[a:b], share[a:b], 1)


@parallel_kernel()
def solve_edges_in_parts(x, particles, edges, part_start):
    """`edges.solve_edges` on several threads; `part_start` has shape [parts + 2]."""
    parts = part_start.size - 2
    for p in numba.prange(parts):
        a, b = part_start[p], part_start[p + 1]
        solve_edges(x, particles[2 * a : 2 * b], edges[a:b])
    a, b = part_start[parts], part_start[parts + 1]
    solve_edges(x, particles[2 * a : 2 * b], edges[a:b])


@parallel_kernel()
def solve_edges_apart_in_parts(x, moved, particles, edges, pull, alone, part_start):
    """`edges.solve_edges_apart` on several threads; `part_start` has shape [parts + 2]."""
    parts = part_start.size - 2
    for p in numba.prange(parts):
        a, b = part_start[p], part_start[p + 1]
        solve_edges_apart(x, moved, particles[2 * a : 2 * b], edges[a:b], pull[a:b], alone)
    a, b = part_start[parts], part_start[parts + 1]
    solve_edges_apart(x, moved, particles[2 * a : 2 * b], edges[a:b], pull[a:b], alone)


@parallel_kernel()
def bend_in_parts(x, v, particles, hinges, dt, part_start):
    """`bending.bend` on several threads; `part_start` has shape [parts + 2]."""
    parts = part_start.size - 2
    for p in numba.prange(parts):
        a, b = part_start[p], part_start[p + 1]
        bend(x, v, particles[a:b], hinges[a:b], dt)
    a, b = part_start[parts], part_start[parts + 1]
    bend(x, v, particles[a:b], hinges[a:b], dt)
