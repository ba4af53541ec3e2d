"""Edges of pattern pieces as curves: straight lines, Bezier curves, arcs of circles."""

from itertools import pairwise

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GeometryError

_SAMPLES = 257
"""Points that a curve is measured with: an arc of a quarter circle is then 1e-6 of it short."""


def bezier(points: FloatArray, count: int = _SAMPLES) -> FloatArray:
    """Points on a Bezier curve of degree 1 to 3 at even parameters, shape [count, 2].

    Args:
        points: Its control points, ends included [m], shape [2 to 4, 2].
        count: How many.
    """
    t = np.linspace(0.0, 1.0, count)[:, None]
    level = [np.broadcast_to(p, (count, 2)) for p in np.asarray(points, dtype=np.float64)]
    while len(level) > 1:
        level = [(1.0 - t) * a + t * b for a, b in pairwise(level)]
    return level[0].copy()


def arc(
    start: FloatArray,
    end: FloatArray,
    radius: float,
    *,
    large: bool = False,
    right: bool = False,
    count: int = _SAMPLES,
) -> FloatArray:
    """Points on an arc of a circle, shape [count, 2].

    Args:
        start: Its first point [m], shape [2].
        end: Its last point [m], shape [2].
        radius: Radius of the circle [m].
        large: Whether it is the longer one of the two arcs.
        right: Whether it bulges to the right, seen from `start` to `end`.
        count: How many points.

    Raises:
        GeometryError: The circle is too small to reach both points.
    """
    chord = end - start
    half = 0.5 * float(np.linalg.norm(chord))
    if not radius >= half * (1.0 - 1e-9) or half == 0.0:
        raise GeometryError(
            f"an arc of radius {radius:.4g} m between points {2.0 * half:.4g} m apart; "
            "allowed: at least half of that, and different points"
        )
    along = chord / (2.0 * half)
    left = np.array([-along[1], along[0]])
    rise = np.sqrt(max(radius**2 - half**2, 0.0))
    # The shorter arc that bulges to the right has its centre on the left.
    toward = 1.0 if right != large else -1.0
    centre = start + half * along + toward * rise * left
    angle = np.arctan2(*(start - centre)[::-1])
    span = 2.0 * np.arcsin(min(half / radius, 1.0))
    if large:
        span = 2.0 * np.pi - span
    a = angle + (1.0 if right else -1.0) * np.linspace(0.0, span, count)
    points = centre + radius * np.stack([np.cos(a), np.sin(a)], axis=1)
    points[0], points[-1] = start, end
    return points


def lengths(points: FloatArray) -> FloatArray:
    """Way along a polyline up to each of its points [m], shape [n]."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def at_shares(points: FloatArray, shares: FloatArray) -> FloatArray:
    """Points at shares of a polyline's length, 0 at its start, shape [n, 2]."""
    way = lengths(points)
    place = np.asarray(shares) * way[-1]
    return np.stack([np.interp(place, way, points[:, k]) for k in range(2)], axis=1)


def signed_area(polygon: FloatArray) -> float:
    """Area of a closed polygon [m^2], above 0 where it runs counter-clockwise."""
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def self_crossing(polygon: FloatArray) -> bool:
    """Whether edges of a closed polygon cross or touch each other beside its corners."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    n = len(a)
    d = b - a
    for i in range(n - 2):
        j = np.arange(i + 2, n if i else n - 1)
        if not len(j):
            continue
        r = a[j] - a[i]
        cross = d[i, 0] * d[j, 1] - d[i, 1] * d[j, 0]
        safe = np.where(np.abs(cross) > 1e-15, cross, np.inf)
        s = (r[:, 0] * d[j, 1] - r[:, 1] * d[j, 0]) / safe
        t = (r[:, 0] * d[i, 1] - r[:, 1] * d[i, 0]) / safe
        within = (s > -1e-9) & (s < 1.0 + 1e-9) & (t > -1e-9) & (t < 1.0 + 1e-9)
        if (within & np.isfinite(safe)).any():
            return True
    return False
