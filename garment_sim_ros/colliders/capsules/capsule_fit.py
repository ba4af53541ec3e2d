"""Tapered capsules (and spheres) fitted to a patch of skin by Levenberg-Marquardt.

A tapered capsule is the union of balls with centre ``p0 + t (p1 - p0)`` and radius
``r0 + t (r1 - r0)``, t in [0, 1]; its distance is the minimum over t of the balls' distances. By
the envelope theorem the derivatives with respect to (p0, p1, r0, r1) are those at the minimising
t: ``-(1 - t) n, -t n, -(1 - t), -t`` with n the unit vector from that centre to the point.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.jit import kernel

_OUTSIDE = 4.0
"""Weight of skin outside the shape against skin inside it: clothes must not touch the body."""
_TETHER = 1e-5
"""Weight of a capsule's own length, so that nothing slides out of the patch's open ends."""
_MAX_TAPER = 0.9
"""Largest |r1 - r0| over length: at 1 one ball swallows the other."""


@kernel(forceinline=True)
def capsule_distance(capsule, x, y, z):
    """Distance to a tapered capsule (p0, p1, r0, r1), negative inside, and the minimising t."""
    dx = capsule[3] - capsule[0]
    dy = capsule[4] - capsule[1]
    dz = capsule[5] - capsule[2]
    rx, ry, rz = x - capsule[0], y - capsule[1], z - capsule[2]
    taper = capsule[7] - capsule[6]
    length2 = dx * dx + dy * dy + dz * dz
    t = 0.0
    if length2 > taper * taper:
        length = np.sqrt(length2)
        along = (rx * dx + ry * dy + rz * dz) / length
        across = np.sqrt(max(rx * rx + ry * ry + rz * rz - along * along, 0.0))
        slope = taper / length
        t = (along + slope * across / np.sqrt(1.0 - slope * slope)) / length
        t = min(max(t, 0.0), 1.0)
    elif taper > 0.0:
        t = 1.0
    cx, cy, cz = rx - t * dx, ry - t * dy, rz - t * dz
    return np.sqrt(cx * cx + cy * cy + cz * cz) - capsule[6] - t * taper, t


@kernel()
def union_distance(capsules, points, distance, nearest):
    """Distance to the union of capsules [k, 8] and the capsule that gives it, per point."""
    for i in range(points.shape[0]):
        distance[i] = np.inf
        for k in range(capsules.shape[0]):
            d, _ = capsule_distance(capsules[k], points[i, 0], points[i, 1], points[i, 2])
            if d < distance[i]:
                distance[i] = d
                nearest[i] = k


@kernel()
def _normal_equations(capsules, points, weight, foreign, matrix, gradient):
    """Gauss-Newton matrix [k, 8, 8] and gradient [k, 8] of the weighted squared distances.

    A point acts on the capsule nearest to it only. A `foreign` point, on other skin or in the air,
    acts where it is inside: a capsule must not stick out of the body.
    """
    matrix[:] = 0.0
    gradient[:] = 0.0
    cost = 0.0
    row = np.empty(8)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        best = np.inf
        best_t = 0.0
        best_k = 0
        for k in range(capsules.shape[0]):
            d, t = capsule_distance(capsules[k], x, y, z)
            if d < best:
                best, best_t, best_k = d, t, k
        if foreign[i] and best >= 0.0:
            continue
        w = weight[i] * (_OUTSIDE if best > 0.0 else 1.0)
        cost += w * best * best
        c = capsules[best_k]
        nx = x - c[0] - best_t * (c[3] - c[0])
        ny = y - c[1] - best_t * (c[4] - c[1])
        nz = z - c[2] - best_t * (c[5] - c[2])
        scale = 1.0 / max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
        row[0] = -(1.0 - best_t) * nx * scale
        row[1] = -(1.0 - best_t) * ny * scale
        row[2] = -(1.0 - best_t) * nz * scale
        row[3] = -best_t * nx * scale
        row[4] = -best_t * ny * scale
        row[5] = -best_t * nz * scale
        row[6] = -(1.0 - best_t)
        row[7] = -best_t
        for a in range(8):
            gradient[best_k, a] += w * row[a] * best
            for b in range(8):
                matrix[best_k, a, b] += w * row[a] * row[b]
    for k in range(capsules.shape[0]):
        for a in range(3):
            d = capsules[k, 3 + a] - capsules[k, a]
            cost += _TETHER * d * d
            gradient[k, a] -= _TETHER * d
            gradient[k, 3 + a] += _TETHER * d
            matrix[k, a, a] += _TETHER
            matrix[k, 3 + a, 3 + a] += _TETHER
            matrix[k, a, 3 + a] -= _TETHER
            matrix[k, 3 + a, a] -= _TETHER
    return cost


_SPHERE_OF_CAPSULE = np.vstack([np.eye(4)[:3], np.eye(4)[:3], np.eye(4)[3], np.eye(4)[3]])
"""Derivative of a capsule's 8 numbers with respect to a sphere's (centre, radius)."""


def refine(
    capsules: FloatArray,
    points: FloatArray,
    weight: FloatArray,
    foreign: NDArray[np.bool_],
    *,
    spheres: bool = False,
    iterations: int = 30,
) -> tuple[FloatArray, float]:
    """Capsules moved to a local minimum of the weighted squared distances.

    Args:
        capsules: Start, rows (p0, p1, r0, r1), shape [k, 8].
        points: Skin and foreign points [m], shape [n, 3].
        weight: Share of the patch's area that each point stands for, shape [n].
        foreign: Points of other patches and in the air around, shape [n].
        spheres: Keep p0 = p1 and r0 = r1.
        iterations: Largest number of steps tried.

    Returns:
        The capsules and their cost [m^2].
    """
    count = len(capsules)
    own = points[~foreign]
    low, high = own.min(axis=0), own.max(axis=0)
    smallest = 0.1 * capsules[:, 6:].mean()
    largest = 0.5 * float((high - low).max()) + smallest
    matrix = np.empty((count, 8, 8))
    gradient = np.empty((count, 8))
    damping = 1e-2
    best = capsules.copy()
    cost = _normal_equations(best, points, weight, foreign, matrix, gradient)
    fold = _SPHERE_OF_CAPSULE if spheres else np.eye(8)
    for _ in range(iterations):
        reduced = fold.T @ matrix @ fold
        diagonal = np.einsum("kaa->ka", reduced)
        diagonal += damping * diagonal + 1e-9
        step = np.linalg.solve(reduced, (gradient @ fold)[..., None])[..., 0] @ fold.T
        trial = best - step
        trial[:, :3] = np.clip(trial[:, :3], low, high)
        trial[:, 3:6] = np.clip(trial[:, 3:6], low, high)
        trial[:, 6:] = np.clip(trial[:, 6:], smallest, largest)
        length = np.linalg.norm(trial[:, 3:6] - trial[:, :3], axis=1)
        excess = np.abs(trial[:, 7] - trial[:, 6]) > _MAX_TAPER * length
        middle = trial[:, 6:].mean(axis=1, keepdims=True)
        half = np.sign(trial[:, 7] - trial[:, 6]) * 0.5 * _MAX_TAPER * length
        limited = middle + half[:, None] * np.array([-1.0, 1.0])
        trial[:, 6:] = np.where(excess[:, None], limited, trial[:, 6:])
        trial_cost = _normal_equations(trial, points, weight, foreign, matrix, gradient)
        if trial_cost < cost:
            converged = trial_cost > cost * (1.0 - 1e-3)
            best, cost = trial, trial_cost
            damping = max(damping * 0.3, 1e-6)
            if converged:
                break
        else:
            damping *= 5.0
            if damping > 1e4:
                break
            _normal_equations(best, points, weight, foreign, matrix, gradient)
    return best, cost


def slabs(
    points: FloatArray, weight: FloatArray, split: int, along: int, count: int
) -> FloatArray:
    """Start values: the points cut into `count` slabs, one capsule per slab.

    Args:
        points: Points in the patch's principal axes, longest first [m], shape [n, 3].
        weight: Their area shares, shape [n].
        split: Principal axis that is cut.
        along: Principal axis that the capsules lie along.
        count: Number of slabs of equal width.
    """
    low, high = np.quantile(points[:, split], [0.02, 0.98])
    edges = np.linspace(low, high, count + 1)[1:-1]
    slab = np.searchsorted(edges, points[:, split])
    result = np.empty((count, 8))
    for k in range(count):
        inside = slab == k
        own = points[inside] if inside.sum() >= 4 else points
        centre = 0.5 * (own.min(axis=0) + own.max(axis=0))
        half = 0.5 * np.ptp(own, axis=0)
        radius = max(np.delete(half, along).min(), 0.25 * half.max(), 1e-6)
        reach = max(half[along] - radius, 0.05 * radius)
        result[k, :3] = result[k, 3:6] = centre
        result[k, along] -= reach
        result[k, 3 + along] += reach
        result[k, 6:] = radius
    return result
