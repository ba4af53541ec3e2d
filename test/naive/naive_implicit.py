"""A sub-step of `implicit` again, in float64 with a dense matrix, for tests to compare."""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from naive.naive_xpbd import excess


def edge_forces(
    x: FloatArray,
    edges: IntArray,
    rest_length: FloatArray,
    stiffness: FloatArray,
    has_roots: bool = True,
) -> FloatArray:
    """Forces of springs [N], shape [n, 3]; with the distance itself, or a quotient near it."""
    force = np.zeros_like(x)
    for (i, j), rest, k in zip(edges, rest_length, stiffness):
        apart = x[i] - x[j]
        length = float(np.linalg.norm(apart))
        pull = k * excess(length, rest, has_roots) * apart / length
        force[i] -= pull
        force[j] += pull
    return force


def hinge_forces(
    x: FloatArray, hinges: IntArray, weight: FloatArray, stiffness: FloatArray
) -> FloatArray:
    """Forces of hinges [h, 4] [N], shape [n, 3]."""
    force = np.zeros_like(x)
    for particles, w, k in zip(hinges, weight, stiffness):
        curvature = w @ x[particles]
        for p, share in zip(particles, w):
            force[p] -= k * share * curvature
    return force


def laplacian(edges: IntArray, stiffness: FloatArray, n: int) -> FloatArray:
    """sum_e k_e (e_i - e_j)(e_i - e_j)^T [N/m], shape [n, n]."""
    matrix = np.zeros((n, n))
    for (i, j), k in zip(edges, stiffness):
        matrix[i, i] += k
        matrix[j, j] += k
        matrix[i, j] -= k
        matrix[j, i] -= k
    return matrix


def contact_force(
    apart: FloatArray, normal: FloatArray, gap: float, friction: float
) -> FloatArray:
    """Force [3] of a contact over its stiffness, from the way to its anchor [3]."""
    along = np.asarray(apart, dtype=np.float64)
    along = along - float(along @ normal) * normal
    length = float(np.linalg.norm(along))
    if length > friction * gap:
        along *= friction * gap / length
    return along + gap * normal


def quasi_newton_direction(
    force: FloatArray, matrix: FloatArray, steps: list[FloatArray], changes: list[FloatArray]
) -> FloatArray:
    """Force times the inverse of the matrix after updates by the steps, the oldest first.

    Each is the update of Broyden, Fletcher, Goldfarb and Shanno for a step s that took the force y
    away: ``B + y y^T / (y s) - B s (B s)^T / (s B s)``, written out in dense matrices.
    """
    B = np.kron(np.eye(3), matrix)
    for s, y in zip(steps, changes):
        Bs = B @ s.ravel()
        B = B + np.outer(y, y) / (y.ravel() @ s.ravel()) - np.outer(Bs, Bs) / (s.ravel() @ Bs)
    return np.linalg.solve(B, force.ravel()).reshape(force.shape)
