"""Minimum volume enclosing ellipsoids (equations 4 and 5 of Gong et al.).

Khachiyan's algorithm with the away steps of Todd & Yildirim 2007, "On Khachiyan's algorithm for
the computation of minimum-volume enclosing ellipsoids", which converges linearly, started as in
Kumar & Yildirim 2005 and with the elimination of points that cannot touch by Harman & Pronzato
2007, "Improvements on removing nonoptimal support points in D-optimum design algorithms". The
result of the iteration holds the points only up to its tolerance, so it is blown up to what the
points need.

Flat and needle-like sets have no ellipsoid of smallest volume above zero: it is computed in the
directions in which they have an extent, the others get a small radius.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.jit import kernel

FloatArray = NDArray[np.float64]

_FLAT = 1e-5
"""A direction in which points extend by less than this share of their largest extent is flat."""
_MAX_STEPS = 20_000
_EVERY = 12
"""Steps between eliminations."""


@dataclass(frozen=True)
class Ellipsoid:
    """A solid ellipsoid.

    Attributes:
        centre: Middle [m], shape [3].
        axes: Unit half-axis directions as columns, right-handed, shape [3, 3].
        radii: Their lengths [m], longest first, shape [3].
    """

    centre: FloatArray
    axes: FloatArray
    radii: FloatArray

    @property
    def to_ball(self) -> FloatArray:
        """The matrix A with ``|A (x - centre)| <= 1`` inside; Q = A^T A, shape [3, 3]."""
        result: FloatArray = self.axes.T / self.radii[:, None]
        return result

    @property
    def Q(self) -> FloatArray:  # noqa: N802
        """The symmetric positive definite matrix of equation (4), shape [3, 3]."""
        A = self.to_ball
        result: FloatArray = A.T @ A
        return result

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return float(4.0 / 3.0 * np.pi * np.prod(self.radii))

    def zeta(self, points: FloatArray) -> FloatArray:
        """``(x - c)^T Q (x - c)``: at most 1 inside, shape [n]."""
        local = (points - self.centre) @ self.to_ball.T
        result: FloatArray = np.einsum("nk,nk->n", local, local)
        return result

    def radial_error(self, points: FloatArray) -> FloatArray:
        """Distance of points to the surface along the ray from the centre (equation 6), [n]."""
        offset = points - self.centre
        length = np.linalg.norm(offset, axis=1)
        zeta = self.zeta(points)
        # At the centre itself every ray is as good; the shortest is taken.
        safe = np.maximum(zeta, 1e-20)
        result: FloatArray = np.where(
            zeta > 1e-20, length * np.abs(1.0 / np.sqrt(safe) - 1.0), self.radii[-1]
        )
        return result


def mvee(points: FloatArray, *, tolerance: float = 1e-3, min_radius: float = 1e-4) -> Ellipsoid:
    """The ellipsoid of smallest volume that holds all points.

    Args:
        points: Positions [m], shape [n, 3], n at least 1.
        tolerance: Its volume is at most about ``(1 + tolerance)**1.5`` times the smallest.
        min_radius: Radius in directions without extent [m].

    Returns:
        An ellipsoid whose `zeta` is at most 1 for every point.

    Raises:
        GeometryError: No points, or not finite.
    """
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    if not len(points) or not np.isfinite(points).all():
        raise GeometryError("an ellipsoid needs at least one point, all of them finite")
    middle = points.mean(axis=0)
    centred = points - middle
    spread, axes = np.linalg.eigh(centred.T @ centred)
    spread, axes = spread[::-1], np.ascontiguousarray(axes[:, ::-1])
    local = centred @ axes
    extent = np.abs(local).max(axis=0)
    floor = max(min_radius, 1e-3 * float(extent[0]) if extent[0] * _FLAT > min_radius else 0.0)
    rank = int((extent > max(_FLAT * extent[0], 1e-9)).sum())
    if rank:
        scale = np.sqrt(spread[:rank] / len(points))
        shape, centre = _khachiyan(np.ascontiguousarray(local[:, :rank] / scale), tolerance)
        half = np.linalg.cholesky(shape) * scale[:, None]
        inner, radii, _ = np.linalg.svd(half)
        middle = middle + axes[:, :rank] @ (centre * scale)
        axes = np.column_stack([axes[:, :rank] @ inner, axes[:, rank:]])
        radii = np.concatenate([radii, 10.0 * extent[rank:]])
    else:
        radii = np.zeros(3)
    radii = np.maximum(radii, floor)
    order = np.argsort(-radii, kind="stable")
    axes, radii = axes[:, order], radii[order]
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] = -axes[:, 2]
    ellipsoid = Ellipsoid(middle, axes, radii)
    # What is asked for: it holds the points, also after rounding.
    needed = float(ellipsoid.zeta(points).max())
    if needed > 1.0 - 1e-12:
        ellipsoid = Ellipsoid(middle, axes, radii * (np.sqrt(needed) * (1.0 + 1e-12)))
    return ellipsoid


def _khachiyan(x: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Shape matrix P (``(x - c)^T P^-1 (x - c) <= 1``) and centre c for points [n, d]."""
    n, d = x.shape
    if n <= 1 or d == 0:
        return np.eye(max(d, 1)) * 1e-18, x.mean(axis=0)
    lifted = np.column_stack([x, np.ones(n)])
    weight = np.zeros(n)
    _start(x, weight)
    _optimise(lifted, weight, tolerance, _MAX_STEPS)
    weight /= weight.sum()
    centre = weight @ x
    shifted = (x - centre) * np.sqrt(weight)[:, None]
    shape = d * (shifted.T @ shifted)
    # Two identical extremes leave a direction empty; keep the factorisation alive.
    shape += np.eye(d) * (1e-14 * np.trace(shape))
    return shape, centre


@kernel()
def _start(x, weight):
    """Kumar & Yildirim's first guess: extreme points in d orthogonal directions."""
    n, d = x.shape
    basis = np.zeros((d, d))
    direction = np.zeros(d)
    for k in range(d):
        # The coordinate axis that the directions so far leave most of.
        best = -1.0
        for axis in range(d):
            left = 1.0
            for j in range(k):
                left -= basis[j, axis] ** 2
            if left > best:
                best = left
                chosen = axis
        for i in range(d):
            direction[i] = 1.0 if i == chosen else 0.0
        for j in range(k):
            dot = basis[j, chosen]
            for i in range(d):
                direction[i] -= dot * basis[j, i]
        low = np.inf
        high = -np.inf
        at_low = 0
        at_high = 0
        for p in range(n):
            value = 0.0
            for i in range(d):
                value += x[p, i] * direction[i]
            if value < low:
                low = value
                at_low = p
            if value > high:
                high = value
                at_high = p
        weight[at_low] = 1.0
        weight[at_high] = 1.0
        length = 0.0
        for i in range(d):
            step = x[at_high, i] - x[at_low, i]
            for j in range(k):
                dot = 0.0
                for m in range(d):
                    dot += basis[j, m] * (x[at_high, m] - x[at_low, m])
                step -= dot * basis[j, i]
            basis[k, i] = step
            length += step * step
        length = np.sqrt(length)
        if length < 1e-12:
            for i in range(d):
                basis[k, i] = direction[i]
            length = 1e-30
            for i in range(d):
                length += direction[i] ** 2
            length = np.sqrt(length)
        for i in range(d):
            basis[k, i] /= length
    total = weight.sum()
    for p in range(n):
        weight[p] /= total


@kernel()
def _inverse_of_moments(lifted, weight, active, count):
    """Inverse of ``sum w q q^T``, with just enough added to have one."""
    m = lifted.shape[1]
    M = np.zeros((m, m))
    for i in range(count):
        p = active[i]
        if weight[p] > 0.0:
            for r in range(m):
                for c in range(m):
                    M[r, c] += weight[p] * lifted[p, r] * lifted[p, c]
    for r in range(m):
        M[r, r] += 1e-13
    return np.linalg.inv(M)


@kernel()
def _optimise(lifted, weight, tolerance, max_steps):
    """Todd & Yildirim's steps towards or away from one point, until all are within tolerance.

    With ``k_p = q_p^T M^-1 q_p`` and m = d + 1: at the optimum k_p <= m, with equality wherever
    the weight is positive.
    """
    n, m = lifted.shape
    active = np.arange(n)
    count = n
    kappa = np.zeros(n)
    product = np.zeros(m)
    M_inverse = _inverse_of_moments(lifted, weight, active, count)
    for i in range(count):
        p = active[i]
        kappa[p] = 0.0
        for r in range(m):
            for c in range(m):
                kappa[p] += lifted[p, r] * M_inverse[r, c] * lifted[p, c]
    for step in range(max_steps):
        highest = -np.inf
        lowest = np.inf
        far = 0
        near = -1
        for i in range(count):
            p = active[i]
            if kappa[p] > highest:
                highest = kappa[p]
                far = p
            if weight[p] > 0.0 and kappa[p] < lowest:
                lowest = kappa[p]
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
            share = max(share, -weight[p] / (1.0 - weight[p])) if weight[p] < 1.0 else 0.0
        # weights <- (1 - share) weights + share e_p
        k = kappa[p]
        removed = weight[p] + share * (1.0 - weight[p]) <= 1e-16
        for i in range(count):
            weight[active[i]] *= 1.0 - share
        weight[p] = 0.0 if removed else weight[p] + share
        for r in range(m):
            product[r] = 0.0
            for c in range(m):
                product[r] += M_inverse[r, c] * lifted[p, c]
        factor = share / (1.0 - share + share * k)
        for r in range(m):
            for c in range(m):
                M_inverse[r, c] = (M_inverse[r, c] - factor * product[r] * product[c]) / (
                    1.0 - share
                )
        for i in range(count):
            q = lifted[active[i]]
            dot = 0.0
            for r in range(m):
                dot += q[r] * product[r]
            kappa[active[i]] = (kappa[active[i]] - factor * dot * dot) / (1.0 - share)
        if step % _EVERY == _EVERY - 1:
            # Harman & Pronzato: below this a point cannot touch the optimal ellipsoid.
            excess = max(highest - m, 0.0)
            bound = m * (
                1.0 + 0.5 * excess / m - 0.5 * np.sqrt(excess / m * (4.0 + excess / m - 4.0 / m))
            )
            kept = 0
            for i in range(count):
                p = active[i]
                if kappa[p] >= bound or weight[p] > 0.0:
                    active[kept] = p
                    kept += 1
            count = kept
            M_inverse = _inverse_of_moments(lifted, weight, active, count)
            for i in range(count):
                p = active[i]
                kappa[p] = 0.0
                for r in range(m):
                    for c in range(m):
                        kappa[p] += lifted[p, r] * M_inverse[r, c] * lifted[p, c]
    return 0
