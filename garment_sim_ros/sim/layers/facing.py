"""Which way a garment faces, on the whole: its normals without its wrinkles."""

import numpy as np

from garment_sim_ros.geometry.vectors import cross, length, less, row
from garment_sim_ros.jit import lean_kernel

ROUNDS = 4
"""Times that normals take those of their neighbours: over so many edges wrinkles even out."""
_TINY = np.float32(1e-20)


@lean_kernel(inner=True)
def _add(to, p, vector):
    """Adds a vector to row p."""
    to[p, 0] += vector[0]
    to[p, 1] += vector[1]
    to[p, 2] += vector[2]


@lean_kernel(inner=True)
def normal_of(x, triangle):
    """Normal of a triangle, twice as long as its area."""
    a = row(x, triangle[0])
    return cross(less(row(x, triangle[1]), a), less(row(x, triangle[2]), a))


@lean_kernel()
def find_facing(x, triangles, edges, facing, scratch):
    """Normals at particles, each the sum of its own and of those around it, several times over.

    Args:
        x: Positions [m], shape [n, 3].
        triangles: As particles, counter-clockwise from outside, shape [t, 3].
        edges: Pairs of particles, shape [e, 2].
        facing: Output, of length 1, or less where a particle has no area around it, shape [n, 3].
        scratch: Of the same shape.
    """
    for p in range(x.shape[0]):
        facing[p, 0] = facing[p, 1] = facing[p, 2] = np.float32(0.0)
    for t in range(triangles.shape[0]):
        normal = normal_of(x, triangles[t])
        for k in range(3):
            _add(facing, triangles[t, k], normal)
    for _ in range(ROUNDS):
        for p in range(x.shape[0]):
            scratch[p, 0], scratch[p, 1], scratch[p, 2] = row(facing, p)
        for e in range(edges.shape[0]):
            i, j = edges[e, 0], edges[e, 1]
            _add(facing, i, row(scratch, j))
            _add(facing, j, row(scratch, i))
    for p in range(x.shape[0]):
        size = max(length(row(facing, p)), _TINY)
        for k in range(3):
            facing[p, k] /= size
