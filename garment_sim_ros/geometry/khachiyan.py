"""Weights whose moments give the minimum volume enclosing ellipsoid.

Khachiyan's algorithm with the away steps of Todd & Yildirim 2007, "On Khachiyan's algorithm for
the computation of minimum-volume enclosing ellipsoids", which converges linearly, started as in
Kumar & Yildirim 2005 and with the elimination of points that cannot touch by Harman & Pronzato
2007, "Improvements on removing nonoptimal support points in D-optimum design algorithms".

Points have three coordinates; in d < 3 dimensions the others are zero.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.jit import kernel

_MAX_STEPS = 20_000
_EVERY = 12
"""Steps between eliminations."""
X, Y, Z, WEIGHT, KAPPA = range(5)
"""Rows of the table of points."""


def room_for_points(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The table of up to n points, shape [5, n], and scratch of `find_weights`."""
    return np.zeros((5, n)), np.zeros((7, 4))


@kernel(inner=True)
def find_weights(table, count, d, tolerance, keep, scratch):
    """The weights of the ellipsoid's moments.

    Args:
        table: In the rows `X` to `Z` the points, spread about alike in every direction; the row
            `WEIGHT` is filled.
        count: Number of points.
        d: Number of dimensions, 1 to 3.
        tolerance: The volume is at most about ``(1 + tolerance)**(d / 2)`` times the smallest.
        keep: All points stay where they are, and weights that are not all zero are where to start
            from; else points that cannot have a weight are dropped, and others change places.
        scratch: Of `room_for_points`.

    Returns:
        How many points are left.
    """
    total = 0.0
    if keep:
        for p in range(count):
            total += table[WEIGHT, p]
    if total > 0.0:
        for p in range(count):
            table[WEIGHT, p] /= total
    else:
        _start(table, count, d, scratch[:3], scratch[3])
    return _optimise(table, count, d, tolerance, keep, scratch[:4], scratch[4])


@kernel(inner=True)
def _start(table, n, d, basis, direction):
    """Kumar & Yildirim's first guess: extreme points in d orthogonal directions."""
    for p in range(n):
        table[WEIGHT, p] = 0.0
    for k in range(d):
        # The coordinate axis that the directions so far leave most of.
        best = -1.0
        chosen = 0
        for axis in range(d):
            left = 1.0
            for j in range(k):
                left -= basis[j, axis] ** 2
            if left > best:
                best = left
                chosen = axis
        for i in range(3):
            direction[i] = 1.0 if i == chosen else 0.0
        for j in range(k):
            dot = basis[j, chosen]
            for i in range(3):
                direction[i] -= dot * basis[j, i]
        low = np.inf
        high = -np.inf
        at_low = 0
        at_high = 0
        for p in range(n):
            value = direction[0] * table[X, p]
            value += direction[1] * table[Y, p] + direction[2] * table[Z, p]
            if value < low:
                low = value
                at_low = p
            if value > high:
                high = value
                at_high = p
        table[WEIGHT, at_low] = 1.0
        table[WEIGHT, at_high] = 1.0
        length = 0.0
        for i in range(3):
            step = table[i, at_high] - table[i, at_low]
            for j in range(k):
                dot = 0.0
                for m in range(3):
                    dot += basis[j, m] * (table[m, at_high] - table[m, at_low])
                step -= dot * basis[j, i]
            basis[k, i] = step
            length += step * step
        length = np.sqrt(length)
        if length < 1e-12:
            length = 1e-60
            for i in range(3):
                basis[k, i] = direction[i]
                length += direction[i] ** 2
            length = np.sqrt(length)
        for i in range(3):
            basis[k, i] /= length
    total = 0.0
    for p in range(n):
        total += table[WEIGHT, p]
    for p in range(n):
        table[WEIGHT, p] /= total


@kernel(inner=True)
def _invert_moments(table, count, d, M):
    """Inverse of ``sum w q q^T``, with just enough added to have one."""
    for r in range(4):
        for c in range(4):
            M[r, c] = 0.0
        # Directions without extent: any number keeps them apart from the others.
        M[r, r] = 1e-13 if r < d or r == 3 else 1.0
    for p in range(count):
        w = table[WEIGHT, p]
        if w > 0.0:
            x, y, z = table[X, p], table[Y, p], table[Z, p]
            M[0, 0] += w * x * x
            M[0, 1] += w * x * y
            M[0, 2] += w * x * z
            M[0, 3] += w * x
            M[1, 1] += w * y * y
            M[1, 2] += w * y * z
            M[1, 3] += w * y
            M[2, 2] += w * z * z
            M[2, 3] += w * z
            M[3, 3] += w
    for r in range(4):
        for c in range(r):
            M[r, c] = M[c, r]
    # By the sweep operator, pivot after pivot; what comes out is minus the inverse.
    for k in range(4):
        over = 1.0 / M[k, k]
        for i in range(4):
            if i != k:
                share = M[i, k] * over
                for j in range(4):
                    if j != k:
                        M[i, j] -= share * M[k, j]
        for i in range(4):
            M[i, k] *= over
            M[k, i] *= over
        M[k, k] = -over
    for r in range(4):
        for c in range(4):
            M[r, c] = -M[r, c]


@kernel(inner=True)
def _form(table, count, M):
    """``q^T M q`` of every point, into the row `KAPPA`."""
    m00, m11, m22, m33 = M[0, 0], M[1, 1], M[2, 2], M[3, 3]
    m01, m02, m12 = 2.0 * M[0, 1], 2.0 * M[0, 2], 2.0 * M[1, 2]
    m03, m13, m23 = 2.0 * M[0, 3], 2.0 * M[1, 3], 2.0 * M[2, 3]
    for p in range(count):
        x, y, z = table[X, p], table[Y, p], table[Z, p]
        table[KAPPA, p] = (
            x * (m00 * x + m01 * y + m02 * z + m03)
            + y * (m11 * y + m12 * z + m13)
            + z * (m22 * z + m23)
            + m33
        )


@kernel(inner=True)
def _optimise(table, count, d, tolerance, keep, M, product):
    """Todd & Yildirim's steps towards or away from one point, until all are within tolerance.

    With ``kappa_p = q_p^T M^-1 q_p`` and m = d + 1: at the optimum kappa_p <= m, with equality
    wherever the weight is positive.
    """
    m = d + 1
    _invert_moments(table, count, d, M)
    _form(table, count, M)
    for step in range(_MAX_STEPS):
        highest = -np.inf
        lowest = np.inf
        far = 0
        near = 0
        for p in range(count):
            kappa = table[KAPPA, p]
            if kappa > highest:
                highest = kappa
                far = p
            if kappa < lowest and table[WEIGHT, p] > 0.0:
                lowest = kappa
                near = p
        above = highest / m - 1.0
        below = 1.0 - lowest / m
        if above <= tolerance and below <= tolerance:
            break
        if above >= below:
            p = far
            share = (highest - m) / (m * (highest - 1.0))
        else:
            p = near
            share = (lowest - m) / (m * (lowest - 1.0)) if lowest > 1.0 else -np.inf
            w = table[WEIGHT, p]
            share = max(share, -w / (1.0 - w)) if w < 1.0 else 0.0
        # weights <- (1 - share) weights + share e_p
        k = table[KAPPA, p]
        w = table[WEIGHT, p]
        w = 0.0 if w + share * (1.0 - w) <= 1e-16 else w * (1.0 - share) + share
        x, y, z = table[X, p], table[Y, p], table[Z, p]
        for r in range(4):
            product[r] = M[r, 0] * x + M[r, 1] * y + M[r, 2] * z + M[r, 3]
        factor = share / (1.0 - share + share * k)
        over = 1.0 / (1.0 - share)
        a, b, c, e = product[0], product[1], product[2], product[3]
        for i in range(count):
            dot = a * table[X, i] + b * table[Y, i] + c * table[Z, i] + e
            table[KAPPA, i] = (table[KAPPA, i] - factor * dot * dot) * over
            table[WEIGHT, i] *= 1.0 - share
        table[WEIGHT, p] = w
        for r in range(4):
            for s in range(4):
                M[r, s] = (M[r, s] - factor * product[r] * product[s]) * over
        if step % _EVERY == _EVERY - 1:
            # Harman & Pronzato: below this a point cannot touch the optimal ellipsoid.
            excess = max(highest - m, 0.0)
            bound = m * (
                1.0 + 0.5 * excess / m - 0.5 * np.sqrt(excess / m * (4.0 + excess / m - 4.0 / m))
            )
            kept = 0
            for i in range(count):
                if keep or table[KAPPA, i] >= bound or table[WEIGHT, i] > 0.0:
                    for row in range(5):
                        table[row, kept] = table[row, i]
                    kept += 1
            count = kept
            _invert_moments(table, count, d, M)
            _form(table, count, M)
    return count
