"""Edges do not grow beyond a strain: cloth that is pulled harder moves.

A limb that takes cloth along, or presses it against another one, stretches single edges to many
times their length. After each search for contacts, edges that are longer than the limit, and
longer than at the search before, are drawn back to the larger of the two, along surfaces that
their ends touch and never into them (after Provot 1995, "Deformation constraints in a mass-spring
model"). Drawn back to the limit itself, cloth that is held longer would never rest. Velocities
stay as they are.
"""

import numpy as np

from garment_sim_ros.geometry.vectors import along, dot, less, row
from garment_sim_ros.jit import kernel, lean_kernel

_PASSES = 10


@lean_kernel(inner=True)
def _draw(x, planes, p, way):
    """Moves particle p by `way`, but not into the surface that it touches."""
    if p < planes.shape.size and planes.shape[p] >= 0:
        n = row(planes.normal, p)
        into = dot(way, n)
        if into < np.float32(0.0):
            way = along(way, n, -into)
    for axis in range(3):
        x[p, axis] += way[axis]


@kernel(forceinline=True)
def limit_strain(x, x_before, particles, edges, planes, limit):
    """Draws the ends of edges together that are too long and have grown.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        x_before: Positions at the last search [m], shape [n, 3].
        particles: Ends, flat, shape [2 m].
        edges: From `prepare_edges`, shape [m, 4].
        planes: `Planes`; of them shapes and normals that the search found.
        limit: Strain that edges do not grow beyond.
    """
    most = np.float32(1.0) + limit
    for _ in range(_PASSES):
        found = False
        for e in range(edges.shape[0]):
            i, j = np.int64(particles[2 * e]), np.int64(particles[2 * e + 1])
            d = less(row(x, i), row(x, j))
            squared = dot(d, d)
            if not squared > most * most * edges[e, 0]:
                continue
            both = edges[e, 1] + edges[e, 2]
            before = less(row(x_before, i), row(x_before, j))
            longest = max(most * most * edges[e, 0], dot(before, before))
            if not (both > np.float32(0.0) and squared > longest):
                continue
            found = True
            share = (np.float32(1.0) - np.sqrt(longest / squared)) / both
            a, b = -share * edges[e, 1], share * edges[e, 2]
            _draw(x, planes, i, (a * d[0], a * d[1], a * d[2]))
            _draw(x, planes, j, (b * d[0], b * d[1], b * d[2]))
        if not found:
            break
