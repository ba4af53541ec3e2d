"""Vectors in kernels: three numbers as a tuple, which needs no memory."""

import numpy as np

from garment_sim_ros.jit import lean_kernel


@lean_kernel(inner=True)
def row(array, i):
    """Row i of an array of vectors, shape [n, 3]."""
    return array[i, 0], array[i, 1], array[i, 2]


@lean_kernel(inner=True)
def plus(a, b):
    """The vector a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@lean_kernel(inner=True)
def less(a, b):
    """The vector a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@lean_kernel(inner=True)
def along(a, direction, way):
    """The place that is so far from a in a direction."""
    return a[0] + direction[0] * way, a[1] + direction[1] * way, a[2] + direction[2] * way


@lean_kernel(inner=True)
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@lean_kernel(inner=True)
def cross(a, b):
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@lean_kernel(inner=True)
def length(a):
    """Length of a vector."""
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
