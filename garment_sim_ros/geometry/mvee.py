"""Minimum volume enclosing ellipsoids (equations 4 and 5 of Gong et al.).

Weights by `find_weights`, of points scaled to spread alike in every direction; their moments are
the ellipsoid. It holds the points only up to the tolerance, so it is blown up to what they need.

Flat and needle-like sets have no ellipsoid of smallest volume above zero: it is computed in the
directions in which they have an extent, the others get a small radius.
"""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.khachiyan import WEIGHT, find_weights, room_for_points
from garment_sim_ros.geometry.principal_axes import principal_axes
from garment_sim_ros.jit import kernel

_FLAT = 1e-5
"""A direction in which points extend by less than this share of their largest extent is flat."""


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
    found = np.empty((5, 3))
    room, no_guess = room_to_enclose(len(points)), np.empty(0)
    enclose(points, len(points), tolerance, min_radius, no_guess, room, found)
    ellipsoid = Ellipsoid(found[0], found[1:4], found[4])
    # Once more for the numbers as others round them.
    needed = float(ellipsoid.zeta(points).max())
    if needed > 1.0 - 1e-12:
        ellipsoid = Ellipsoid(found[0], found[1:4], found[4] * (np.sqrt(needed) * (1.0 + 1e-12)))
    return ellipsoid


def room_to_enclose(n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Scratch of `enclose` for up to n points."""
    return *room_for_points(n), np.empty((4, 3, 3))


@kernel(inner=True)
def _into_axes(points, count, min_radius, table, S, axes, centre, radii):
    """Centre, principal axes and scaled coordinates of points, into what is passed.

    Returns:
        How many axes the points are spread along, and the least radius [m].
    """
    for r in range(3):
        centre[r] = 0.0
        for p in range(count):
            centre[r] += points[p, r]
        centre[r] /= count
    _moments(points, count, centre, S)
    principal_axes(S, axes)
    _sort(S, axes)
    rank = 0
    for k in range(3):
        a, b, c = axes[0, k], axes[1, k], axes[2, k]
        extent = 0.0
        for p in range(count):
            x = a * (points[p, 0] - centre[0])
            x += b * (points[p, 1] - centre[1]) + c * (points[p, 2] - centre[2])
            table[k, p] = x
            extent = max(extent, abs(x))
        radii[k] = extent
        rank += 1 if extent > max(_FLAT * radii[0], 1e-9) else 0
    floor = max(min_radius, 1e-3 * radii[0] if radii[0] * _FLAT > min_radius else 0.0)
    for k in range(3):
        # How far points are out on average; what is flat is left out.
        scale = np.sqrt(S[k, k] / count) if k < rank else 0.0
        for p in range(count):
            table[k, p] = table[k, p] / scale if k < rank else 0.0
        radii[k] = scale if k < rank else 10.0 * radii[k]
    return rank, floor


@kernel(inner=True)
def _hold_points(points, count, centre, R, radii):
    """Makes radii [m] as large as it takes to hold the points, also after rounding."""
    needed = 0.0
    for p in range(count):
        zeta = 0.0
        for k in range(3):
            x = 0.0
            for r in range(3):
                x += R[r, k] * (points[p, r] - centre[r])
            zeta += (x / radii[k]) ** 2
        needed = max(needed, zeta)
    if needed > 1.0 - 1e-12:
        for k in range(3):
            radii[k] *= np.sqrt(needed) * (1.0 + 1e-12)


@kernel(forceinline=True)
def enclose(points, count, tolerance, min_radius, guess, scratch, found):
    """See `mvee`; allocates nothing.

    Args:
        points: Positions [m], finite, shape [at least count, 3].
        count: How many there are, at least 1.
        tolerance: See `mvee`.
        min_radius: See `mvee`.
        guess: Weights of the points in an ellipsoid near this one, or zeros; those of this one
            afterwards. Shape [count], or empty.
        scratch: Of `room_to_enclose`.
        found: Output: centre, three rows of the matrix of axes, and radii [m], shape [5, 3].
    """
    table, weights_scratch, matrices = scratch
    S, axes, inner, middle = matrices[0], matrices[1], matrices[2], matrices[3, 0]
    centre, radii = found[0], found[4]
    rank, floor = _into_axes(points, count, min_radius, table, S, axes, centre, radii)
    if rank > 0:
        keep = guess.size > 0
        for p in range(guess.size):
            table[WEIGHT, p] = guess[p]
        left = find_weights(table, count, rank, tolerance, keep, weights_scratch)
        for p in range(guess.size):
            guess[p] = table[WEIGHT, p]
        _weighted_moments(table, left, rank, radii, middle, S)
    for k in range(3):
        if k >= rank:
            S[k, k] = radii[k] ** 2
        for r in range(3):
            centre[r] += axes[r, k] * middle[k] if k < rank else 0.0
    principal_axes(S, inner)
    _sort(S, inner)
    for r in range(3):
        for k in range(3):
            found[1 + r, k] = (
                axes[r, 0] * inner[0, k] + axes[r, 1] * inner[1, k] + axes[r, 2] * inner[2, k]
            )
    R = found[1:4]
    # Right-handed.
    R[0, 2] = R[1, 0] * R[2, 1] - R[2, 0] * R[1, 1]
    R[1, 2] = R[2, 0] * R[0, 1] - R[0, 0] * R[2, 1]
    R[2, 2] = R[0, 0] * R[1, 1] - R[1, 0] * R[0, 1]
    for k in range(3):
        radii[k] = max(np.sqrt(max(S[k, k], 0.0)), floor)
    _hold_points(points, count, centre, R, radii)


@kernel(inner=True)
def _moments(points, count, centre, S):
    """Sum of squares and products about a centre, shape [3, 3]."""
    for r in range(3):
        for c in range(r + 1):
            total = 0.0
            for p in range(count):
                total += (points[p, r] - centre[r]) * (points[p, c] - centre[c])
            S[r, c] = total
            S[c, r] = total


@kernel(inner=True)
def _weighted_moments(table, count, d, scale, middle, S):
    """Centre and shape matrix of the ellipsoid that weights describe, scaled back.

    Args:
        table: See `find_weights`.
        count: Number of points.
        d: Number of dimensions.
        scale: Of each coordinate [m], shape [3].
        middle: Output: centre [m], zero beyond d, shape [3].
        S: Output: shape matrix [m^2], zero beyond d, shape [3, 3].
    """
    whole = 0.0
    for p in range(count):
        whole += table[WEIGHT, p]
    for r in range(3):
        middle[r] = 0.0
        for p in range(count):
            middle[r] += table[WEIGHT, p] * table[r, p] / whole
    for r in range(3):
        for c in range(r + 1):
            total = 0.0
            for p in range(count):
                total += table[WEIGHT, p] * (table[r, p] - middle[r]) * (table[c, p] - middle[c])
            # Identical extremes leave a direction empty: it is kept alive.
            total = d * total / whole + (1e-14 * d if r == c else 0.0)
            inside = r < d and c < d
            S[r, c] = total * scale[r] * scale[c] if inside else 0.0
            S[c, r] = S[r, c]
    for r in range(3):
        middle[r] *= scale[r] if r < d else 0.0


@kernel(inner=True)
def _sort(S, axes):
    """Largest eigenvalue first, in place."""
    for last in range(2, 0, -1):
        for k in range(last):
            if S[k, k] < S[k + 1, k + 1]:
                S[k, k], S[k + 1, k + 1] = S[k + 1, k + 1], S[k, k]
                for r in range(3):
                    axes[r, k], axes[r, k + 1] = axes[r, k + 1], axes[r, k]
